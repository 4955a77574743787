"""`meshreel capture`: make a rig of recordings, and fuse the depth of a rig into one mesh file per frame."""

from __future__ import annotations

import json
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Annotated, Any, Literal

from cyclopts import Parameter, Token

from ..capture.clouds import CloudOptions, Clouds, are_clouds, open_clouds
from ..capture.recording import FusionOptions, Recording, open_recording
from ..capture.recordings import is_rig, is_take, open_take
from ..capture.recordings.takes import Take
from ..capture.rig.cameras import ColorCamera, DepthCamera
from ..capture.rig.rig import RIG, Rig, read_rig
from ..errors import InputError
from ..io.file_names import Order
from ..io.files import first_difference, read_json
from ..io.sequence import CAPTURED
from ..io.write import frame_names, make_folder, write_file, write_mesh
from .console import Common
from .sources import make_rig

_FUSION = FusionOptions()
BARE = 0.02  # share of a frame's points without surface that is told (guess)
LARGEST = 100.0  # m, of a recording; what is larger is in another unit (guess)


def _as_unit(_kind: object, tokens: Sequence[Token]) -> float:
    """Return a unit in metres that is written as a number, or as mm, cm or m. Raises ValueError for other words."""
    word = tokens[0].value
    try:
        unit = {"mm": 0.001, "cm": 0.01, "m": 1.0}.get(word) or float(word)
    except ValueError:
        raise ValueError(f"{word} is no unit; give mm, cm, m, or metres as 0.0002") from None
    if not 1e-6 <= unit <= 10:
        raise ValueError(f"{word} is no unit in metres; 5000 steps a metre are 0.0002")
    return unit


def command(
    inputs: list[Path],
    /,
    *,
    output: Annotated[Path | None, Parameter(name=["--output", "-o"])] = None,
    voxel: float | None = None,
    truncation: float | None = _FUSION.truncation,
    fragment: float = _FUSION.fragment,
    frames: str = ":",
    format: Literal["ply", "obj", "glb"] = "ply",
    order: Order = "auto",
    depth_unit: Annotated[float | None, Parameter(name=["--depth-unit", "--unit"], converter=_as_unit)] = None,
    seen_from: Annotated[tuple[float, float, float] | None, Parameter(allow_leading_hyphen=True)] = None,
    show: Annotated[bool, Parameter(name="--list", negative="")] = False,
    common: Common = Common(),
) -> None:
    """Fuse the depth pictures of a rig of cameras, or the points of each frame, into one mesh per frame.

    Or make a rig of recordings. Run again after an interruption, it makes the missing frames.

    Parameters
    ----------
    inputs
        A folder with rig.json: {"frames_per_second": 30, "cameras": [{"name": "left", "width": 640, "height": 576,
        "fx": 504, "fy": 504, "cx": 320, "cy": 288, "camera_to_world": 4 x 4 rows in metres, "depth_unit_m": 0.001,
        "depth_min_m": 0.1, "depth_max_m": 5, "depth": "left/depth"}]}, each `depth` a folder of 16-bit PNG whose names
        have the frame's number. Cameras look along +z, x right, y down. One that moves has, in place of
        camera_to_world, `poses`: a file with {"camera_to_world": {"0": 4 x 4 rows, ...}}, by the frame's number. Or a
        folder with camera.json (one such
        camera, with frames_per_second), depth/ and, for colours, color/. A camera's `color` is a folder of pictures
        aligned with its depth, or an object with a folder and what differs; `color_cameras` lists others. Or recordings
        of other programs, together one rig: TUM RGB-D, 7-scenes, nerfstudio, Stray Scanner and Record3D folders, .r3d,
        .bag, .mcap, .mkv.
        Or point clouds, one a frame: a folder, pattern or list of .ply, .pcd, .npz (points, normals, colors), .las,
        .laz.
    output
        The directory for frame_00000.ply and so on, created if needed; of recordings, the new folder of the rig.
    voxel
        Side of a voxel, m; by default 0.02 for depth, and for points what their distances and noise allow.
    truncation
        Number of voxels before and behind a measurement that it changes; 4 with one camera, 3 with several.
    fragment
        Smallest area of a connected piece, m^2; smaller ones are dropped.
    frames
        Frames to fuse, as A:B with B excluded.
    format
        Format of the mesh files.
    order
        Order of a rig's pictures with several numbers in their names: by all of them, by the last one, or by letters.
        By default the one that all readings of the names agree on.
    depth_unit
        Unit of depth in pictures of recordings, in place of what they say, or of the coordinates of points: in metres,
        as 0.0002, or mm, cm, m.
    seen_from
        Place of the sensor in metres, as 0 1.5 2, if one took all points: faces point to it.
    show
        Show the streams of recordings or rigs, their sizes, rates and calibration, and write nothing.
    """
    if show:  # reads no picture
        facts = [_rig_facts(read_rig(path, order)) if is_rig(path) else _take_facts(open_take(path)) for path in inputs]
        return common.result({"recordings": [row for row, _ in facts]}, *(line for _, of in facts for line in of))
    if output is None:
        raise InputError("--output is missing: a folder for meshes, or for the rig of recordings; or give --list")
    if are_clouds(inputs) and not (len(inputs) == 1 and (is_rig(inputs[0]) or is_take(inputs[0]))):
        if truncation is not None:
            raise InputError("--truncation: is of depth pictures; the surface of points has none, leave it out")
        chosen = CloudOptions(voxel, fragment, 1.0 if depth_unit is None else depth_unit, seen_from)
        clouds, warnings = open_clouds(inputs, chosen, frames, order)
        common.warn(warnings)
        return _fuse(clouds, clouds.source, output, format, common)
    if seen_from is not None:
        raise InputError(
            "--seen-from: is of points; cameras of a rig and of recordings know their places, leave it out"
        )
    options = replace(_FUSION if voxel is None else FusionOptions(voxel), truncation=truncation, fragment=fragment)
    if len(inputs) > 1 or (inputs[0].exists() and not is_rig(inputs[0])):
        if (options, frames, format, order) != (_FUSION, ":", "ply", "auto"):
            raise InputError(f"{inputs[0]}: is no rig: make one of it without options of fusion, then capture that")
        warnings = make_rig([open_take(path) for path in inputs], output, common, depth_unit)
        rig = read_rig(output)
        blind = [text for number in range(len(rig.cameras)) for text in rig.blind(number, rig.looked_at(number))]
        common.warn([*warnings, *rig.missing(), *blind])
        row = {"output": str(output), "cameras": len(rig.cameras), "color_cameras": len(rig.color_cameras)}
        row |= {"frames": len(rig.frames), "frame_rate": rig.frame_rate}
        counted = f"{row['frames']} frames, depth cameras: {row['cameras']}, colour cameras: {row['color_cameras']}"
        return common.result(row, f"{output}: a rig, {counted}, {rig.frame_rate:g} frames a second")
    if depth_unit is not None:
        raise InputError(f"--depth-unit: {inputs[0]} is a rig, whose {RIG} says it as depth_unit_m; mend that")
    recording, warnings = open_recording(inputs[0], options, frames, keep=False, order=order)
    common.warn(warnings)
    return _fuse(recording, _made(recording), output, format, common)


