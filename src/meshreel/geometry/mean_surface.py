"""The mean of several surfaces: signed distances to each are averaged on a sparse grid, which reduces noise.

In -> out: meshes -> the surface that enough of them have. Lasting borders stay; gaps are filled from other meshes.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int64

from ..types import Mesh
from .closest_points import Surface
from .tsdf import SIDE, Grid, extract
from .voxels import Lattice, around, distinct, spread


@dataclass(frozen=True, slots=True)
class MeanOptions:
    """Limits of the distances that count, in voxels."""

    reach: float = 1.5  # distances are kept this far from a surface: enough for the cubes it crosses, and noise (guess)
    steady: float = math.inf  # where the standard deviation of the distances is larger, there is no surface
    past: float = 0.5  # a surface is continued past its border so far, so that borders do not recede


class MeanSurface:
    """Sums of the signed distances of voxels near any added surface, of their squares, and counts of surfaces.

    Coordinates are taken relative to a point near the first surface: distances are float32, and a scene may be far off.
    """

    def __init__(self, voxel: float, options: MeanOptions = MeanOptions()) -> None:
        self._lattice, self._options = Lattice(np.full(3, -voxel / 2), voxel), options  # cells' middles are voxels
        self._origin: Float64[np.ndarray, " 3"] | None = None
        self._keys = np.zeros(0, np.int64)
        self._sums, self._squares, self._counts = np.zeros(0), np.zeros(0), np.zeros(0, np.int32)

    def add(self, mesh: Mesh) -> None:
        """Add the distances of the voxels near a surface."""
        if mesh.is_empty:
            return
        if self._origin is None:
            self._origin = Lattice.near(mesh, self._lattice.size).origin
        mesh = Mesh(mesh.vertices - self._origin, mesh.faces)
        keys, distances = self._signed(mesh)
        union = distinct(np.concatenate([self._keys, keys]))
        before, now = np.searchsorted(union, self._keys), np.searchsorted(union, keys)
        sums, squares, counts = np.zeros(len(union)), np.zeros(len(union)), np.zeros(len(union), np.int32)
        sums[before], squares[before], counts[before] = self._sums, self._squares, self._counts
        sums[now] += distances
        squares[now] += distances**2
        counts[now] += 1
        self._keys, self._sums, self._squares, self._counts = union, sums, squares, counts

    def surface(self, least: int) -> Mesh:
        """Extract the zero of the mean distance, over voxels that at least `least` surfaces know and agree on."""
        means = self._sums / np.maximum(self._counts, 1)
        varies = np.sqrt(np.maximum(self._squares / np.maximum(self._counts, 1) - means**2, 0))
        agreed = (self._counts >= least) & (varies <= self._options.steady * self._lattice.size)
        if self._origin is None or not agreed.any():
            return Mesh.empty()
        cells = self._lattice.cells(self._keys[agreed])
        inside, shared = cells % SIDE, Lattice(np.zeros(3), 1.0)
        keys, which = np.unique(shared.keys(cells // SIDE + 0.5), return_inverse=True)
        blocks, which = shared.cells(keys), which.reshape(-1)
        distances = np.zeros((len(blocks), SIDE, SIDE, SIDE), np.float32)
        weights = np.zeros_like(distances)
        at = (which, inside[:, 2], inside[:, 1], inside[:, 0])
        distances[at] = means[agreed] / (self._options.reach * self._lattice.size)
        weights[at] = 1.0
        mesh = extract(Grid.of(self._lattice.size, blocks.astype(np.int32), distances, weights), 0.5)
        return Mesh(mesh.vertices + self._origin, mesh.faces)

    def _signed(self, mesh: Mesh) -> tuple[Int64[np.ndarray, " M"], Float64[np.ndarray, " M"]]:
        """Return the keys of the voxels within reach of a surface and their signed distances to it.

        Past a border the distance is that to the plane of the nearest face.
        """
        size = self._lattice.size
        keys = distinct(self._lattice.keys(spread(mesh, size)[0]))
        for _ in range(math.ceil(self._options.reach - 0.5)):
            keys = around(keys)  # in the end, all within reach
        points, surface = self._lattice.centers(keys), Surface(mesh)
        hits = surface.closest(points)
        away = points - hits.points
        along = (away * surface.normals[hits.faces]).sum(axis=1)
        distance = np.linalg.norm(away, axis=1)
        beyond = surface.past_border(hits)
        aside = np.sqrt(np.maximum(distance**2 - along**2, 0))
        within = (distance <= self._options.reach * size) & (~beyond | (aside <= self._options.past * size))
        signed = np.where(beyond, along, np.where(along < 0, -distance, distance))
        return keys[within], signed[within]
