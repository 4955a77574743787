"""`meshreel compare`: compare original meshes with decoded ones by every metric."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from cyclopts import Parameter
from rich.table import Table

from ..analysis.appearance.splat_fit import GOLDEN, SplatView, rendered, ring, taken
from ..analysis.appearance.splat_raster import draw
from ..capture.rig.cameras import at_frame
from ..capture.simulated.simulated_rig import Truth, read_truth
from ..container.sources import FileSource
from ..decoder.describe import describe_file
from ..decoder.video import Video
from ..decoder.video import open as open_video
from ..errors import FormatError, InputError
from ..export.frames import check_splats
from ..export.shapes import check_output
from ..format.layout import MAGIC, ChunkKind
from ..geometry.cameras import Camera
from ..geometry.derived_sequences import CapturedSequence, captured, picked
from ..geometry.splats import Bound
from ..geometry.topology import weld
from ..io.sequence import SequenceOptions, open_sequence
from ..metrics.color import PEAK, psnr
from ..metrics.comparison import ComparisonOptions, compare_sequences
from ..metrics.depth import DepthJudge, judge
from ..metrics.error_sheet import SheetOptions, write_sheet
from ..metrics.render import BORDER, ssim_map
from ..metrics.scene_accuracy import Scene, Sight, compare_with_truth
from ..metrics.viewpoints import read_cameras
from ..types import UP_AXES, Frames, MeshSequence, evenly
from .console import Common, StageBars
from .sources import Knowing, Looking, Reading, open_source

ALIKE = 0.2  # share of the measured depth: a decoded scene that covers less is of another recording (guess)
OF_BOTH = {"truth": "against the truth", "depth": "by the depth pictures"}  # metrics of originals and decoded meshes


def command(
    originals: str,
    decoded: str,
    /,
    *,
    reading: Reading = Reading(),
    looking: Looking = Looking(),
    sheet: Path | None = None,
    sheet_frames: Annotated[tuple[int, ...], Parameter(consume_multiple=True, negative="")] = (),
    splats: Annotated[bool, Parameter(negative="")] = False,
    knowing: Knowing = Knowing(),
    common: Common = Common(),
) -> None:
    """Compare original meshes with decoded ones by every metric, and print the rate of a .reel file.

    With --truth, the original and decoded meshes of a scene are also compared with the clean ones: the whole scene,
    people (faces whose nearest clean face moves) and background. The numbers of the originals are the noise floor.
    Frames of a rig are also judged by its depth pictures: what of them is covered, invented and lost, and flickers.

    Parameters
    ----------
    originals
        The original sequence: a directory, a glob, a file, an .npz or a rig's folder. Give --frames and --scale as for
        `encode`.
    decoded
        A .reel file, or the decoded meshes; --frames chooses from it, too, unless it has just these frames.
    sheet
        Write a PNG of original, decoded mesh and error heat map, seen from --cameras, from a rig's cameras, or from the
        front.
    sheet_frames
        Frames in the sheet, by their numbers in DECODED; by default the first, the middle and the last.
    splats
        Compare pictures of the splats of a .reel file, too: with renders of coloured originals from cameras that were
        not fitted to, or with the pictures of a rig. PSNR and SSIM are of pictures that are cut to the bodies.
    """
    if sheet is not None:
        check_output(sheet)
        import_module("matplotlib")  # if it is missing, fail before minutes of measuring
    source = open_source([originals], reading, common)
    sequence, as_read = source.sequence, SequenceOptions(reading.fps, weld=weld)
    stored: MeshSequence = open_video(decoded) if is_reel(decoded) else open_sequence(decoded, as_read)
    same = len(stored) == len(sequence)
    numbers = range(len(stored)) if same else reading.options().chosen(len(stored))  # of the frames in `decoded`
    other = stored if same else picked(stored, numbers)
    if len(sequence) != len(other):
        raise InputError(f"{originals} has {len(sequence)} frames and {decoded} {len(other)}; choose with --frames A:B")
    sheet_options = SheetOptions(sheet_frames, _sheet_cameras(looking, sequence), up=looking.up, first=numbers.start)
    if splats:
        if not isinstance(other, Video):
            raise InputError(f"{decoded}: --splats needs a .reel file with the frames of {originals}; see meshreel cut")
        check_splats(other, decoded)
    truth = None if knowing.truth is None else open_truth(knowing.truth, reading, len(sequence))
    try:
        with common.stages() as progress:
            row = compare_sequences(sequence, counted(other, progress), _options(looking, sequence, other)).to_row()
            if captured(sequence).depth is not None:
                row["depth"] = by_depth(captured(sequence), other, progress)
            if splats and isinstance(other, Video):
                row |= compare_splats(sequence, other, progress)
            if truth is not None:
                looked_at = range(0, len(sequence), knowing.truth_every)
                row["truth"] = against_truth(sequence, other, truth, looked_at, progress)
        if sheet is not None:
            write_sheet(sequence, other, sheet, sheet_options)
    except FormatError as error:  # names the chunk, but not the file
        raise FormatError(f"{decoded}: {error}; copy the file again, or compare frames before it") from None
    warnings = [*source.warnings, *(f"{decoded}: {w}" for w in getattr(stored, "warnings", ()))]
    warnings += _other(row, originals, decoded)
    described = describe_file(Path(decoded)) if isinstance(stored, Video) else {}
    rates = ("bytes", "mbps", "bytes_by_content", "mbps_by_content")
    row = {"warnings": warnings} | {name: described[name] for name in rates if described} | row
    common.warn(warnings)
    texts: list[object] = [both_table(title, row[name]) for name, title in OF_BOTH.items() if name in row]
    texts += [f"picture: {sheet}"] if sheet is not None else []
    common.result(row, metric_table(row), *_cameras(row), *texts)


def _other(row: dict[str, Any], originals: str, decoded: str) -> Iterator[str]:
    """Yield a warning if the decoded surface covers hardly any of the depth pictures of a rig."""
    own, share = (row["depth"][name]["all_covered"] for name in ("originals", "decoded")) if "depth" in row else (0, 0)
    if (share or 0.0) < ALIKE <= (own or 0.0):
        text = f"{decoded}: covers {100 * (share or 0.0):.0f} % of what the depth cameras of {originals} measured"
        yield f"{text}; is it of another recording, or of other frames (--frames)?"


def _options(looking: Looking, sequence: MeshSequence, decoded: MeshSequence) -> ComparisonOptions:
    """Return the options, with a file's own key frames unless others are given, and no SSIM beside depth pictures."""
    options = looking.options(captured(sequence).depth is None)
    if isinstance(decoded, Video) and not options.keys:
        recorded = decoded.reader.metadata.get("key_frames")
        numbers = recorded if isinstance(recorded, list) else []  # a foreign file may have invalid values
        return replace(options, keys=tuple(n for n in numbers if type(n) is int and 0 <= n < len(decoded)))
    return options