def _bare_points(clouds: Clouds) -> list[str]:
    """Return a warning about the frame of those read whose points got the least surface, where that is too little."""
    worst = max(clouds.bare, key=lambda number: clouds.bare[number], default=None)
    if worst is None or clouds.bare[worst] <= BARE:
        return []
    text = f"{clouds.files[worst]}: {100 * clouds.bare[worst]:.0f} % of its points got no surface"
    return [f"{text}; a --voxel above {clouds.options.voxel:g} covers more"]


def _take_facts(take: Take) -> tuple[dict[str, Any], list[str]]:
    """Return a row for JSON and lines for the terminal."""
    cameras, lines = list[dict[str, Any]](), [f"{take.path}: {take.kind}"]
    for sensor in take.sensors:
        camera: dict[str, Any] = {"name": sensor.name, "depth": None, "color": None}
        for kind, stream in (("depth", sensor.depth), ("color", sensor.color)):
            if stream is not None:
                size = {"width": stream.width, "height": stream.height, "pictures": stream.count}
                rate = {"seconds": stream.seconds, "pictures_per_second": stream.rate}
                camera[kind] = size | rate | {"calibrated": stream.lens is not None}
                calibration = "calibrated" if stream.lens is not None else f"NOT calibrated: {take.calibrate}"
                times = f"{stream.count} pictures in {stream.seconds:.2f} s ({stream.rate:.4g} a second)"
                lines.append(f"  {sensor.name}: {kind} {stream.width} x {stream.height}, {times}, {calibration}")
        cameras.append(camera | {"poses": 0 if sensor.poses is None else len(sensor.poses.matrices)})
    lines += [f"  not read: {', '.join(take.others)}"] if take.others else []
    return {"path": str(take.path), "kind": take.kind, "cameras": cameras, "others": list(take.others)}, lines


