"""What happens at each place of a scene over time: occupied, seen free, or not known (free-space carving).

In: some frames of a scene, spread over the sequence, and views of them. Out: for every cell that any of the frames has
surface in, in which frames there is surface in or beside it, and in which frames views see past it.

A cell beside surface counts as occupied, whatever is seen: noise moves a surface from cell to cell, and rays graze it.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float32, Float64, Int32, Int64, UInt16

from ...errors import InputError
from ...geometry.cameras import PinholeCamera
from ...geometry.raycast import Rays
from ...geometry.topology import face_normals
from ...geometry.voxels import Lattice, distinct, neighbours, spread
from ...types import Mesh

_DEEPEST = 65_535  # of a stored depth; 0: nothing seen


@dataclass(frozen=True, slots=True)
class PlacesOptions:
    """How finely a scene is looked at, and what counts as seen free."""

    frames: int = 32  # looked at, at most, spread over the sequence: memory does not grow with its length
    past: float = 2.0  # cells that a view must see past a cell's middle
    views: int = 2  # that must see past it

    def __post_init__(self) -> None:
        if self.frames < 2 or not self.past > 0 or self.views < 1:
            raise InputError(f"{self.frames} frames, past {self.past:g}, {self.views} views: give >= 2, > 0, >= 1")


@dataclass(frozen=True, slots=True)
class Places:
    """Cells of a scene in T frames that were looked at."""

    lattice: Lattice
    keys: Int64[np.ndarray, " P"]  # sorted
    beside: Int32[np.ndarray, "P 26"]  # numbers of the cells around each; its own for none
    occupied: Bool[np.ndarray, "T P"]  # there is surface in or beside the cell
    free: Bool[np.ndarray, "T P"]  # and not: seen past
    normals: Float64[np.ndarray, "P 3"]  # mean of what was there, of unit length; 0 where they cancel

    @property
    def free_share(self) -> Float64[np.ndarray, " P"]:
        """The share of the frames that know a place in which it is seen free."""
        known = self.free.sum(axis=0) + self.occupied.sum(axis=0)
        return self.free.sum(axis=0) / np.maximum(known, 1)

    @property
    def middles(self) -> Float64[np.ndarray, "P 3"]:
        """The middles of the cells."""
        return self.lattice.centers(self.keys)


def find_places(
    frames: Iterable[Mesh], views: Sequence[PinholeCamera], lattice: Lattice, options: PlacesOptions = PlacesOptions()
) -> Places:
    """The places of a scene; one frame in memory at a time."""
    cells, sums, depths, unit = [], [], [], lattice.size / 16
    for mesh in frames:
        own, normals = _cells(mesh, lattice)
        cells.append(own)
        sums.append(normals)
        rays = Rays(mesh)
        depths.append([_stored(rays, view, unit) for view in views])
    keys = distinct(np.concatenate(cells))
    beside = neighbours(keys)
    mean = np.zeros((len(keys), 3), np.float32)
    for own, normals in zip(cells, sums, strict=True):
        mean[np.searchsorted(keys, own)] += normals
    occupied = np.stack([_near(keys, beside, own) for own in cells])
    seen = np.zeros((len(cells), len(keys)), np.uint8)
    middles = lattice.centers(keys)
    for number, view in enumerate(views):
        pixels, inside, depth = _projected(view, middles)
        limit = (depth + options.past * lattice.size) / unit
        for frame, pictures in enumerate(depths):
            seen[frame, inside[pictures[number].reshape(-1)[pixels] > limit]] += 1
    length = np.linalg.norm(mean, axis=1, keepdims=True)
    normals = (mean / np.where(length > 0, length, 1)).astype(np.float64)
    return Places(lattice, keys, beside, occupied, (seen >= options.views) & ~occupied, normals)


def _cells(mesh: Mesh, lattice: Lattice) -> tuple[Int64[np.ndarray, " C"], Float32[np.ndarray, "C 3"]]:
    """The cells that a mesh has surface in, sorted, and the sum of its normals there."""
    points, faces = spread(mesh, 1.5 * lattice.size)
    keys, cell = np.unique(lattice.keys(points), return_inverse=True)
    normals = face_normals(mesh)[0][faces]
    sums = [np.bincount(cell.reshape(-1), normals[:, axis], len(keys)) for axis in range(3)]
    return keys, np.stack(sums, axis=1).astype(np.float32)


def _stored(rays: Rays, view: PinholeCamera, unit: float) -> UInt16[np.ndarray, "H W"]:
    """Depth in units; 0 where nothing is met, or the back of something: what is there is not known."""
    seen = rays.look(view)
    depth = np.where(np.isfinite(seen.depth) & ~rays.backs(view, seen), seen.depth, 0.0)
    return np.clip(np.rint(depth / unit), 0, _DEEPEST).astype(np.uint16)


def _near(
    keys: Int64[np.ndarray, " P"], beside: Int32[np.ndarray, "P 26"], own: Int64[np.ndarray, " C"]
) -> Bool[np.ndarray, " P"]:
    """The cells in or beside which a frame has surface."""
    there = np.zeros(len(keys), bool)
    there[np.searchsorted(keys, own)] = True
    near = there.copy()
    near[beside[there].reshape(-1)] = True
    return near


def _projected(
    view: PinholeCamera, points: Float64[np.ndarray, "P 3"]
) -> tuple[Int64[np.ndarray, " N"], Int64[np.ndarray, " N"], Float64[np.ndarray, " N"]]:
    """Pixels that the points in the picture fall on, the numbers of these points, and their depths, m."""
    local = points @ view.extrinsic[:3, :3].T + view.extrinsic[:3, 3]
    with np.errstate(invalid="ignore"):
        columns, rows = np.floor(view.project(local)).T
    inside = np.flatnonzero((columns >= 0) & (columns < view.width) & (rows >= 0) & (rows < view.height))
    pixels = rows[inside].astype(np.int64) * view.width + columns[inside].astype(np.int64)
    return pixels, inside, local[inside, 2]
