"""`meshreel demo`: record, capture, encode, decode and measure a woman and a child in a procedural room."""

from __future__ import annotations

import warnings
from functools import partial
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from ..capture.recording import FusionOptions, open_recording
from ..capture.rig.rig import RIG, read_cameras
from ..capture.simulated.simulated_rig import TRUTH, read_truth
from ..capture.simulated.stage import VOXEL, WIDTH, StageOptions, record_stage, stage_cameras
from ..decoder.describe import describe_file
from ..decoder.video import open as open_video
from ..encoder.sequence import encode
from ..encoder.settings.options import QUALITY
from ..encoder.settings.settings import Settings
from ..errors import InputError
from ..geometry.threads import cores, threads
from ..io.write import check_free
from ..metrics.error_sheet import SheetOptions, write_sheet
from ..types import evenly
from .compare import OF_BOTH, against_truth, both_table
from .console import Common, Force, called_as
from .encode import describe, summary_row
from .info import rate_table
from .workers import workers

_JUDGED = 4  # largest number of frames compared with the truth: each takes seconds (guess)


def command(
    *,
    output: Annotated[Path, Parameter(name=["--output", "-o"])] = Path("demo"),
    frames: int = StageOptions().frames,
    quality: float = QUALITY,
    seed: int = 0,
    jobs: int | None = None,
    force: Force = False,
    common: Common = Common(),
) -> None:
    """Simulate depth cameras in a room where a woman walks in and waves and a child jumps, encode and measure that.

    Captured meshes, which are noisy, and decoded ones are compared with the truth, which a simulation knows.

    Parameters
    ----------
    output
        The directory for the rig's recording, demo.reel and the picture demo.png.
    frames
        Number of frames.
    quality
        0 (small) to 100 (fine).
    seed
        Seed of the sensor noise.
    jobs
        Number of cores to use, in place of all that this process may use; the file is the same.
    """
    if seed < 0:
        raise InputError(f"--seed must not be negative, got {seed}")
    options = Settings(quality=quality, close_planes=True).resolved()  # under who stays, no camera sees the floor
    room = StageOptions(frames=frames, seed=seed)
    file, picture = output / "demo.reel", output / "demo.png"
    check_free([file, picture], force or (output / "rig" / TRUTH).is_dir())  # of an earlier demo
    with common.stages() as progress, workers(jobs) as executor, threads(jobs or cores()):
        _forget(output / "rig", [camera.name for camera in stage_cameras(WIDTH)])
        record_stage(output / "rig", room, WIDTH, lambda k: progress("simulate", k, frames))
        capture, _ = open_recording(output / "rig", FusionOptions(VOXEL))
        encoded = partial(encode, options=options, executor=executor, jobs=jobs, resume=False)
        with warnings.catch_warnings(action="ignore"):  # they are told with the result
            summary = encoded(capture, file, progress=progress.encode)
        with open_video(file) as video:
            clean = read_truth(output / "rig" / TRUTH)
            truth = against_truth(capture, video, clean, evenly(frames, _JUDGED), progress)
            write_sheet(capture, video, picture, SheetOptions(height=360, unit="mm"))
    described = describe_file(file)
    sizes = {name: described[name] for name in ("bytes_by_content", "mbps_by_content")}
    row = summary_row(summary, capture.frame_rate) | sizes | {"truth": truth}
    common.warn(summary.warnings)
    common.result(
        {"output": str(output), "warnings": summary.warnings} | row,
        rate_table(row),
        both_table(OF_BOTH["truth"], truth),
        f"{file}: {describe(row)}",
        f"picture: {picture}",
        f"recording: {output / 'rig'}",
        f"play: {called_as()} play {file}",
        f"meshes: {called_as()} decode {file} -o {output / 'meshes'}",
    )


def _forget(folder: Path, names: list[str]) -> None:
    """Remove the frames of an earlier demo, also of one that was stopped. Raises InputError for other rigs."""
    is_whole, has_truth = (folder / RIG).exists(), (folder / TRUTH).is_dir()
    if is_whole and not (has_truth and [camera.name for camera in read_cameras(folder)[0]] == names):
        raise InputError(f"{folder}: has a rig that is not of a demo, and would be overwritten; give another --output")
    if not has_truth:
        return
    for pattern in ("corner*/depth/depth_*.png", "corner*/color/color_*.png", f"{TRUTH}/frame_*.ply", RIG):
        for path in folder.glob(pattern):
            path.unlink()
