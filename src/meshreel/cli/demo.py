"""`meshreel demo`: a procedural capture is made, encoded, decoded and measured; what it leaves can be looked at."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from ..capture.procedural import BodiesOptions, soft_bodies
from ..decoder import open as open_video
from ..encoder import encode
from ..errors import InputError
from ..metrics.report import ComparisonOptions, compare_sequences
from ..metrics.sheet import write_sheet
from ..presets import preset_options
from .compare import metric_table
from .console import Common
from .encode import describe, summary_row


def command(
    *,
    output: Annotated[Path, Parameter(name=["--output", "-o"])] = Path("demo"),
    frames: int = 20,
    quality: float = 50.0,
    common: Common = Common(),
) -> None:
    """Make a short capture of soft bodies that walk, touch and part, encode it, and measure what comes back.

    Parameters
    ----------
    output
        The directory for demo.reel and the picture demo.png.
    frames
        How many frames to make.
    quality
        0 (small) to 100 (fine).
    """
    if frames < 1:
        raise InputError(f"--frames must be at least 1, got {frames}")
    output.mkdir(parents=True, exist_ok=True)
    capture = soft_bodies(BodiesOptions(frames=frames))
    file = output / "demo.reel"
    with common.stages(frames) as progress:
        summary = encode(capture, file, preset_options(quality=quality), progress=progress)
    video = open_video(file)
    measured = compare_sequences(capture, video, ComparisonOptions()).to_row()
    write_sheet(capture, video, output / "demo.png")
    row = summary_row(summary, capture.frame_rate) | measured
    common.result(
        {"output": str(output)} | row,
        metric_table(measured),
        f"{file}: {describe(row)}",
        f"Picture: {output / 'demo.png'}. Meshes: meshreel decode {file} -o {output / 'meshes'}",
    )