def _rig_facts(rig: Rig) -> tuple[dict[str, Any], list[str]]:
    """Return a row for JSON and lines for the terminal."""
    streams: list[tuple[str, DepthCamera | ColorCamera, Mapping[int, Path]]] = []
    streams += [("depth", camera, files) for camera, files in zip(rig.cameras, rig.files, strict=True)]
    streams += [("color", camera, camera.files) for camera in rig.color_cameras]
    cameras, lines = [], [f"{rig.folder}: a rig, {len(rig.frames)} frames, {rig.frame_rate:g} a second"]
    for kind, one, files in streams:
        width, height, count = one.view.width, one.view.height, len(files)
        cameras.append({"name": one.name, "kind": kind, "width": width, "height": height, "pictures": count})
        lines.append(f"  {one.name}: {kind} {width} x {height}, {count} pictures, calibrated")
    about = {"path": str(rig.folder), "kind": "a rig", "frames": len(rig.frames), "frame_rate": rig.frame_rate}
    return about | {"cameras": cameras}, lines


def _fuse(frames: Recording | Clouds, made: dict[str, Any], output: Path, format: str, common: Common) -> None:
    """Write the frames that a folder lacks; `made` is what they depend on."""
    names = frame_names(len(frames), format)
    missing = _started(output, made | {"frames_per_second": frames.frame_rate, "up": frames.up}, names)
    bare, huge = list[str](), list[str]()
    with common.stages() as progress:
        done = len(names) - len(missing)
        progress("fuse", done, len(names))
        for index, name in enumerate(names):
            if name in missing:
                mesh = frames[index]
                write_mesh(mesh, output / name)
                bare += [name] if mesh.is_empty else []
                huge += [f"{name}: {mesh.diagonal:.3g} m"] if mesh.diagonal > LARGEST else []
                done += 1
                progress("fuse", done, len(names))
    if bare:
        text = f"{output}: {len(bare)} of {len(missing)} fused frames have no surface, as {bare[0]}"
        common.warn([f"{text}; is the unit right, and are voxels no smaller than the distances of pixels or points?"])
    if huge:
        common.warn([f"{output}/{huge[0]} from corner to corner: meshreel counts in metres; give --unit mm or cm"])
    row: dict[str, Any] = {"output": str(output), "frames": len(names), "fused": len(missing)}
    row |= {"frame_rate": frames.frame_rate, "voxel": frames.options.voxel}
    if isinstance(frames, Clouds):
        common.warn(_bare_points(frames))
    earlier = "" if len(missing) == len(names) else f", {len(names) - len(missing)} of them from before"
    text = f"{output}: {len(names)} {format} files{earlier}, {frames.frame_rate:g} frames a second"
    text += f", voxels of {frames.options.voxel:g} m"
    common.result(row | {"format": format}, text)


def _made(recording: Recording) -> dict[str, Any]:
    """Return everything that the frames depend on; the files of pictures are told apart by their sizes."""
    sizes = [[_size(files[n]) if n in files else -1 for n in recording.numbers] for files in recording.rig.files]
    cameras = [camera.path for camera in recording.rig.cameras] + [eye.path for eye in recording.rig.color_cameras]
    paths = [[pose.to_world.tolist() for pose in path.values()] for path in cameras if path]
    moving = {"paths": [zlib.crc32(json.dumps(each).encode()) for each in paths]} if paths else {}
    return moving | {
        "rig": str(recording.rig.folder.resolve()),
        "frames": recording.numbers,
        "fusion": asdict(recording.options),
        "cameras": [camera.record() for camera in recording.rig.cameras],
        "pictures": [zlib.crc32(json.dumps(each).encode()) for each in sizes],
    }


def _size(path: Path) -> int:
    """Return the size of a file; a file that cannot be read is an error later, when it is read."""
    try:
        return path.stat().st_size
    except OSError:
        return 0


def _started(output: Path, made: dict[str, Any], names: list[str]) -> set[str]:
    """Record the run in the folder; return the missing files. Raises InputError for a folder of another run."""
    path = output / CAPTURED
    make_folder(output)
    existing, has_frames = {name for name in names if (output / name).exists()}, any(output.glob("frame_*"))
    if path.exists() and has_frames:
        before = read_json(path, "delete the folder, or choose another")
        if before != (now := json.loads(json.dumps(made))):
            text = f"{output}: holds frames of other inputs or options"
            raise InputError(f"{text} ({first_difference(before, now)}); choose another folder")
    elif has_frames:
        raise InputError(f"{output}: holds frames without a {CAPTURED}; choose another folder")
    else:
        write_file(path, (json.dumps(made, indent=1) + "\n").encode())
    return set(names) - existing
