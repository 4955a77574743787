"""`meshreel compare`: every metric between original meshes and decoded ones."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter
from rich.table import Table

from ..decoder import open as open_video
from ..errors import InputError
from ..io.sequence import SequenceOptions, open_sequence
from ..metrics.report import ComparisonOptions, compare_sequences
from ..metrics.sheet import write_sheet
from ..types import MeshSequence
from .console import Common


def command(
    originals: Path,
    decoded: Path,
    *,
    fps: float = 30.0,
    frames: str = ":",
    scale: float = 1.0,
    cameras: Path | None = None,
    ssim: bool = True,
    sheet: Path | None = None,
    common: Common = Common(),
) -> None:
    """Compare original meshes with decoded ones: distances, normals, SSIM, and the rate of a .reel file.

    Parameters
    ----------
    originals
        The original sequence: a directory, a glob or an .npz.
    decoded
        A .reel file, or the decoded meshes.
    fps
        Frames per second of meshes.
    frames
        Which frames of the originals, as A:B with B excluded.
    scale
        Factor on the originals' coordinates, as given to `encode`.
    cameras
        A file of Open3D pinhole cameras for SSIM; four views around the sequence where it is not given.
    ssim
        Render and compare pictures too (slower).
    sheet
        Write a PNG: original, decoded, error heat map.
    """
    sequence = open_sequence(originals, SequenceOptions(frame_rate=fps, frames=frames, scale=scale))
    other: MeshSequence = (
        open_video(decoded) if decoded.suffix == ".reel" else open_sequence(decoded, SequenceOptions(frame_rate=fps))
    )
    if len(sequence) != len(other):
        raise InputError(f"{originals} has {len(sequence)} frames and {decoded} {len(other)}; choose with --frames A:B")
    comparison = compare_sequences(sequence, other, ComparisonOptions(cameras=cameras, ssim=ssim))
    row = comparison.to_row()
    if decoded.suffix == ".reel":
        size = decoded.stat().st_size
        row |= {"bytes": size, "mbps": size * 8 * sequence.frame_rate / len(sequence) / 1e6}
    if sheet is not None:
        write_sheet(sequence, other, sheet)
    common.result(row, metric_table(row))


def metric_table(row: dict[str, object]) -> Table:
    """The numbers of a row, one a line."""
    table = Table("metric", "value")
    for key, value in row.items():
        if isinstance(value, float):
            table.add_row(key, f"{value:.6g}")
        elif isinstance(value, (int, str)):
            table.add_row(key, str(value))
    return table