def _sheet_cameras(looking: Looking, sequence: MeshSequence) -> tuple[Camera, ...]:
    """Return the given cameras, or those of the rig that have the picture size of its first one."""
    if looking.cameras is not None:
        return tuple(read_cameras(looking.cameras))
    depth = captured(sequence).depth
    views = [picture.camera for picture in ([] if depth is None else depth[0]) if picture is not None]
    return tuple(view for view in views if (view.width, view.height) == (views[0].width, views[0].height))


def open_truth(folder: Path, reading: Reading, count: int) -> Truth:
    """Open the truth of `count` frames chosen by `reading`. Raises InputError if it has another length."""
    truth = read_truth(folder)
    numbers = reading.options().chosen(len(truth))
    if len(numbers) != count:
        chosen = "" if len(numbers) == len(truth) else f" of {len(truth)} that --frames {reading.frames} leaves"
        text = f"{folder} is the truth of {len(numbers)} frames{chosen}, the originals have {count}"
        raise InputError(f"{text}; give that of the same recording, or choose with --frames A:B")
    return truth.only(numbers)


def against_truth(
    sequence: MeshSequence, other: Frames, truth: Truth, numbers: Sequence[int], progress: StageBars
) -> dict[str, Any]:
    """Compare the meshes of some frames with the clean ones, as `compare_with_truth` does."""

    def clean(number: int) -> Scene:
        frame = truth[number]
        sights = [Sight(at_frame(camera, number).view, *camera.depth_range) for camera in truth.cameras]
        return Scene(frame.mesh, frame.dynamic, sights, complete=True)

    return compare_with_truth(sequence, other, clean, numbers, lambda done: progress("truth", done, len(numbers)))


def by_depth(sequence: CapturedSequence, decoded: MeshSequence, progress: StageBars) -> dict[str, Any]:
    """Judge a recording's own frames and the decoded ones by its depth pictures."""
    assert sequence.depth is not None
    judged = DepthJudge(sequence.depth, len(sequence), UP_AXES[sequence.up])
    chunks = decoded.reader.chunks if isinstance(decoded, Video) else ()
    refreshes = {chunk.first_frame for chunk in chunks if chunk.kind == ChunkKind.STATIC}
    rows = dict[str, Any]()
    for name, frames, changed in (("originals", sequence, set[int]()), ("decoded", decoded, refreshes)):
        rows[name] = judge(judged, frames, counted(range(len(sequence)), progress, f"depth of {name}"), changed)
    return {"frames": list(range(len(sequence)))} | rows


