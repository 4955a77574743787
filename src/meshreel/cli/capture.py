"""`meshreel capture`: recordings of depth cameras become one mesh file per frame."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any, Literal

from cyclopts import Parameter

from ..capture.fusion import FusionOptions
from ..capture.record import Recording, open_recording
from ..errors import InputError
from ..io.write import frame_names, make_folder, replacing, write_mesh
from .console import Common

MADE = "capture.json"  # in the output: from what and how it was made
_FUSION = FusionOptions()


def command(
    rig: Path,
    /,
    *,
    output: Annotated[Path, Parameter(name=["--output", "-o"])],
    voxel: float = _FUSION.voxel,
    truncation: float = _FUSION.truncation,
    fragment: float = _FUSION.fragment,
    frames: str = ":",
    format: Literal["ply", "obj", "glb"] = "ply",
    common: Common = Common(),
) -> None:
    """Fuse the depth pictures of a rig of still cameras into a mesh per frame.

    Run again after an interruption, it goes on with the frames that are missing.

    Parameters
    ----------
    rig
        A folder with rig.json: {"frames_per_second": 30, "cameras": [{"name": "left", "width": 640, "height": 576,
        "fx": 504, "fy": 504, "cx": 320, "cy": 288, "camera_to_world": 4 x 4 rows in metres, "depth_unit_m": 0.001,
        "depth_min_m": 0.1, "depth_max_m": 5, "depth": "left/depth"}]}, each `depth` a folder of 16-bit PNG whose names
        end in the frame's number. Cameras look along +z, x right, y down. Or a folder with camera.json (one such
        camera, with frames_per_second) and depth/.
    output
        The directory to write frame_00000.ply and so on into; made if needed.
    voxel
        Side of a voxel, m.
    truncation
        Voxels before and behind a measurement that it says something about.
    fragment
        Connected pieces of less area are dropped, m^2.
    frames
        Which frames, as A:B with B excluded.
    format
        Of the mesh files.
    """
    options = FusionOptions(voxel, truncation, fragment)
    recording, warnings = open_recording(rig, options, frames)
    common.warn(warnings)
    names = frame_names(len(recording), format)
    missing = _started(output, _made(rig, recording), names)
    with common.stages(len(recording)) as progress:
        for index, name in enumerate(names):
            if name in missing:
                write_mesh(recording[index], output / name)
            progress("fuse", index + 1, len(recording))
    row = {"output": str(output), "frames": len(names), "fused": len(missing), "frame_rate": recording.frame_rate}
    kept = "" if len(missing) == len(names) else f", {len(names) - len(missing)} of them from before"
    told = f"{output}: {len(names)} {format} files{kept}, {recording.frame_rate:g} frames a second"
    common.result(row | {"format": format}, told)


def _made(rig: Path, recording: Recording) -> dict[str, Any]:
    """What decides the frames, apart from the pictures."""
    cameras = [camera.record() for camera in recording.rig.cameras]
    return {
        "rig": str(rig.resolve()),
        "frames_per_second": recording.frame_rate,
        "frames": recording.numbers,
        "fusion": asdict(recording.options),
        "cameras": cameras,
    }


def _started(output: Path, made: dict[str, Any], names: list[str]) -> set[str]:
    """The files that are still to be made; the folder says from what. Raises InputError where it is of another run."""
    path = output / MADE
    make_folder(output)
    there = {name for name in names if (output / name).exists()}
    if path.exists():
        try:
            before = json.loads(path.read_text())
        except (OSError, ValueError) as error:
            raise InputError(f"{path}: cannot be read ({error}); delete the folder, or choose another") from None
        if before != json.loads(json.dumps(made)):
            raise InputError(f"{output}: holds frames of another rig or of other options; choose another folder")
    elif any(output.glob("frame_*")):
        raise InputError(f"{output}: holds frames that no {MADE} tells the making of; choose another folder")
    else:
        with replacing(path) as file:
            file.write((json.dumps(made, indent=1) + "\n").encode())
    return set(names) - there
