"""`meshreel demo`: a procedural capture is made, encoded, decoded and measured; what it leaves can be looked at."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from ..capture.procedural import SoftBodiesOptions, soft_bodies
from ..decoder import open as open_video
from ..encoder import encode
from ..errors import InputError
from ..metrics.report import ComparisonOptions, compare_sequences
from ..metrics.sheet import SheetOptions, write_sheet
from ..presets import preset_options
from ..types import MeshList
from .compare import counted, metric_table, recorded_keys
from .console import Common, called_as
from .encode import describe, summary_row, workers

_QUALITY = preset_options().quality
_BEGIN, _FRAME_RATE = 0.95, 20.0  # s into the story, 1/s: in 20 frames apart, in touch and apart again


def command(
    *,
    output: Annotated[Path, Parameter(name=["--output", "-o"])] = Path("demo"),
    frames: int = 20,
    quality: float = _QUALITY,
    ssim: bool = True,
    jobs: int = 1,
    common: Common = Common(),
) -> None:
    """Make a short capture of people who walk, touch and part, encode it, and measure what comes back.

    Parameters
    ----------
    output
        The directory for demo.reel and the picture demo.png.
    frames
        How many frames to make.
    quality
        0 (small) to 100 (fine).
    ssim
        Render and compare pictures too (some seconds a frame).
    jobs
        Runs of frames that need no other to encode side by side.
    """
    if jobs < 1:
        raise InputError(f"--jobs must be at least 1, got {jobs}")
    options = preset_options(quality=quality)  # refused before frames are made
    bodies = soft_bodies(SoftBodiesOptions(frames=frames, frame_rate=_FRAME_RATE, begin=_BEGIN))
    capture = MeshList(tuple(bodies), bodies.frame_rate)  # few enough to keep, and slow to make
    output.mkdir(parents=True, exist_ok=True)
    file, picture = output / "demo.reel", output / "demo.png"
    with common.stages(frames) as progress, workers(jobs) as executor:
        summary = encode(capture, file, options, executor, progress)
        video = open_video(file)
        asked = ComparisonOptions(ssim=ssim, keys=recorded_keys(video))
        measured = compare_sequences(capture, counted(video, progress), asked).to_row()
    shown = sorted({k * (frames - 1) // 4 for k in range(5)})
    write_sheet(capture, video, picture, SheetOptions(frames=tuple(shown)))
    row = summary_row(summary, capture.frame_rate) | measured
    common.result(
        {"output": str(output)} | row,
        metric_table(measured),
        f"{file}: {describe(row)}",
        f"picture: {picture}",
        f"meshes: {called_as()} decode {file} -o {output / 'meshes'}",
    )
