"""Fuse the still surface of many frames into one background mesh (paper, section 3.2; decision 19).

In: the still faces of some frames. Out: one mesh. Signed distances to the surfaces of the frames are averaged, so noise
averages out, and surface that people hide in one frame comes from others.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int64

from ...geometry.closest_points import Surface
from ...geometry.topology import without_fragments
from ...geometry.tsdf import SIDE, Grid, extract
from ...geometry.voxels import Lattice, around, distinct, spread
from ...types import Mesh

_REACH = 1.5  # voxels: distances are kept this far from a surface, enough for the cubes it crosses, and noise; a guess


@dataclass(frozen=True, slots=True)
class BackgroundOptions:
    """Options of the fusion of frames into one background (values: decision 19)."""

    frames: int = 20  # largest number of fused frames, spread over the sequence
    depth: bool = True  # fuse the cameras' depth pictures if the sequence has them
    seen: float = 0.15  # smallest share of the frames that must have surface at a voxel
    steady: float = 0.6  # voxels: where the standard deviation of the distances is larger, the surface was not still
    past: float = 0.5  # voxels by which a surface is continued past its border, so that borders do not recede
    finer: float = 0.75  # voxel of a fusion from depth, in voxels of the frames: averaged depth has less noise
    facing: float = 0.15  # cosine: faces that no camera sees more frontally lie between two real surfaces
    fragment: float = 0.02  # m^2: connected pieces with less area are dropped
    coarse: float = 0.5  # RMS distance from the fused surface that decimation may cost, in RMS noise of a frame
    lattice: float = 0.3  # spacing of the lattice, in RMS noise of a frame
    refresh: float | None = None  # s between two copies of the background in the file; None: one copy

    def least(self, count: int) -> int:
        """Return how many of `count` frames must have surface at a voxel."""
        return max(1, math.ceil(self.seen * count))


def fuse_background(frames: Iterable[Mesh], voxel: float, options: BackgroundOptions = BackgroundOptions()) -> Mesh:
    """Fuse meshes of one still scene into their mean surface, on a grid of `voxel` (m); reads one mesh at a time."""
    sums = _Sums(voxel, options)
    count = 0
    for mesh in frames:
        sums.add(mesh)
        count += 1
    return without_fragments(sums.surface(options.least(count)), options.fragment)


class _Sums:
    """Sums of the signed distances of voxels near any added surface, of their squares, and counts of frames.

    Coordinates are taken relative to a point near the first surface: distances are float32, and a scene may be far off.
    """

    def __init__(self, voxel: float, options: BackgroundOptions) -> None:
        self._lattice, self._options = Lattice(np.full(3, -voxel / 2), voxel), options  # cells' middles are voxels
        self._origin: Float64[np.ndarray, " 3"] | None = None
        self._keys = np.zeros(0, np.int64)
        self._sums, self._squares, self._counts = np.zeros(0), np.zeros(0), np.zeros(0, np.int32)

    def add(self, mesh: Mesh) -> None:
        """Add the distances of the voxels near the surface of a frame."""
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
        """Extract the zero of the mean distance, over voxels that at least `least` frames know and agree on."""
        means = self._sums / np.maximum(self._counts, 1)
        varies = np.sqrt(np.maximum(self._squares / np.maximum(self._counts, 1) - means**2, 0))
        known = (self._counts >= least) & (varies <= self._options.steady * self._lattice.size)
        if self._origin is None or not known.any():
            return Mesh.empty()
        cells = self._lattice.cells(self._keys[known])
        inside, shared = cells % SIDE, Lattice(np.zeros(3), 1.0)
        keys, which = np.unique(shared.keys(cells // SIDE + 0.5), return_inverse=True)
        blocks, which = shared.cells(keys), which.reshape(-1)
        distances = np.zeros((len(blocks), SIDE, SIDE, SIDE), np.float32)
        weights = np.zeros_like(distances)
        at = (which, inside[:, 2], inside[:, 1], inside[:, 0])
        distances[at] = means[known] / (_REACH * self._lattice.size)
        weights[at] = 1.0
        mesh = extract(Grid.of(self._lattice.size, blocks.astype(np.int32), distances, weights), 0.5)
        return Mesh(mesh.vertices + self._origin, mesh.faces)

    def _signed(self, mesh: Mesh) -> tuple[Int64[np.ndarray, " M"], Float64[np.ndarray, " M"]]:
        """Return the keys of the voxels within reach of a surface and their signed distances to it.

        Past a border the distance is that to the plane of the nearest face.
        """
        size = self._lattice.size
        keys = around(distinct(self._lattice.keys(spread(mesh, size)[0])))  # includes all within `_REACH`
        points, surface = self._lattice.centers(keys), Surface(mesh)
        hits = surface.closest(points)
        away = points - hits.points
        along = (away * surface.normals[hits.faces]).sum(axis=1)
        distance = np.linalg.norm(away, axis=1)
        beyond = surface.past_border(hits)
        aside = np.sqrt(np.maximum(distance**2 - along**2, 0))
        known = (distance <= _REACH * size) & (~beyond | (aside <= self._options.past * size))
        signed = np.where(beyond, along, np.where(along < 0, -distance, distance))
        return keys[known], signed[known]
