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
from jaxtyping import Float32, Float64, Int8, Int32, Int64

from meshreel.geometry.topology import drop_unreferenced
from meshreel.types import Mesh

REACH = 0.5  # cells that a deformation of 1 moves a point, so that cells do not fold over
STEEP = 0.8  # change along an edge, of which a surface has half: a flip of sign far from any surface


@dataclass(frozen=True, slots=True)
class Cut:
    """Topology of the surface of a grid of K x K x K points; V vertices on edges of the grid."""

    low: Int64[np.ndarray, " V"]  # flat number of the edge's first point
    high: Int64[np.ndarray, " V"]  # of its second point, one further along an axis
    faces: Int32[np.ndarray, "F 3"]  # counter-clockwise from outside


def extract(volume: Float32[np.ndarray, "K K K 4"], trimmed: bool) -> Mesh:
    """Return the mesh of a TSDF-Def volume, in cells; `trimmed` leaves out flips of sign far from any surface."""
    resolution, flat = len(volume), volume.reshape(-1, 4).astype(np.float64)
    found = cut(volume[..., 0])
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


def cut(distances: Float32[np.ndarray, "K K K"]) -> Cut:
    """Return the edges where the sign changes, and the faces between these."""
    resolution = len(distances)
    inside = (distances < 0).astype(np.uint8)
    ends = (slice(None, -1), slice(1, None))
    cases = np.zeros((resolution - 1,) * 3, np.uint8)
    for corner, (i, j, k) in enumerate(CORNERS):
        cases |= inside[ends[i], ends[j], ends[k]] << np.uint8(corner)
    cells = np.flatnonzero((cases > 0) & (cases < 255))
    strides = np.array([resolution**2, resolution, 1])
    origins = np.stack(np.unravel_index(cells, cases.shape), axis=1) @ strides
    local = triangles_of_cases()[cases.reshape(-1)[cells]]
    used = local[..., 0] >= 0
    starts, axes = (np.array(EDGES) @ [1, 0])[local], (np.array(EDGES) @ [0, 1])[local]
    first = origins[:, None, None] + (np.array(CORNERS) @ strides)[starts]
    keys, faces = np.unique((first * 3 + axes)[used], return_inverse=True)
    low = keys // 3
    return Cut(low, low + strides[keys % 3], faces.reshape(-1, 3).astype(np.int32))


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
