"""Deformable marching cubes (NeCGS, section 3.1): the surface of a TSDF-Def volume.

A vertex is the zero of the distance on an edge between two grid points that the deformation has moved. On a face with
four crossings each inside corner is cut off alone, in both cubes of the face: the surface has no holes.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from typing import Any

import numpy as np
from jaxtyping import Float32, Float64, Int8, Int32, Int64, UInt8

from meshreel.geometry.topology import drop_unreferenced
from meshreel.types import Mesh

REACH = 0.5  # cells that a deformation of 1 moves a point, so that cells do not fold over
STEEP = 0.8  # change along an edge, of which a surface has half: a flip of sign far from any surface


@dataclass(frozen=True, slots=True)
class Cut:
    """Topology of the surface of grids of points; V vertices on edges of a grid."""

    low: Int64[np.ndarray, " V"]  # flat number of the edge's first point
    high: Int64[np.ndarray, " V"]  # of its second point, one further along an axis
    faces: Int32[np.ndarray, "F 3"]  # counter-clockwise from outside
    cells: Int64[np.ndarray, " F"]  # flat number of each face's cell


def extract(volume: Float32[np.ndarray, "K K K 4"], trimmed: bool) -> Mesh:
    """Return the mesh of a TSDF-Def volume, in cells; `trimmed` leaves out flips of sign far from any surface."""
    resolution, flat = len(volume), volume.reshape(-1, 4).astype(np.float64)
    found = cut(volume[None, ..., 0])
    vertices = place(flat[found.low], flat[found.high], *(grid_points(n, resolution) for n in (found.low, found.high)))
    faces = found.faces
    if trimmed:
        steep = np.abs(flat[found.low, 0] - flat[found.high, 0]) > STEEP
        faces = faces[~steep[faces].any(axis=1)]
    return drop_unreferenced(Mesh.of(vertices, faces))


def place(low: Any, high: Any, first: Any, second: Any) -> Any:
    """Return vertices on edges, cells, from V x 4 values and V x 3 places of both ends; NumPy arrays or tensors."""
    share = (low[:, 0] / (low[:, 0] - high[:, 0]))[:, None]
    return (1 - share) * (first + REACH * low[:, 1:]) + share * (second + REACH * high[:, 1:])


def grid_points(numbers: Int64[np.ndarray, " N"], resolution: int) -> Float64[np.ndarray, "N 3"]:
    """Return the places of grid points with given flat numbers, cells."""
    return np.stack(np.unravel_index(numbers, (resolution,) * 3), axis=1).astype(np.float64)


def cut(values: np.ndarray, voxels: Int32[np.ndarray, "B P P P"] | None = None) -> Cut:
    """Return the edges where the sign changes in B blocks of P x P x P points, and the faces between these.

    `voxels` are the points' numbers, one for all blocks that share a point; without, none is shared.
    """
    side, cases = values.shape[1], cases_of(values)
    strides = np.array([side**2, side, 1])
    cells = np.flatnonzero(cases - np.uint8(1) < 254)  # 0 and 255 are not cut
    edges = triangles_of_cases()[cases[cells]]
    used = edges[..., 0] >= 0
    cells, edges = np.repeat(cells, used.sum(axis=1)), edges[used]
    block, cell = np.divmod(cells, (side - 1) ** 3)
    x, y, z = np.unravel_index(cell, (side - 1,) * 3)
    corners = (side**3 * block + side**2 * x + side * y + z).astype(np.int32)
    starts, axes = ((np.array(EDGES) @ way).astype(np.int32) for way in ([1, 0], [0, 1]))
    lows = corners[:, None] + (np.array(CORNERS) @ strides).astype(np.int32)[starts][edges]
    keys = 3 * (lows if voxels is None else voxels.reshape(-1)[lows]) + axes[edges]
    found = np.full(3 * (values.size if voxels is None else int(voxels.max(initial=-1)) + 1), -1, np.int32)
    found[keys] = lows
    made = np.flatnonzero(found >= 0)
    low = found[made].astype(np.int64)
    found[made] = np.arange(len(made), dtype=np.int32)
    return Cut(low, low + strides[made % 3], found[keys], cells)


def cases_of(values: np.ndarray) -> UInt8[np.ndarray, " C"]:
    """Return which corners of each cell of B x P x P x P points are inside, a bit for each as in `CORNERS`."""
    inside = (values < 0).view(np.uint8)
    pairs = inside[:, :-1] | inside[:, 1:] << np.uint8(1)
    fours = pairs[:, :, :-1] | pairs[:, :, 1:] << np.uint8(2)
    return (fours[..., :-1] | fours[..., 1:] << np.uint8(4)).reshape(-1)


CORNERS = [(n & 1, n >> 1 & 1, n >> 2) for n in range(8)]
EDGES = [(n, axis) for axis in range(3) for n in range(8) if not n >> axis & 1]  # first corner, axis


@cache
def triangles_of_cases() -> Int8[np.ndarray, "N T 3"]:
    """Return the triangles of each case (bit n: corner n is inside) as numbers of `EDGES`, filled up with -1."""
    cases = [_triangles(case) for case in range(256)]
    table = np.full((256, max(map(len, cases)), 3), -1, np.int8)
    for case, triangles in enumerate(cases):
        table[case, : len(triangles)] = np.reshape(triangles, (-1, 3))
    return table


def _triangles(case: int) -> list[tuple[int, int, int]]:
    """Return the loops of the surface on the cube's faces, each as a fan; bit n of `case`: corner n is inside."""
    following = dict(step for side in _sides() for step in _steps(side, case))
    triangles = []
    while following:
        loop = [min(following)]
        while (edge := following.pop(loop[-1])) != loop[0]:
            loop.append(edge)
        triangles += [(loop[0], a, b) for a, b in pairwise(loop[1:])]
    return triangles


def _sides() -> list[list[int]]:
    """Return the corners of the six faces, counter-clockwise from outside."""
    sides = []
    for axis in range(3):
        b, c = 1 << (axis + 1) % 3, 1 << (axis + 2) % 3
        ring = [0, b, b | c, c]
        sides += [ring[::-1], [corner | 1 << axis for corner in ring]]
    return sides


def _steps(side: list[int], case: int) -> list[tuple[int, int]]:
    """Return the first and the last edge of each run of inside corners around a face."""
    crossed = []
    for a, b in zip(side, side[1:] + side[:1], strict=True):
        if (case >> a ^ case >> b) & 1:
            crossed.append((EDGES.index((min(a, b), (a ^ b).bit_length() - 1)), bool(case >> b & 1)))
    if crossed and not crossed[0][1]:
        crossed = crossed[1:] + crossed[:1]
    return [(crossed[n][0], crossed[n + 1][0]) for n in range(0, len(crossed), 2)]
