"""Measure how well a fitted template lies on a frame: symmetric distance, 95 % quantile, normal error (docs: metrics).

The encoder decides keys and cuts by it. Both directions count, since either alone misses surface that the other lacks.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from ...geometry.closest_points import Surface
from ...geometry.strict import angle
from ...geometry.topology import vertex_areas, vertex_normals
from ...types import Mesh
from .frame import ON_BORDER, FrameSurface, interpolated

BITS = 0.01  # share of a noisy frame's area that may be stray surface: a guess


@dataclass(frozen=True, slots=True)
class Residual:
    """Residual of one fitted frame, in units of the sequence's diagonal; infinite for an empty frame."""

    to_fit: float  # RMS over the frame's vertices to the fitted surface
    to_frame: float  # RMS over the template's vertices to the frame's surface
    quantile: float  # 95 % quantile of these distances, the larger of both directions
    normals: float  # degrees, mean angle to the normal at the closest point; mean of both directions
    by_area: float  # RMS over the area, the larger of both directions: few vertices may span much surface
    common: float  # RMS over the area where both have surface: without the frame's holes and its farthest `BITS`

    @property
    def rms(self) -> float:
        """Symmetric RMS distance: the larger of the two directions."""
        return max(self.to_fit, self.to_frame)


NOTHING = Residual(np.inf, np.inf, np.inf, np.inf, np.inf, np.inf)


def residual_of(fitted: Mesh, frame: FrameSurface) -> Residual:
    """Measure the residual of one fitted frame."""
    surface, normals = Surface(fitted), vertex_normals(fitted)
    ahead, back = surface.closest(frame.mesh.vertices), frame.surface.closest(fitted.vertices)
    to_fit = np.linalg.norm(ahead.points - frame.mesh.vertices, axis=1)
    to_frame = np.linalg.norm(back.points - fitted.vertices, axis=1)
    angles = (
        _mean_angle(frame.normals, interpolated(normals, fitted.faces, ahead))
        + _mean_angle(normals, frame.normals_at(back))
    ) / 2
    quantile = max(float(np.quantile(to_fit, 0.95)), float(np.quantile(to_frame, 0.95)))
    own, areas = vertex_areas(frame.mesh), vertex_areas(fitted)
    beside = frame.inside_at(back) > ON_BORDER
    by_area = max(_rms(to_fit, own), _rms(to_frame, areas))
    common = max(_rms(to_fit, _without_farthest(to_fit, own)), _rms(to_frame * beside, areas))
    return Residual(_rms(to_fit), _rms(to_frame), quantile, angles, by_area, common)


def _without_farthest(
    distances: Float64[np.ndarray, " N"], areas: Float64[np.ndarray, " N"]
) -> Float64[np.ndarray, " N"]:
    """Return the areas with zeros for the farthest `BITS` of their sum."""
    order = np.argsort(-distances, kind="stable")
    kept = areas.copy()
    kept[order[np.cumsum(areas[order]) <= BITS * areas.sum()]] = 0
    return kept


def _rms(distances: Float64[np.ndarray, " N"], weights: Float64[np.ndarray, " N"] | None = None) -> float:
    if weights is None or not weights.any():
        return float(np.sqrt(np.mean(distances**2)))
    return float(np.sqrt(np.average(distances**2, weights=weights)))


def _mean_angle(one: Float64[np.ndarray, "N 3"], other: Float64[np.ndarray, "N 3"]) -> float:
    cosine = np.clip(np.einsum("nd,nd->n", one, other), -1.0, 1.0)
    return float(np.degrees(np.mean(2 * angle(np.sqrt(1 - cosine), np.sqrt(1 + cosine)))))
