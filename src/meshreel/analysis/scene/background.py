"""The room without the people: what stands still in many frames, fused over time (paper, section 3.2).

In: what does not move of some frames. Out: one mesh. Signed distances to each frame's surface are averaged, so noise
averages out; what people hide in one frame is there in others.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int64

from ...errors import InputError
from ...geometry.closest_points import Surface
from ...geometry.connected import without_fragments
from ...geometry.tsdf import SIDE, extract, fill_grid
from ...geometry.voxels import Lattice, around, distinct, spread
from ...types import Mesh

_REACH = 1.5  # voxels on both sides of a surface that know their distance to it: cubes that it goes through, and noise


@dataclass(frozen=True, slots=True)
class BackgroundOptions:
    """How frames become one background."""

    frames: int = 20  # fused, at most, spread over the sequence
    depth: bool = True  # from the cameras' depth where the sequence has it
    seen: float = 0.15  # share of the frames that must have surface somewhere
    steady: float = 0.6  # voxels, standard deviation: where distances vary more, something has flown
    past: float = 0.5  # voxels past a border that its surface is taken to go on: less, and borders recede
    finer: float = 0.75  # voxels of the frames' grid that one is from depth: what is averaged has less noise
    facing: float = 0.3  # cosine: faces that no camera sees more from the front are of pixels between two surfaces
    fragment: float = 0.02  # m^2: connected pieces with less area are dropped
    coarse: float = 0.75  # RMS distance from the fused surface that decimation may cost, in RMS noise of a frame
    lattice: float = 0.67  # spacing of the lattice, in the same
    refresh: float | None = None  # s from one copy of the background in the file to the next; None: one for all

    def __post_init__(self) -> None:
        if not (self.coarse > 0 and self.lattice > 0 and (self.refresh is None or self.refresh > 0)):
            raise InputError(
                f"background: coarse {self.coarse:g}, lattice {self.lattice:g}, refresh {self.refresh} s: give above 0"
            )
        if self.frames < 1 or not 0 <= self.seen < 1 or not 0 <= self.fragment < np.inf or not self.steady > 0:
            raise InputError(
                f"background of {self.frames} frames, seen {self.seen:g}, fragment {self.fragment:g}, steady "
                f"{self.steady:g}: give >= 1, 0 to below 1, from 0 on, and above 0"
            )
        if not 0 <= self.past <= 1 or not 0.1 <= self.finer <= 1 or not 0 <= self.facing < 1:
            text = f"background past {self.past:g}, finer {self.finer:g}, facing {self.facing:g}"
            raise InputError(f"{text}: give 0 to 1, 0.1 to 1, and 0 to below 1")

    def least(self, count: int) -> int:
        """How many of so many frames must have surface somewhere."""
        return max(1, math.ceil(self.seen * count))


def fuse_background(frames: Iterable[Mesh], voxel: float, options: BackgroundOptions = BackgroundOptions()) -> Mesh:
    """The mean surface of meshes of one still scene, about a voxel (m) fine; one of them in memory at a time."""
    sums = _Sums(voxel, options)
    count = 0
    for mesh in frames:
        sums.add(mesh)
        count += 1
    return without_fragments(sums.surface(options.least(count)), options.fragment)


class _Sums:
    """Distances of voxels near any surface so far: their sum, that of their squares, and of how many frames.

    Inside, coordinates are about an origin near the first surface: distances are float32, and scenes may be far away.
    """

    def __init__(self, voxel: float, options: BackgroundOptions) -> None:
        self._lattice, self._options = Lattice(np.full(3, -voxel / 2), voxel), options  # cells' middles are voxels
        self._origin: Float64[np.ndarray, " 3"] | None = None
        self._keys = np.zeros(0, np.int64)
        self._sums, self._squares, self._counts = np.zeros(0), np.zeros(0), np.zeros(0, np.int32)

    def add(self, mesh: Mesh) -> None:
        """Takes in a frame."""
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
        """Where the mean distance is zero, among voxels that at least so many frames know, and all alike."""
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
        mesh = extract(fill_grid(self._lattice.size, blocks.astype(np.int32), distances, weights), 0.5)
        return Mesh(mesh.vertices + self._origin, mesh.faces)

    def _signed(self, mesh: Mesh) -> tuple[Int64[np.ndarray, " M"], Float64[np.ndarray, " M"]]:
        """The voxels within reach of a surface, and their distances; past a border, from the plane of its face."""
        size = self._lattice.size
        keys = around(distinct(self._lattice.keys(spread(mesh, size)[0])))  # all that is nearer than `_REACH`
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