def both_table(title: str, row: dict[str, Any]) -> Table:
    """Return a table with a line for each metric: its values for originals and for decoded meshes."""
    beside, decoded = (row[name] for name in row if name not in ("frames", "per_frame"))
    table = Table(f"{title}, {len(row['frames'])} frames", "originals (noise floor)", "decoded")
    for name in decoded:
        if name not in ("frames", "per_frame") and (beside[name], decoded[name]) != (None, None):
            table.add_row(name, _number(beside[name]), _number(decoded[name]))
    return table


def is_reel(path: str) -> bool:
    """Return True for names that end in .reel and for files with its signature."""
    if path.endswith(".reel") or not Path(path).is_file():
        return path.endswith(".reel")
    with FileSource(path) as source:
        return source.get_bytes(0, len(MAGIC)) == MAGIC


def metric_table(row: dict[str, Any]) -> Table:
    """Return a table of metrics that some frame has: mean over frames, worst frame, and mean without key frames."""
    columns = {"mean": "", "worst frame": "_worst"}
    if any(name.endswith("_without_keys") for name in row):
        columns["without key frames"] = "_without_keys"
    table = Table("metric", *columns)
    for name, value in row.items():
        if name.endswith(("_worst", "_without_keys")) or not isinstance(value, (int, float, type(None))):
            continue
        if value is None or (name in ("frames_empty", "frames_missing") and not value):
            continue
        table.add_row(name, *(_number(row.get(name + ending)) for ending in columns.values()))
    return table


def counted(items: MeshSequence | range, progress: StageBars, stage: str = "compare") -> Iterator[Any]:
    """Yield frames or their numbers, and report progress after each is used."""
    for i, item in enumerate(items):
        yield item
        progress(stage, i + 1, len(items))


def _cameras(row: dict[str, Any]) -> list[str]:
    """Return a line for each view used for SSIM; the JSON has the complete cameras."""
    lines = []
    for number, camera in enumerate(row["cameras"]):
        extrinsic = np.reshape(camera["extrinsic"], (4, 4)).T
        eye = -extrinsic[:3, :3].T @ extrinsic[:3, 3]
        size = f"{camera['intrinsic']['width']} x {camera['intrinsic']['height']}"
        lines.append(f"SSIM view {number}: from ({eye[0]:.4g}, {eye[1]:.4g}, {eye[2]:.4g}), {size} pixels")
    return lines


def _number(value: int | float | None) -> str:
    return "" if value is None else f"{value:.6g}"


FRAMES, VIEWS, SIZE = 8, 4, 256  # frames that are compared, cameras around each, and pixels of the longer side
ASIDE = 0.11  # turns, from a camera to which the encoder fitted splats


def compare_splats(sequence: MeshSequence, video: Video, progress: StageBars) -> dict[str, Any]:
    """Return PSNR, dB, and SSIM of splats on pictures of a rig, or renders from other cameras. Raises InputError."""
    numbers, squares, scores = evenly(len(sequence), FRAMES), list[float](), list[float]()
    for done, number in enumerate(numbers, 1):
        if (bound := video.splats(number)) is not None:
            for square, score in (errors(bound, view) for view in held_out(sequence, video, number)):
                squares.append(square)
                scores.append(score)
        progress("splats", done, len(numbers))
    if not squares:
        raise InputError("--splats: no frame of the originals has colours and splats; compare with coloured originals")
    row = {"splats_psnr": psnr(PEAK**2 * float(np.mean(squares))), "splats_ssim": float(np.mean(scores))}
    return row | {"splats_views": len(squares)}


def held_out(sequence: MeshSequence, video: Video, number: int) -> tuple[SplatView, ...]:
    """Return pictures of a frame: a rig's, or renders from cameras that were not used to fit."""
    if (colors := captured(sequence).colors) is not None:
        pictures = [picture for picture in colors[number] if picture is not None]
        return taken(pictures, video.moving(number), sequence[number], SIZE)
    mesh, up = sequence[number], captured(sequence).up
    return rendered(mesh, ring(mesh, VIEWS, SIZE, GOLDEN * number + ASIDE, up)) if mesh.is_colored else ()


def errors(bound: Bound, view: SplatView) -> tuple[float, float]:
    """Return the mean squared error, of values 0 to 1, and SSIM of a picture of splats; unknown pixels are left out."""
    drawn = np.clip(draw(bound, view.camera), 0, 1)
    known = np.isfinite(view.pixels)
    target = np.where(known, view.pixels, drawn).astype(np.float64)
    inside = slice(BORDER, -BORDER)
    square = float(np.square(drawn - target)[known].mean()) if known.any() else 0.0
    return square, float(ssim_map(drawn.astype(np.float64), target)[inside, inside].mean())
