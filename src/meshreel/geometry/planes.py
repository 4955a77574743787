"""Planes that go on: a hole whose surroundings lie on one plane is closed on it, at about the spacing of these.

In: a mesh, its noise, and what is known to be open. Out: the mesh with flat faces, which are guesses: nobody saw them.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from jaxtyping import Bool, Float64, Int64
from scipy.spatial import Delaunay, cKDTree

from ..types import Mesh
from .reconstruct import Points, border_loops
from .strict import eigen, products
from .topology import edge_lengths, face_means, face_normals, part_of, with_neighbours

RINGS = 8  # of faces around a hole that tell its plane (guess)
ROUNDS = 5  # of fitting a plane to those of them that lie on it (guess)
OFF = 3.0  # times the noise, largest distance of a face from its plane (guess)
ALIKE = 0.9  # least cosine between the normals of a face and of its plane (guess)
FEW, MOSTLY = 0.05, 0.5  # least share of the surroundings on the plane, at first, and in the end (guess)
OPEN = 0.05  # least share of a hole's area that is known to be open where the hole is an opening (guess)
APART = 0.6  # spacings, least distance of a new vertex from those of the border (guess)
_ROW = 0.75**0.5  # of a spacing, between rows of equilateral triangles
_SKEW = np.array([[1.0, 0.0], [0.03, 1.01]])  # of places: no four are on a circle, so the triangles are unique

Places = Float64[np.ndarray, "_ 2"]  # on a plane
Noise = Callable[[Points], Float64[np.ndarray, " N"]]  # RMS of the surface at points
IsOpen = Callable[[Points, Points], Bool[np.ndarray, " N"]]  # of the places of a hole, with normals


def close_planes(mesh: Mesh, noise: Noise, is_open: IsOpen) -> Mesh:
    """Close holes in planes; new faces follow the mesh's own, and new vertices its vertices.

    A plane is one within the noise of its surface. Its outer border, where it ends, is no hole.
    """
    vertices, faces = [mesh.vertices], [mesh.faces]
    for loop in border_loops(mesh):
        if (found := _plane(mesh, loop, noise)) is None:
            continue
        middle, axes, spacing = found
        rim = products(mesh.vertices[loop] - middle, axes[:2].T)
        following = np.roll(rim, -1, axis=0)
        if (rim[:, 1] * following[:, 0] - rim[:, 0] * following[:, 1]).sum() < spacing**2:  # of a hole, twice its area
            continue
        inner, corners = _triangles(rim, spacing)
        patch = Mesh.of(np.concatenate([mesh.vertices[loop], middle + products(inner, axes[:2])]), corners)
        (normals, areas), middles = face_normals(patch), face_means(patch.vertices, patch.faces)
        if areas[is_open(middles, normals)].sum() >= OPEN * areas.sum():
            continue
        count = sum(map(len, vertices))
        numbers = np.concatenate([loop, np.arange(count, count + len(inner))])
        vertices.append(patch.vertices[len(loop) :])
        faces.append(numbers[patch.faces].astype(np.int32))
    return Mesh.of(np.concatenate(vertices), np.concatenate(faces))


def _plane(mesh: Mesh, loop: Int64[np.ndarray, " n"], noise: Noise) -> tuple[np.ndarray, np.ndarray, float] | None:
    """Return the middle and the axes, the normal last, of the plane around a loop, and its spacing; None for none."""
    touched = np.zeros(len(mesh.vertices), bool)
    touched[loop] = True
    chosen = touched[mesh.faces].any(axis=1)
    for _ in range(RINGS - 1):
        chosen = with_neighbours(mesh.faces, chosen)
    around = part_of(mesh, chosen)
    (normals, areas), places = face_normals(around), face_means(around.vertices, around.faces)
    most, level = OFF * noise(places), areas > 0
    for _ in range(ROUNDS):
        weights = areas * level
        middle = (weights[:, None] * places).sum(axis=0) / weights.sum()
        away = places - middle
        _, vectors = eigen(np.einsum("n,ni,nj->ij", weights, away, away))
        normal = vectors[:, 0] * np.sign((weights[:, None] * normals * vectors[:, 0]).sum())
        heights = (away * normal).sum(axis=1)
        offset = np.median(heights[level])
        level = (np.abs(heights - offset) <= most) & ((normals * normal).sum(axis=1) >= ALIKE) & (areas > 0)
        if areas[level].sum() < FEW * areas.sum():
            return None
    if areas[level].sum() < MOSTLY * areas.sum():
        return None
    axes = np.stack([vectors[:, 1], np.cross(normal, vectors[:, 1]), normal])
    return middle + offset * normal, axes, float(np.median(edge_lengths(around)))


def _triangles(rim: Places, spacing: float) -> tuple[Places, Int64[np.ndarray, "F 3"]]:
    """Return places inside a rim, and counterclockwise triangles; their corners are those of the rim, then these."""
    low, high = rim.min(axis=0), rim.max(axis=0)
    rows, columns = (np.arange(low[k], high[k], step * spacing) for k, step in ((1, _ROW), (0, 1.0)))
    shift = np.arange(len(rows)) % 2 * (spacing / 2)
    grid = np.stack(np.broadcast_arrays(columns + shift[:, None], rows[:, None]), axis=-1).reshape(-1, 2)
    grid = grid[_inside(grid, rim)]
    inner = grid[cKDTree(rim).query(grid)[0] > APART * spacing]
    places = np.concatenate([rim, inner])
    corners = _with_rim(Delaunay(products(places, _SKEW)).simplices.astype(np.int64), len(rim))
    corners = corners[_inside(places[corners].mean(axis=1), rim)]
    first = corners.argmin(axis=1)[:, None]
    corners = np.take_along_axis(corners, (first + np.arange(3)) % 3, axis=1)
    return inner, corners[np.lexsort(corners.T[::-1])]


def _with_rim(corners: Int64[np.ndarray, "F 3"], count: int) -> Int64[np.ndarray, "F 3"]:
    """Return triangles with the edges of the rim, the first `count` places: an edge that crosses one is flipped."""
    edges = {*map(tuple, np.sort(corners[:, [[0, 1], [1, 2], [2, 0]]], axis=2).reshape(-1, 2).tolist())}
    rim = [(start, start + 1) for start in range(count - 1)] + [(0, count - 1)]
    for a, b in (edge for edge in rim if edge not in edges):
        sides = corners[:, [[0, 1, 2], [1, 2, 0], [2, 0, 1]]].reshape(-1, 3)  # an edge, and the corner opposite
        before, behind = sides[sides[:, 2] == a], sides[sides[:, 2] == b]
        crossing = (before[:, None, :2] == behind[None, :, 1::-1]).all(axis=2).any(axis=1)
        for c, d, _ in before[crossing]:
            gone = np.isin(corners, [c, d]).sum(axis=1) + np.isin(corners, [a, b]).any(axis=1) == 3
            corners = np.concatenate([corners[~gone], [[a, c, b], [b, d, a]]])
    return corners


def _inside(places: Places, rim: Places) -> Bool[np.ndarray, " N"]:
    """Return the places inside a closed line: a ray from them to the right crosses it an odd number of times."""
    following, (x, y) = np.roll(rim, -1, axis=0), places.T[..., None]
    crosses = (rim[:, 1] > y) != (following[:, 1] > y)
    steps = following - rim
    at = rim[:, 0] + (y - rim[:, 1]) * steps[:, 0] / np.where(steps[:, 1] == 0, 1.0, steps[:, 1])
    return (crosses & (x < at)).sum(axis=1) % 2 == 1
