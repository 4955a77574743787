"""Match samples of a moved key mesh and a frame's surface, both ways, as point-to-plane rows.

In: samples with normals, a prepared frame. Out: Planes. A pair is weighted by a Gaussian of its distance; its weight is
zero past the gate, where normals disagree and on borders.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float64, Int64
from scipy.spatial import cKDTree

from ...geometry.strict import exp
from ..fit.frame import FrameSurface
from .embedded_graph import area_samples
from .embedded_solve import Planes

NORMAL_REACH = 0.01  # diagonals, weight of a difference of unit normals in a search: a guess


class SampledSurface:
    """A prepared frame with samples of its surface, to which a key mesh is matched."""

    def __init__(self, frame: FrameSurface, samples: int, agreement: float) -> None:
        self._frame, self._agreement = frame, agreement
        chosen = area_samples(frame.mesh, samples)
        chosen = chosen[frame.inside[chosen]]
        self._points, self._normals = frame.mesh.vertices[chosen], frame.normals[chosen]
        self._spacing = float(np.sqrt(frame.surface.areas.sum() / samples))

    def planes(self, points: Float64[np.ndarray, "S 3"], normals: Float64[np.ndarray, "S 3"], gate: float) -> Planes:
        """Return rows that pull samples of the key mesh to the frame's surface and to planes at the frame's samples."""
        return self._towards(points, normals, gate) + self._back(points, normals, gate)

    def _towards(self, points: Float64[np.ndarray, "S 3"], normals: Float64[np.ndarray, "S 3"], gate: float) -> Planes:
        frame = self._frame
        hits = frame.surface.closest(points)
        planes = frame.normals_at(hits)
        weights = frame.inside_at(hits) * self._weights(
            np.linalg.norm(points - hits.points, axis=1) / gate, planes, normals
        )
        return _kept(np.arange(len(points)), planes, hits.points, weights)

    def _back(self, points: Float64[np.ndarray, "S 3"], normals: Float64[np.ndarray, "S 3"], gate: float) -> Planes:
        tree = cKDTree(np.concatenate([points, NORMAL_REACH * normals], axis=1))
        found = tree.query(np.concatenate([self._points, NORMAL_REACH * self._normals], axis=1))[1]
        offsets = points[found] - self._points
        along = np.abs(np.einsum("nd,nd->n", offsets, self._normals))
        beyond = np.linalg.norm(offsets, axis=1) - self._spacing  # samples are that far from each other anyway
        weights = self._weights(np.maximum(along, beyond) / gate, self._normals, normals[found])
        return _kept(found, self._normals, self._points, weights)

    def _weights(
        self,
        distance: Float64[np.ndarray, " N"],
        planes: Float64[np.ndarray, "N 3"],
        normals: Float64[np.ndarray, "N 3"],
    ) -> Float64[np.ndarray, " N"]:
        """Return Gaussian weights of pairs by their distances, in gates; sigma is half a gate."""
        agree = np.einsum("nd,nd->n", planes, normals) > self._agreement
        return np.where(agree & (distance < 1), exp(-2 * distance**2), 0.0)


def _kept(
    samples: Int64[np.ndarray, " N"],
    normals: Float64[np.ndarray, "N 3"],
    points: Float64[np.ndarray, "N 3"],
    weights: Float64[np.ndarray, " N"],
) -> Planes:
    keep = np.flatnonzero(weights > 0)
    values = np.einsum("nd,nd->n", normals[keep], points[keep])
    return Planes(samples[keep], normals[keep], values, weights[keep])
