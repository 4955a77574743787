"""Pairs of a moved key mesh's samples and a frame's surface, both ways, as point-to-plane rows.

A pair counts by a Gaussian of its distance, and not at all past the gate, where the normals disagree or on a border.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float64, Int64
from scipy.spatial import cKDTree

from ..fit.match import Target
from .embedded_graph import area_samples
from .embedded_solve import Planes

NORMAL_REACH = 0.01  # in a search, distance that a difference of 1 between unit normals counts as


class SampledTarget:
    """A frame that the key mesh is matched with: its surface, and samples of it for the way back."""

    def __init__(self, target: Target, samples: int, agreement: float) -> None:
        self._target, self._agreement = target, agreement
        chosen = area_samples(target.mesh, samples)
        chosen = chosen[target.inside[chosen] > 0]
        self._points, self._normals = target.mesh.vertices[chosen], target.normals[chosen]
        self._spacing = float(np.sqrt(target.surface.areas.sum() / samples))

    def planes(self, points: Float64[np.ndarray, "S 3"], normals: Float64[np.ndarray, "S 3"], gate: float) -> Planes:
        """Rows that pull the samples to the frame's surface, and the frame's samples' planes to the samples."""
        return self._towards(points, normals, gate) + self._back(points, normals, gate)

    def _towards(self, points: Float64[np.ndarray, "S 3"], normals: Float64[np.ndarray, "S 3"], gate: float) -> Planes:
        target = self._target
        hits = target.surface.closest(points)
        planes = target.normals_at(hits)
        inside = np.einsum("nk,nk->n", hits.barycentric, target.inside[target.mesh.faces[hits.faces]])
        weights = inside * self._weights(np.linalg.norm(points - hits.points, axis=1) / gate, planes, normals)
        return _kept(np.arange(len(points)), planes, hits.points, weights)

    def _back(self, points: Float64[np.ndarray, "S 3"], normals: Float64[np.ndarray, "S 3"], gate: float) -> Planes:
        tree = cKDTree(np.concatenate([points, NORMAL_REACH * normals], axis=1))
        found = tree.query(np.concatenate([self._points, NORMAL_REACH * self._normals], axis=1))[1]
        offsets = points[found] - self._points
        along = np.abs(np.einsum("nd,nd->n", offsets, self._normals))
        beyond = np.linalg.norm(offsets, axis=1) - self._spacing  # samples are that far apart wherever they lie
        weights = self._weights(np.maximum(along, beyond) / gate, self._normals, normals[found])
        return _kept(found, self._normals, self._points, weights)

    def _weights(
        self,
        distance: Float64[np.ndarray, " N"],
        planes: Float64[np.ndarray, "N 3"],
        normals: Float64[np.ndarray, "N 3"],
    ) -> Float64[np.ndarray, " N"]:
        """Distances are in gates; sigma is half a gate."""
        agree = np.einsum("nd,nd->n", planes, normals) > self._agreement
        return np.where(agree & (distance < 1), np.exp(-2 * distance**2), 0.0)


def _kept(
    samples: Int64[np.ndarray, " N"],
    normals: Float64[np.ndarray, "N 3"],
    points: Float64[np.ndarray, "N 3"],
    weights: Float64[np.ndarray, " N"],
) -> Planes:
    keep = np.flatnonzero(weights > 0)
    values = np.einsum("nd,nd->n", normals[keep], points[keep])
    return Planes(samples[keep], normals[keep], values, weights[keep])
