"""Surface from points: their normals, the side that these point to, and the zero of the distances from their planes.

A point's plane fits its neighbours best. Planes of neighbours agree on a side: a spanning tree of cells carries it
along surfaces, not through them (Hoppe et al. 1992). Signed distances are the core's (`mr_point_distances`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float64, Int64, UInt8
from scipy.sparse import coo_array
from scipy.sparse.csgraph import breadth_first_order, minimum_spanning_tree
from scipy.spatial import cKDTree

from .. import _core
from ..errors import InputError
from ..types import Mesh
from .reconstruct import MOST_BLOCKS, SEEN, SIDE, Grid, Points, extract
from .topology import linked
from .voxels import Lattice, distinct, neighbours

AROUND = 16  # nearest points that a plane is fitted to (guess)
TOGETHER = 100_000  # points whose planes are fitted at a time: bounds memory
VOXEL, WIDER = 1.5, 1.5  # voxels to a spacing of points, and from one size that is tried to the next (guess)
FLAT, LOOKED_AT, TRIED = 0.6, 2000, 12  # share of a plane's width that noise may have (seen: least errors); guesses
CELL = 1.5  # voxels, side of the cells that agree on a side (guess)
RADIUS, PAST = 2.0, 0.75  # voxels within which points count, and past a border that surface goes on (guess)
ROOM = 2.0  # m, least extent of a room that is seen from inside, along two axes (guess)
SHELL, WALLS = 0.05, 0.5  # share of a room's extent beside its sides, and of its points that lie there (guess)
COLORED = 4  # nearest points whose colours a vertex has (guess)


Cells = Float64[np.ndarray, "C 3"]  # vectors of cells


@dataclass(frozen=True, slots=True)
class Cloud:
    """Points on surfaces."""

    points: Points  # m
    normals: Float64[np.ndarray, "N 3"] | None = None  # which point outside, of any length; 0 where unknown
    colors: UInt8[np.ndarray, "N 3"] | None = None  # sRGB
    eye: Float64[np.ndarray, " 3"] | None = None  # m, of the sensor, where it is known

    def thinned(self, size: float) -> Cloud:
        """Return the means of the points, normals and colours in cells of a size (m), in the order of the cells."""
        if not len(self.points):
            return self
        _, cell = np.unique(_lattice(self.points, size).keys(self.points), return_inverse=True)
        cell, count = cell.reshape(-1), np.bincount(cell.reshape(-1))[:, None]

        def mean(values: np.ndarray) -> np.ndarray:
            return np.stack([np.bincount(cell, column) for column in values.T], axis=1) / count

        colors = None if self.colors is None else np.rint(mean(self.colors)).astype(np.uint8)
        return Cloud(mean(self.points), None if self.normals is None else mean(self.normals), colors, self.eye)


def surface_of(cloud: Cloud, voxel: float) -> Mesh:
    """Return the surface through points, with colours where they have some. Raises InputError as `surface_through`."""
    thin = cloud.thinned(voxel / VOXEL)
    if thin.normals is None:
        normals = normals_of(thin.points, CELL * voxel, thin.eye)
    else:
        length = np.linalg.norm(thin.normals, axis=1, keepdims=True)
        normals = np.where(length > 0, thin.normals / np.where(length > 0, length, 1), 0)
    mesh = surface_through(thin.points, normals, voxel)
    if thin.colors is None or mesh.is_empty:
        return mesh
    gaps, near = cKDTree(thin.points).query(mesh.vertices, k=np.arange(1, min(COLORED, len(thin.points)) + 1))
    weights = 1 / np.maximum(gaps, 1e-3 * voxel)
    mixed = (thin.colors[near] * weights[:, :, None]).sum(axis=1) / weights.sum(axis=1, keepdims=True)
    return replace(mesh, colors=np.rint(mixed).astype(np.uint8))


def voxel_for(cloud: Cloud) -> float:
    """Return the side of the smallest voxels that points are dense enough for, and no noisier than; 0 for too few."""
    if len(cloud.points) <= AROUND:
        return 0.0
    some = cloud.points[:: max(1, len(cloud.points) // LOOKED_AT)]
    reach = float(np.median(cKDTree(cloud.points).query(some, k=[AROUND])[0]))
    voxel = VOXEL * reach * math.sqrt(math.pi / AROUND)  # as if they lay on a square grid
    for _ in range(TRIED if voxel else 0):
        points = cloud.thinned(voxel / VOXEL).points
        if len(points) <= AROUND:
            break
        sizes, _ = _planes(points, points[:: max(1, len(points) // LOOKED_AT)])
        if np.median(np.sqrt(np.maximum(sizes[:, 0], 0) / np.maximum(sizes[:, 1], 1e-300))) <= FLAT:
            break
        voxel *= WIDER
    return voxel


def _lattice(points: Points, size: float) -> Lattice:
    return Lattice.near(Mesh(points[:1], np.zeros((1, 3), np.int32)), size)


def _planes(
    points: Points, some: Float64[np.ndarray, "S 3"]
) -> tuple[Float64[np.ndarray, "S 3"], Float64[np.ndarray, "S 3 3"]]:
    """Return the squared extents, ascending, of the points around some, and their axes, in columns."""
    near = points[cKDTree(points).query(some, k=AROUND)[1]]
    away = near - near.mean(axis=1, keepdims=True)
    return _core.eigen(np.einsum("nki,nkj->nij", away, away))


def normals_of(points: Points, size: float, eye: Float64[np.ndarray, " 3"] | None = None) -> Float64[np.ndarray, "N 3"]:
    """Return the unit normals of surface through points, which point to the eye, where that is known.

    Otherwise those of a body point outside, and those of a room into it. `size` (m) is that of cells that agree on a
    side, in which there are some points. Normals of too few points are 0.
    """
    if len(points) <= AROUND:
        return np.zeros((len(points), 3))
    found = np.concatenate([_planes(points, points[k : k + TOGETHER])[1] for k in range(0, len(points), TOGETHER)])
    found = np.ascontiguousarray(found[:, :, 0])
    keys, cell = np.unique(_lattice(points, size).keys(points), return_inverse=True)
    cell = cell.reshape(-1)
    outer = (found[:, :, None] * found[:, None]).reshape(-1, 9)
    squares = np.stack([np.bincount(cell, column, len(keys)) for column in outer.T], axis=1)
    axes = np.ascontiguousarray(_core.eigen(squares.reshape(-1, 3, 3))[1][:, :, 2])
    middles = np.stack([np.bincount(cell, column) for column in points.T], axis=1) / np.bincount(cell)[:, None]
    links = _links(keys)
    axes *= _agreed(links, middles, axes)[:, None]
    piece = linked(links, len(keys))
    axes *= _outward(middles, axes, piece, eye)[piece][:, None]
    return np.where((found * axes[cell]).sum(axis=1, keepdims=True) < 0, -found, found)


def _links(keys: Int64[np.ndarray, " C"]) -> Int64[np.ndarray, "L 2"]:
    """Return the pairs of cells that touch, the lower number first."""
    beside = neighbours(keys).astype(np.int64)
    pairs = np.stack([np.repeat(np.arange(len(keys)), beside.shape[1]), beside.reshape(-1)], axis=1)
    return pairs[pairs[:, 0] < pairs[:, 1]]


def _agreed(links: Int64[np.ndarray, "L 2"], middles: Cells, axes: Cells) -> Float64[np.ndarray, " C"]:
    """Return 1 or -1 for each cell, so that the normals of linked ones agree along surfaces."""
    count, (first, second) = len(axes), links.T
    way = middles[second] - middles[first]
    way /= np.maximum(np.linalg.norm(way, axis=1, keepdims=True), 1e-300)
    turn = (axes[first] * axes[second]).sum(axis=1)
    through = np.abs((axes[first] * way).sum(axis=1)) + np.abs((axes[second] * way).sum(axis=1))  # not along a surface
    roots = np.unique(linked(links, count), return_index=True)[1]  # the first cell of each piece
    rows, columns = np.append(first, np.full(len(roots), count)), np.append(second, roots)
    costs = np.append(1.001 - np.abs(turn) + through, np.ones(len(roots)))  # 0 would be no link
    tree = minimum_spanning_tree(coo_array((costs, (rows, columns)), shape=(count + 1, count + 1)).tocsr())
    order, before = breadth_first_order(tree, count, directed=False)
    ends = np.where(before[:count] == count, np.arange(count), before[:count])
    same = ((axes * axes[ends]).sum(axis=1) >= 0).tolist()
    sides = [1.0] * (count + 1)
    for cell, origin in zip(order[1:].tolist(), before[order[1:]].tolist(), strict=True):
        sides[cell] = sides[origin] if same[cell] else -sides[origin]
    return np.array(sides[:count])


def _outward(
    middles: Cells, axes: Cells, piece: Int64[np.ndarray, " C"], eye: Float64[np.ndarray, " 3"] | None
) -> Float64[np.ndarray, " P"]:
    """Return 1 or -1 for each piece of surface, so that its normals point to the side that is seen."""
    size = np.bincount(piece)[:, None]
    center = np.stack([np.bincount(piece, column) for column in middles.T], axis=1) / size
    if eye is not None:
        return np.where(np.bincount(piece, (axes * (eye - middles)).sum(axis=1)) < 0, -1.0, 1.0)
    low, high = np.full((2, *center.shape), np.inf)
    np.minimum.at(low, piece, middles)
    np.minimum.at(high, piece, -middles)
    extent = -high - low
    depth = np.minimum(middles - low[piece], -high[piece] - middles) / np.maximum(extent[piece], 1e-300)
    walls = np.bincount(piece, (depth <= SHELL).any(axis=1)) / size[:, 0]
    is_room = (walls >= WALLS) & (np.sort(extent, axis=1)[:, 1] >= ROOM)
    out = np.bincount(piece, (axes * (middles - center[piece])).sum(axis=1)) >= 0
    return np.where(out != is_room, 1.0, -1.0)


def surface_through(points: Points, normals: Float64[np.ndarray, "N 3"], voxel: float) -> Mesh:
    """Return the surface through points whose normals have the length 1, or 0 where they are unknown; m.

    Its border is at most `PAST` voxels past the points. Raises InputError beyond `MOST_BLOCKS`.
    """
    known = (normals != 0).any(axis=1)
    if not known.any():
        return Mesh.empty()
    origin = _lattice(points, SIDE * voxel).origin  # a scene may be far off, as on a map
    points, normals = np.ascontiguousarray(points[known] - origin), np.ascontiguousarray(normals[known])
    radius, shared = RADIUS * voxel, Lattice(np.zeros(3), SIDE * voxel)
    corners = [shared.keys(points + radius * np.array(np.unravel_index(k, (2, 2, 2))) * 2 - radius) for k in range(8)]
    blocks = np.ascontiguousarray(shared.cells(distinct(np.concatenate(corners))), dtype=np.int32)
    if len(blocks) > MOST_BLOCKS:
        text = f"surface in {len(blocks)} blocks of {SIDE * voxel:g} m, over {MOST_BLOCKS}"
        raise InputError(f"{text}; is the unit right? If so, give a larger voxel")
    distances, weights = np.zeros((2, len(blocks), SIDE, SIDE, SIDE), np.float32)
    _core.point_distances(points, normals, voxel, radius, PAST * voxel, blocks, distances, weights)
    mesh = extract(Grid(voxel, blocks, distances, weights), SEEN)
    return mesh.at(mesh.vertices + origin)
