"""`meshreel capture`: fuse recordings of depth cameras into one mesh file per frame."""

from __future__ import annotations

import json
import zlib
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any, Literal

from cyclopts import Parameter

from ..capture.fusion import FusionOptions
from ..capture.recording import Recording, open_recording
from ..errors import InputError
from ..io.differences import first_difference
from ..io.sequence import CAPTURED
from ..io.write import frame_names, make_folder, replacing, write_mesh
from .console import Common

_FUSION = FusionOptions()


def command(
    rig: Path,
    /,
    *,
    output: Annotated[Path, Parameter(name=["--output", "-o"])],
    voxel: float = _FUSION.voxel,
    truncation: float | None = _FUSION.truncation,
    fragment: float = _FUSION.fragment,
    frames: str = ":",
    format: Literal["ply", "obj", "glb"] = "ply",
    common: Common = Common(),
) -> None:
    """Fuse the depth pictures of a rig of still cameras into one mesh per frame.

    Run again after an interruption, it makes the missing frames.

    Parameters
    ----------
    rig
        A folder with rig.json: {"frames_per_second": 30, "cameras": [{"name": "left", "width": 640, "height": 576,
        "fx": 504, "fy": 504, "cx": 320, "cy": 288, "camera_to_world": 4 x 4 rows in metres, "depth_unit_m": 0.001,
        "depth_min_m": 0.1, "depth_max_m": 5, "depth": "left/depth"}]}, each `depth` a folder of 16-bit PNG whose names
        end in the frame's number. Cameras look along +z, x right, y down. Or a folder with camera.json (one such
        camera, with frames_per_second), depth/ and, for colours, color/. A camera's `color` is a folder of pictures
        aligned with its depth, or an object with a folder and what differs; `color_cameras` lists others.
    output
        The directory for frame_00000.ply and so on; created if needed.
    voxel
        Side of a voxel, m.
    truncation
        Number of voxels before and behind a measurement that it changes; 4 with one camera, 3 with several.
    fragment
        Smallest area of a connected piece, m^2; smaller ones are dropped.
    frames
        Frames to fuse, as A:B with B excluded.
    format
        Format of the mesh files.
    """
    options = FusionOptions(voxel, truncation, fragment)
    recording, warnings = open_recording(rig, options, frames, keep=False)
    common.warn(warnings)
    names = frame_names(len(recording), format)
    missing = _started(output, _made(rig, recording), names)
    bare = []
    with common.stages(len(recording)) as progress:
        for index, name in enumerate(names):
            if name in missing:
                mesh = recording[index]
                write_mesh(mesh, output / name)
                bare += [name] if mesh.is_empty else []
            progress("fuse", index + 1, len(recording))
    if bare:
        common.warn([f"{output}: {len(bare)} of {len(missing)} fused frames have no surface, as {bare[0]}"])
    row = {"output": str(output), "frames": len(names), "fused": len(missing), "frame_rate": recording.frame_rate}
    kept = "" if len(missing) == len(names) else f", {len(names) - len(missing)} of them from before"
    text = f"{output}: {len(names)} {format} files{kept}, {recording.frame_rate:g} frames a second"
    common.result(row | {"format": format}, text)


def _made(rig: Path, recording: Recording) -> dict[str, Any]:
    """Return all that the frames depend on; pictures count by their sizes, which differ between recordings."""
    cameras = [camera.record() for camera in recording.rig.cameras]
    sizes = [[_size(files[n]) if n in files else -1 for n in recording.numbers] for files in recording.rig.files]
    return {
        "rig": str(rig.resolve()),
        "frames_per_second": recording.frame_rate,
        "up": recording.rig.up,
        "frames": recording.numbers,
        "fusion": asdict(recording.options),
        "cameras": cameras,
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
    there = {name for name in names if (output / name).exists()}
    if path.exists():
        try:
            before = json.loads(path.read_text())
        except (OSError, ValueError) as error:
            raise InputError(f"{path}: cannot be read ({error}); delete the folder, or choose another") from None
        if before != (now := json.loads(json.dumps(made))):
            text = f"{output}: holds frames of another rig or of other options"
            raise InputError(f"{text} ({first_difference(before, now)}); choose another folder")
    elif any(output.glob("frame_*")):
        raise InputError(f"{output}: holds frames without a {CAPTURED}; choose another folder")
    else:
        with replacing(path) as file:
            file.write((json.dumps(made, indent=1) + "\n").encode())
    return set(names) - there
