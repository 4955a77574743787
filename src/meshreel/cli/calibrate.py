"""`meshreel calibrate`: the poses of a rig's cameras, from other programs, a board, and the cameras' depth."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from cyclopts import Parameter
from rich.table import Table

from ..capture.calibration.board import BoardOptions, poses_by_board
from ..capture.calibration.calibrate import Calibration, write_calibration_sheet
from ..capture.calibration.calibrate import refine as refined
from ..capture.calibration.paths import refine_paths
from ..capture.calibration.poses import described, posed_by, read_poses, with_poses
from ..capture.recording import open_recording
from ..capture.rig.rig import RIG, SINGLE
from ..errors import InputError
from ..export.shapes import check_output
from ..io.write import check_apart, check_free, write_file
from .console import Common, Force

BEFORE = "rig.before.json"  # copy of the file that --in-place replaced


def command(
    rig: Path,
    /,
    *,
    output: Annotated[Path | None, Parameter(name=["--output", "-o"])] = None,
    in_place: Annotated[bool, Parameter(negative="")] = False,
    poses: Path | None = None,
    poses_of: Literal["depth", "color"] = "depth",
    scale: float = 1.0,
    board: Annotated[BoardOptions, Parameter(name="*")] = BoardOptions(),
    refine: bool = True,
    force: Force = False,
    common: Common = Common(),
) -> None:
    """Find the poses of a rig's cameras: coarse from a file or a board, fine from the depth of still surface.

    Without --poses and --board it begins with the poses in rig.json, which must be right to some degrees and
    centimetres. It draws a picture beside its output.

    Parameters
    ----------
    rig
        A folder with rig.json and recorded depth, as `capture` takes it; a still room with furniture is best.
    output
        The .json file to write: rig.json with new poses. The picture beside it is a .png of that name.
    in_place
        Replace the rig's rig.json; the one before is kept as rig.before.json. Of cameras that move, the files of their
        poses are replaced, and kept alike.
    poses
        File to begin with: COLMAP's images.txt or images.bin, OpenCV's .yml, caliscope's .toml, ROS tf_static as .yaml
        or .json, or a rig.json. Cameras are found by their names.
    poses_of
        Which cameras the file has: the depth cameras, or the colour cameras beside them.
    scale
        Factor from the unit of that file to metres; COLMAP's unit is unknown.
    refine
        Refine the poses on depth.
    """
    path = _output(rig, output, in_place)
    picture = path.with_name("calibration.png") if in_place else path.with_suffix(".png")
    check_free([*([picture] if refine else []), *([rig / BEFORE] if in_place else [])], force)
    if not (math.isfinite(scale) and scale > 0):
        raise InputError(f"--scale {scale:g}: give a factor above 0")
    if poses is None and (scale, poses_of) != (1.0, "depth"):
        raise InputError("--scale and --poses-of are for the poses of a file; give --poses, too")
    if board.kind is None and board != BoardOptions():
        raise InputError("--columns, --rows, --square, --marker and --dictionary are of a board; give --board, too")
    if not refine and poses is None and board.kind is None:
        raise InputError("--no-refine leaves nothing to do without --poses or --board; give one, or leave it out")
    recording, warnings = open_recording(rig, keep=False)
    if paths := set(recording.rig.paths.values()):
        if not in_place or not refine or poses is not None or board.kind is not None:
            text = f"{rig}: has cameras that move, whose poses are in files as {min(paths)}"
            raise InputError(f"{text}; give --in-place alone, which refines these")
        remarks = refine_paths(rig)
        if still := [camera.name for camera in recording.rig.cameras if not camera.path]:
            warnings.append(f"{rig}: {', '.join(still)} stand still, and stay where they are: only paths are refined")
        common.warn(warnings)
        row = {"output": [str(path) for path in sorted(paths)], "cameras": remarks, "warnings": warnings}
        text = f"{rig}: nothing that its cameras see twice would lie nearer with other poses"
        common.result(row, *(remarks or [text]))
        return
    posed, calibration = recording.rig, None
    if poses is not None:
        unit = np.array([[1, 1, 1, scale]] * 3 + [[1, 1, 1, 1]])
        poses_in_m = {name: pose * unit for name, pose in read_poses(poses).items()}
        posed, remarks = posed_by(posed, poses_in_m, poses_of, poses)
        warnings += remarks
    if board.kind is not None:
        if not posed.color_cameras:
            raise InputError(f"{rig}: has no colour cameras, in whose pictures --board is found; give --poses instead")
        by_board, remarks = poses_by_board(posed.color_cameras, board)
        posed, warnings = with_poses(posed, {}, by_board), warnings + remarks
    if refine:
        with common.stages("rounds") as progress:
            calibration = refined(posed, progress)
        posed = with_poses(posed, {camera.name: camera.view.pose.to_world for camera in calibration.cameras}, {})
        warnings += calibration.warnings
        write_calibration_sheet(calibration, posed.up, picture)
    new = described(posed)
    if in_place:
        write_file(rig / BEFORE, (rig / RIG).read_bytes())
    write_file(path, new)
    common.warn(warnings)
    _tell(path, calibration, warnings, common)


def _output(rig: Path, output: Path | None, in_place: bool) -> Path:
    """Return the file to write. Raises InputError unless exactly one is named that may be written."""
    if (output is None) != in_place:
        raise InputError("give either --output FILE.json, or --in-place to replace the rig's own rig.json")
    if (rig / SINGLE).is_file() and not (rig / RIG).is_file():
        raise InputError(f"{rig}: has one camera, in {SINGLE}; poses are calibrated of cameras in a {RIG}")
    path = rig / RIG if output is None else output
    if path.suffix != ".json":
        raise InputError(f"{path}: the output must end in .json")
    if not in_place:
        check_apart(path, [rig / RIG])
        check_output(path)
    return path


def _tell(path: Path, calibration: Calibration | None, warnings: list[str], common: Common) -> None:
    """Print the distance of each pair of cameras, mm."""
    table, pairs = Table("cameras", "overlap", "before, mm", "after, mm"), []
    for pair in calibration.pairs if calibration else ():
        before, after = (None if math.isnan(d) else 1000 * d for d in (pair.before, pair.after))
        pairs.append({"cameras": pair.cameras, "overlap": pair.overlap, "before_mm": before, "after_mm": after})
        before_mm = "-" if before is None else f"{before:.1f}"
        table.add_row(" - ".join(pair.cameras), f"{100 * pair.overlap:.0f} %", before_mm, f"{1000 * pair.after:.1f}")
    row = {"output": str(path), "pairs": pairs, "warnings": warnings}
    common.result(row, *([table] if pairs else []), f"{path}: poses of {'refined' if calibration else 'given'} cameras")
