"""Measure how well a fitted template lies on a frame: symmetric distance, 95 % quantile, normal error (docs: metrics).

The encoder decides keys and cuts by it. Both directions count, since either alone misses surface that the other lacks.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from ...geometry.closest_points import Surface
from ...geometry.strict import angle
from ...geometry.topology import vertex_normals
from ...types import Mesh
from .frame import FrameSurface, interpolated


@dataclass(frozen=True, slots=True)
class Residual:
    """Residual of one fitted frame, in units of the sequence's diagonal; infinite for an empty frame."""

    to_fit: float  # RMS over the frame's vertices to the fitted surface
    to_frame: float  # RMS over the template's vertices to the frame's surface
    quantile: float  # 95 % quantile of these distances, the larger of both directions
    normals: float  # degrees, mean angle to the normal at the closest point; mean of both directions

    @property
    def rms(self) -> float:
        """Symmetric RMS distance: the larger of the two directions."""
        return max(self.to_fit, self.to_frame)


NOTHING = Residual(np.inf, np.inf, np.inf, np.inf)


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
    return Residual(_rms(to_fit), _rms(to_frame), quantile, angles)


def _rms(distances: Float64[np.ndarray, " N"]) -> float:
    return float(np.sqrt(np.mean(distances**2)))


def _mean_angle(one: Float64[np.ndarray, "N 3"], other: Float64[np.ndarray, "N 3"]) -> float:
    cosine = np.clip(np.einsum("nd,nd->n", one, other), -1.0, 1.0)
    return float(np.degrees(np.mean(2 * angle(np.sqrt(1 - cosine), np.sqrt(1 + cosine)))))
