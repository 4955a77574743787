"""`meshreel encode`: a mesh sequence becomes one .reel file."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from concurrent.futures import Executor, ProcessPoolExecutor
from pathlib import Path
from typing import Annotated, Any, Literal

from cyclopts import Parameter

from ..encoder import Summary, encode
from ..errors import InputError
from ..io.sequence import SequenceOptions, open_sequence
from ..presets import preset_options
from .console import Common


def command(
    inputs: list[str],
    *,
    output: Annotated[Path, Parameter(name=["--output", "-o"])],
    preset: Literal["paper"] = "paper",
    quality: float = 50.0,
    fps: float = 30.0,
    frames: str = ":",
    scale: float = 1.0,
    basis_size: int | None = None,
    centers: int = 2000,
    group_size: int = 10,
    jobs: int = 1,
    common: Common = Common(),
) -> None:
    """Encode a sequence of meshes into one .reel file.

    Parameters
    ----------
    inputs
        A directory, a glob, mesh files (OBJ, PLY, GLB, STL, OFF) or an .npz of vertices (T x V x 3) and faces (F x 3).
    output
        The .reel file to write; it appears only when it is complete.
    preset
        How to code: `paper` is section 3 of the TSMC paper.
    quality
        0 (small) to 100 (fine).
    fps
        Frames per second of the input.
    frames
        Which frames, as A:B with B excluded.
    scale
        Factor on all coordinates, to metres.
    basis_size
        Exactly this many KLT components per group; by rate-distortion where it is not given.
    centers
        Volume centers to track, the paper's K.
    group_size
        Most frames in a group, the paper's GoF.
    jobs
        Groups to encode side by side; the file is the same.
    """
    if output.suffix != ".reel":
        raise InputError(f"{output}: the output must end in .reel")
    options = preset_options(
        preset=preset, quality=quality, basis_size=basis_size, group_size=group_size, centers=centers
    )
    source: Any = inputs[0] if len(inputs) == 1 else inputs
    sequence = open_sequence(source, SequenceOptions(frame_rate=fps, frames=frames, scale=scale))
    with common.stages(len(sequence)) as progress, _executor(jobs) as executor:
        summary = encode(sequence, output, options, executor, progress)
    for warning in sequence.warnings:
        common.warn(warning)
    row = summary_row(summary, sequence.frame_rate)
    common.result({"output": str(output)} | row, f"{output}: {describe(row)}")


def summary_row(summary: Summary, frame_rate: float) -> dict[str, Any]:
    """Rate, quality and forms of an encode, ready for JSON."""
    seconds = summary.frame_count / frame_rate
    return {
        "bytes": summary.size,
        "frames": summary.frame_count,
        "mbps": summary.size * 8 / seconds / 1e6,
        "groups": [
            {"form": g.form.name.lower(), "frames": g.frame_count, "bytes": g.size, "rms_m": g.quality.distance,
             "worst_rms_m": g.quality.worst, "normal_error_deg": g.quality.angle}
            for g in summary.groups
        ],
    }


def describe(row: dict[str, Any]) -> str:
    """One line: frames, bytes, rate and forms."""
    forms = [group["form"] for group in row["groups"]]
    counted = ", ".join(f"{forms.count(form)} {form}" for form in sorted(set(forms)))
    return f"{row['frames']} frames, {row['bytes']} bytes, {row['mbps']:.3f} Mbps, groups: {counted}"


@contextlib.contextmanager
def _executor(jobs: int) -> Iterator[Executor | None]:
    if jobs < 1:
        raise InputError(f"--jobs must be at least 1, got {jobs}")
    if jobs == 1:
        yield None
        return
    with ProcessPoolExecutor(jobs) as executor:
        yield executor
