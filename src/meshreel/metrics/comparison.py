"""All metrics of a decoded sequence against its originals: a row per frame, aggregates, and the cameras.

Aggregates are the mean over frames (PSNR: mean of dB, an infinite value counts as `PSNR_CEILING`) and the worst frame;
frames without surface on both sides are left out.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError
from ..geometry.drawing import Viewer
from ..types import Mesh
from .color import COLORS, RENDERS, color_errors, render_errors
from .distance import PSNR_CEILING, Original, SurfaceErrors, surface_errors
from .mpeg import MEASURES, MpegOptions, mpeg_errors
from .render import Remembered, ssim_normals
from .surface_samples import used_surface
from .viewpoints import Box, ViewOptions, read_cameras, views_around

Row = dict[str, Any]
_PSNRS = ("d2_psnr_paper", "d1_psnr", "d2_psnr", "symmetric_psnr", *COLORS, *RENDERS[:2], *MEASURES)
_LARGER_IS_BETTER = (*_PSNRS, "covered", "ssim", "ssim_masked", *RENDERS[2:])


@dataclass(frozen=True, slots=True)
class ComparisonOptions:
    """Options of a comparison."""

    cameras: Path | Sequence[Viewer] | None = None  # Open3D pinhole JSON; None: four views around the originals
    views: ViewOptions = field(default_factory=ViewOptions)  # used where no cameras are given
    ssim: bool = True  # rendering and SSIM take about 2 s per frame at 1920 x 1080
    keys: Sequence[int] = ()  # key frames, without which aggregates are also computed
    mpeg: MpegOptions | None = None  # also by MPEG's measures: about 20 s per frame at mmetric's size of pictures

    def __post_init__(self) -> None:
        if any(key < 0 for key in self.keys):
            raise InputError(f"key frames {list(self.keys)}: frame numbers start at 0")


@dataclass(frozen=True, slots=True)
class Comparison:
    """Metrics of a sequence, in m, % of the diagonal, dB and degrees, as their names say."""

    frames: tuple[Row, ...]  # metrics of each frame; inf and nan are kept here
    empty: tuple[bool, ...]  # frames without surface on both sides
    cameras: tuple[Viewer, ...]
    keys: tuple[int, ...]

    def to_row(self) -> Row:
        """Return a JSON-ready record: means, `_worst`, `_without_keys`, every frame; None for what is not finite."""
        used = [i for i, empty in enumerate(self.empty) if not empty]
        row: Row = aggregate([self.frames[i] for i in used])
        if self.keys:
            between = aggregate([self.frames[i] for i in used if i not in self.keys])
            row |= {f"{name}_without_keys": value for name, value in between.items() if not name.endswith("_worst")}
        if used:
            row["least_covered_frame"] = min(used, key=lambda number: self.frames[number]["covered"])
        row |= {
            "frames_compared": len(self.frames),
            "frames_empty": sum(self.empty),
            "frames_missing": sum(math.isinf(frame["rms_forward_m"]) for frame in self.frames),
            "key_frames": list(self.keys),
            "per_frame": [finite(frame) for frame in self.frames],
            "cameras": [camera.record() for camera in self.cameras],
        }
        return finite(row)


class OriginalFrame:
    """An original mesh that keeps its samples and pictures, for comparisons with several decoded meshes."""

    def __init__(self, mesh: Mesh) -> None:
        self.mesh = mesh

    @cached_property
    def surface(self) -> Original:
        """The mesh, prepared for distances."""
        return Original(self.mesh)

    @cached_property
    def pictures(self) -> Remembered:
        """The mesh, prepared for pictures."""
        return Remembered(self.mesh)


def compare_sequences(
    originals: Iterable[Mesh | OriginalFrame], decoded: Iterable[Mesh], options: ComparisonOptions
) -> Comparison:
    """Measure `decoded` against `originals`, frame by frame (two sequences of equal length).

    Samples and pictures that an `OriginalFrame` has prepared are reused in later comparisons from the same cameras.
    """
    cameras = _cameras(originals, options) if options.ssim else ()
    box = Box.of(_prepared(original).mesh for original in originals) if options.mpeg is not None else Box.of(())
    rows: list[Row] = []
    empty: list[bool] = []
    others = iter(decoded)
    for original in map(_prepared, originals):
        mesh = next(others, None)
        if mesh is None:
            raise InputError(f"the decoded sequence ends after {len(rows)} frames and the original does not")
        rows.append(frame_row(original, mesh, cameras))
        if options.mpeg is not None:
            rows[-1] |= mpeg_errors(original.mesh, mesh, box, options.mpeg)
        # Vertices alone and faces without area are no surface.
        empty.append(bool(rows[-1]["diagonal_m"] == rows[-1]["rms_forward_m"] == 0))
    if next(others, None) is not None:
        raise InputError(f"the original sequence ends after {len(rows)} frames and the decoded one does not")
    if any(key >= len(rows) for key in options.keys):
        raise InputError(f"key frames {list(options.keys)}: the sequence has {len(rows)} frames")
    return Comparison(tuple(rows), tuple(empty), tuple(cameras), tuple(options.keys))


def frame_row(original: Mesh | OriginalFrame, decoded: Mesh, cameras: Sequence[Viewer]) -> Row:
    """Return the metrics of one frame by name; SSIM only with cameras."""
    prepared = _prepared(original)
    mesh, row = prepared.mesh, _distance_row(surface_errors(prepared.surface, decoded))
    if used_surface(decoded).is_empty:
        row["invented"] = 0.0
    if mesh.is_colored and decoded.is_colored:
        row |= color_errors(mesh, decoded) | (render_errors(mesh, decoded, cameras) if cameras else {})
    return row | (ssim_normals(prepared.pictures, decoded, cameras) if cameras else {})


def aggregate(frames: Sequence[Row]) -> Row:
    """Return mean and worst value of every metric over frames; an empty row for no frames."""
    row: Row = {}
    for name in frames[0] if frames else ():
        values = np.array([frame[name] for frame in frames], dtype=np.float64)
        if name in _PSNRS:
            values = np.minimum(values, PSNR_CEILING)
        row[name] = float(values.mean())
        row[f"{name}_worst"] = float(values.min() if name in _LARGER_IS_BETTER else values.max())
    row.pop("diagonal_m_worst", None)
    return row


def _distance_row(errors: SurfaceErrors) -> Row:
    row: Row = {"diagonal_m": errors.diagonal}
    row |= {name: getattr(errors, name) for name in ("d2_psnr_paper", "d1_psnr", "d2_psnr", "symmetric_psnr")}
    row |= {"covered": errors.forward.covered, "invented": max(1 - errors.backward.covered, 0.0)}
    row |= {"normal_error_deg": errors.angle, "normal_error_at_vertices_deg": errors.vertex_angle}
    for name, one_way in (("forward", errors.forward), ("backward", errors.backward)):
        row[f"rms_{name}_m"] = one_way.rms
        row[f"rms_{name}_percent"] = errors.percent(one_way.rms)
        row[f"hausdorff95_{name}_m"] = one_way.hausdorff95
        row[f"hausdorff95_{name}_percent"] = errors.percent(one_way.hausdorff95)
        row[f"normal_error_{name}_deg"] = one_way.angle
    return row


def _prepared(original: Mesh | OriginalFrame) -> OriginalFrame:
    return original if isinstance(original, OriginalFrame) else OriginalFrame(original)


def _cameras(originals: Iterable[Mesh | OriginalFrame], options: ComparisonOptions) -> Sequence[Viewer]:
    if options.cameras is not None:
        return read_cameras(options.cameras) if isinstance(options.cameras, Path) else options.cameras
    return views_around(Box.of(_prepared(original).mesh for original in originals), options.views)


def finite(row: Row) -> Row:
    """Return the row with None for numbers that JSON cannot hold."""
    return {name: None if isinstance(v, float) and not math.isfinite(v) else v for name, v in row.items()}
