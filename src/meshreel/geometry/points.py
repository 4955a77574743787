"""Surface from points: their normals, the side that these point to, and the zero of the distances from their planes.

A point's plane fits its neighbours best. Planes of neighbours agree on a side: a spanning tree of cells carries it
along surfaces, not through them (Hoppe et al. 1992). Signed distances are the core's (`mr_point_distances`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from jaxtyping import Float64, Int64, UInt8
from scipy.sparse import coo_array
from scipy.sparse.csgraph import breadth_first_order, minimum_spanning_tree
from scipy.spatial import cKDTree

from .. import _core
from ..errors import InputError
from ..types import Mesh
from .reconstruct import MOST_BLOCKS, SEEN, SIDE, Grid, Points, close_holes, extract
from .topology import linked
from .voxels import Lattice, distinct, neighbours

AROUND = 16  # nearest points that a plane is fitted to (guess)
TOGETHER = 100_000  # points whose planes are fitted at a time: bounds memory
VOXEL = 1.5  # distances between points along a voxel (guess)
WIDER = 1.5  # from one size of voxels that is tried to the next (guess)
TRIED = 12  # sizes, at most (guess)
LOOKED_AT = 2000  # points around which planes are fitted, to judge a size (guess)
FLAT = 0.6  # most extent across a plane that noise may have, in extents along it (decision 43)
COVERED = 0.5  # share of the surface on which points are as dense as voxels need (guess)
ALONE = 4.0  # times the usual reach, beyond which a point stands for no more surface: it flies (guess)
ALIKE = 0.01  # of the reach of neighbours: points that are nearer to each other are one (guess)
HOLES = 8.0  # voxels, longest border of a hole that is closed: points are not even (guess)
BARE = 3.0  # voxels from a surface, beyond which a point has none (guess)
SHARP = 0.5  # cosine below which normals of linked cells meet at an edge (guess)
FARTHEST_CELL = 1 << 18  # cells from the middle of a cloud: half of what keys of cells reach
CELL = 1.2  # voxels, side of the cells that agree on a side (guess)
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
        """Return the means of the points, normals and colours in cells of a size (m), in the order of the cells.

        Points beyond `FARTHEST_CELL` cells from the middle are left out.
        """
        if not len(self.points):
            return self
        lattice = _lattice(self.points, size)
        near = (np.abs(self.points - lattice.origin) < FARTHEST_CELL * size).all(axis=1)
        _, cell = np.unique(lattice.keys(self.points[near]), return_inverse=True)
        cell, count = cell.reshape(-1), np.bincount(cell.reshape(-1))[:, None]

        def mean(values: np.ndarray) -> np.ndarray:
            return np.stack([np.bincount(cell, column) for column in values[near].T], axis=1) / count

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
    mesh = close_holes(surface_through(thin.points, normals, voxel), HOLES * voxel)
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
    reach = _reach(cloud.points)
    # Programs repeat points, and overlapping exports have the same ones twice.
    points = cloud.points if reach == 0 else np.round(cloud.points / (ALIKE * reach)) * (ALIKE * reach)
    cloud = Cloud(np.unique(points, axis=0))
    reach = _reach(cloud.points) if len(cloud.points) > AROUND else 0.0
    voxel = VOXEL * reach * math.sqrt(math.pi / AROUND)  # as if they lay on a square grid
    for _ in range(TRIED if voxel else 0):
        points = cloud.thinned(voxel / VOXEL).points
        if len(points) <= AROUND:
            break
        sizes, _ = _planes(cKDTree(points), points, points[:: max(1, len(points) // LOOKED_AT)])
        if np.median(np.sqrt(np.maximum(sizes[:, 0], 0) / np.maximum(sizes[:, 1], 1e-300))) <= FLAT:
            break
        voxel *= WIDER
    return voxel


def _lattice(points: Points, size: float) -> Lattice:
    """Return the lattice of points, most of which are near each other: single ones may fly."""
    middle = np.sort(points, axis=0)[len(points) // 2][None]
    return Lattice.near(Mesh(middle, np.zeros((1, 3), np.int32)), size)


def _reach(points: Points) -> float:
    """Return the distance of the farthest of `AROUND` neighbours, m, that `COVERED` of the surface do not exceed.

    A point stands for as much surface as its neighbours leave it: where points are sparse, few have a lot.
    """
    some = points[:: max(1, len(points) // LOOKED_AT)]
    reaches = np.sort(cKDTree(points).query(some, k=[AROUND])[0][:, 0])
    reaches = np.minimum(reaches, ALONE * reaches[len(reaches) // 2])
    shares = np.cumsum(reaches**2)
    return float(reaches[np.searchsorted(shares, COVERED * shares[-1])])


def bare_share(cloud: Cloud, mesh: Mesh, voxel: float) -> float:
    """Return the share of a cloud's points that are farther than `BARE` voxels from the vertices of a mesh."""
    some = cloud.points[:: max(1, len(cloud.points) // TOGETHER)]
    if mesh.is_empty or not len(some):
        return float(len(some) > 0)
    return float(np.isinf(cKDTree(mesh.vertices).query(some, distance_upper_bound=BARE * voxel)[0]).mean())


def _planes(
    tree: Any, points: Points, some: Float64[np.ndarray, "S 3"]
) -> tuple[Float64[np.ndarray, "S 3"], Float64[np.ndarray, "S 3 3"]]:
    """Return the squared extents, ascending, of the points of a tree around some, and their axes, in columns."""
    near = points[tree.query(some, k=AROUND)[1]]
    away = near - near.mean(axis=1, keepdims=True)
    return _core.eigen(np.einsum("nki,nkj->nij", away, away))


def normals_of(points: Points, size: float, eye: Float64[np.ndarray, " 3"] | None = None) -> Float64[np.ndarray, "N 3"]:
    """Return the unit normals of surface through points, which point to the eye, where that is known.

    Otherwise those of a body point outside, and those of a room into it. `size` (m) is that of cells that agree on a
    side, in which there are some points. Normals of too few points are 0.
    """
    if len(points) <= AROUND:
        return np.zeros((len(points), 3))
    tree, starts = cKDTree(points), range(0, len(points), TOGETHER)
    normals = np.concatenate([_planes(tree, points, points[k : k + TOGETHER])[1][:, :, 0] for k in starts])
    keys, cell = np.unique(_lattice(points, size).keys(points), return_inverse=True)
    cell = cell.reshape(-1)
    outer = (normals[:, :, None] * normals[:, None]).reshape(-1, 9)
    squares = np.stack([np.bincount(cell, column, len(keys)) for column in outer.T], axis=1)
    axes = np.ascontiguousarray(_core.eigen(squares.reshape(-1, 3, 3))[1][:, :, 2])
    middles = np.stack([np.bincount(cell, column) for column in points.T], axis=1) / np.bincount(cell)[:, None]
    links = _links(keys)
    axes *= _agreed(links, middles, axes)[:, None]
    piece = linked(links, len(keys))
    axes *= _outward(middles, axes, piece, eye)[piece][:, None]
    return np.where((normals * axes[cell]).sum(axis=1, keepdims=True) < 0, -normals, normals)


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
    ways, turns = middles[ends] - middles, (axes * axes[ends]).sum(axis=1)
    # At an edge, both sides lie before each other's planes, or both behind: in a corner of a room, on a crate.
    at_edge = -(axes * ways).sum(axis=1) * (axes[ends] * ways).sum(axis=1)
    same = (np.where(np.abs(turns) < SHARP, at_edge, turns) >= 0).tolist()
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
