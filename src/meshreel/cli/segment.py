"""`meshreel segment`: label which faces of a scene move, and with which body."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from cyclopts import Parameter

from ..analysis.scene.labelling import Segmentation
from ..analysis.scene.masks import CAMERAS, Masker, Picture, label_colors, look_at_labels, sheet, write_views
from ..analysis.scene.segmentation import mask_views, scene_views, segment, segment_by
from ..encoder.group.progress import Stages
from ..encoder.scene.scene import label_frames
from ..encoder.settings.options import EncoderOptions, SceneOptions
from ..errors import InputError
from ..geometry.cameras import pack_cameras
from ..geometry.derived_sequences import upright
from ..geometry.work import reporting
from ..io.pictures import is_mask
from ..io.write import (
    check_free,
    frame_names,
    left_over,
    make_folder,
    replacing,
    write_colored,
    write_file,
    write_picture,
)
from ..types import MeshSequence, evenly
from .console import Common, Force
from .sources import Masking, Reading, open_source

COLUMNS = 4  # views in the sheet (guess)
MOST_PREVIEWS = 16  # frames whose pictures are in memory together (guess)
LABELS, COLORED, SHEET = "labels", "colored", "sheet.png"


def command(
    inputs: list[str],
    /,
    *,
    output: Annotated[Path, Parameter(name=["--output", "-o"])],
    reading: Reading = Reading(),
    masking: Masking = Masking(),
    views_only: Annotated[bool, Parameter(negative="")] = False,
    previews: int = 4,
    force: Force = False,
    common: Common = Common(),
) -> None:
    """Label which faces of a scene move, and with which body.

    Parameters
    ----------
    inputs
        A directory, a glob, mesh files or an .npz, as `encode` takes them; or a rig's folder, as `capture` takes it.
    output
        The output directory; created if needed. In labels/frame_00000.npz and so on, `np.load(file)["moving"]` is True
        for each face that moves, and `np.load(file)["bodies"]` is the number of its body from 1, 0 for none; faces are
        the triangles of the frame after reading and welding. The views are in cameras.json; sheet.png shows some frames
        from some views, with a color for each body, and colored/ holds the same frames as PLY with colors.
    views_only
        Write only pictures of the views, view00/frame_00000.png and so on, and cameras.json: those of a rig's colour
        cameras, or normals as colors. Masks of these pictures, under the same names, are a folder for --masks.
    previews
        Number of frames in the sheet and in colored/, evenly spread; 0 for neither.
    """
    if not 0 <= previews <= MOST_PREVIEWS:
        raise InputError(f"--previews {previews}: give 0 to {MOST_PREVIEWS}")
    if views_only and (masking.masks or masking.sam3):
        raise InputError("--views-only needs no masks; leave out --masks and --sam3")
    source = open_source(inputs, reading, common)
    scene, sequence = SceneOptions(masking.cameras), upright(source.sequence, masking.up)
    masker = masking.masker(len(source.sequence))
    left = _left_over(output, len(source.sequence), views_only, previews)
    kept = ("view*/frame_*.png",) if views_only else (f"{LABELS}/frame_*.npz", f"{COLORED}/frame_*.ply", SHEET)
    check_free((path for name in (*kept, CAMERAS) for path in sorted(output.glob(name))), force)
    if views_only:
        views, colors = mask_views(sequence, scene.cameras)
        with common.stages() as progress:
            write_views(output, sequence, views, lambda done: progress("look", done, len(sequence)), colors)
        row = {"frames": len(sequence), "views": len(views)}
        text = f"{output}: pictures of {row['frames']} frames from {row['views']} views, and {CAMERAS}"
    else:
        row = _write_labels(sequence, masker, scene, output, previews, common)
        text = f"{output}: {_describe(row)}"
    warnings = (*source.warnings, *getattr(masker, "remarks", ()), *left)
    common.warn(warnings)
    common.result({"output": str(output), "warnings": warnings} | row, text)


def _left_over(output: Path, count: int, views_only: bool, previews: int) -> tuple[str, ...]:
    """Return a line for each folder with other files of an earlier run. Raises InputError for masks."""
    if views_only:
        places = sorted(output.glob("view*"))
        painted = [path for place in places for path in sorted(place.glob("frame_*.png")) if is_mask(path)]
        if painted:
            text = f"{painted[0]} and {len(painted) - 1} others are masks"
            raise InputError(f"{text}, which pictures would replace; choose another folder, and paint in a copy")
        return tuple(line for place in places for line in left_over(place, frame_names(count, "png")))
    colored = [frame_names(count, "ply")[number] for number in evenly(count, previews)]
    return (*left_over(output / LABELS, frame_names(count, "npz")), *left_over(output / COLORED, colored))


def _write_labels(
    frames: MeshSequence, masker: Masker | None, options: SceneOptions, output: Path, previews: int, common: Common
) -> dict[str, Any]:
    count = len(frames)
    chosen = evenly(count, previews)
    names = [Path(name).stem for name in frame_names(count, "npz")]
    moving, of_bodies, rows = list[int](), list[list[int]](), list[tuple[int, list[Picture], list[int]]]()
    with common.stages() as progress:
        by: Segmentation
        if masker is None:
            views = scene_views(frames, options.cameras)
            stages = Stages(partial(progress.encode, name="segment"), count)
            stages.expect("segment")
            with reporting(stages.passed):
                by = segment(frames, options.cameras)
            stages.finish()
        else:
            masks = segment_by(masker, frames, options.cameras)
            views, by = tuple(masks.views), masks
            progress("segment", count, count)
        for folder in (LABELS, *([COLORED] if chosen else [])):
            make_folder(output / folder)
        for number, (moves, body_of) in enumerate(label_frames(frames, by, EncoderOptions(scene=options))):
            with replacing(output / LABELS / f"{names[number]}.npz") as file:
                np.savez_compressed(file, moving=moves, bodies=body_of)
            moving.append(int(moves.sum()))
            of_bodies.append(np.bincount(body_of).tolist())
            if number in chosen:
                mesh = frames[number]
                write_colored(mesh, label_colors(moves, body_of), output / COLORED / f"{names[number]}.ply")
                rows.append((number, *look_at_labels(mesh, moves, body_of, views)))
            progress("label", number + 1, count)
    write_file(output / CAMERAS, pack_cameras(views))
    if chosen:
        most = np.sum([counts for *_, counts in rows], axis=0)  # moving faces in each view
        best = sorted(np.argsort(-most, kind="stable")[:COLUMNS].tolist())
        cells = [(number, [pictures[view] for view in best]) for number, pictures, _ in rows]
        write_picture(sheet(cells, best), output / SHEET)
    return _totals(moving, of_bodies) | {"views": len(views)}


def _totals(moving: list[int], of_bodies: list[list[int]]) -> dict[str, Any]:
    """Return counts over all frames, from the moving faces of each frame and the faces of each of its bodies."""
    bodies = []
    for number in range(1, max(map(len, of_bodies))):  # 0: faces of no body
        faces = [counts[number] for counts in of_bodies if len(counts) > number and counts[number]]
        bodies += [{"body": number, "frames": len(faces), "faces": sum(faces) // len(faces)}] if faces else []
    totals = [sum(counts) for counts in of_bodies]
    shares = [count / max(total, 1) for count, total in zip(moving, totals, strict=True)]
    counted = {"frames": len(totals), "faces": sum(totals), "moving": sum(moving)}
    share = sum(moving) / max(sum(totals), 1)
    shares_row = {"moving_share": share, "moving_share_least": min(shares), "moving_share_most": max(shares)}
    return counted | shares_row | {"bodies": bodies}


def _describe(row: dict[str, Any]) -> str:
    share = f"{100 * row['moving_share']:.1f} % of the faces move"
    spread = f"{100 * row['moving_share_least']:.1f} to {100 * row['moving_share_most']:.1f} % in a frame"
    bodies = [f"{body['body']} in {body['frames']} frames, {body['faces']} faces" for body in row["bodies"]]
    body_list = f"{len(bodies)} bodies ({'; '.join(bodies)})" if bodies else "no bodies"
    return f"{row['frames']} frames, {share} ({spread}), {body_list}"
