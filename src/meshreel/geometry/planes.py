"""Closes holes in flat surface: a hole whose surroundings lie on one plane is filled, at their vertex spacing.

In: a mesh, its noise, and what is known to be open. Out: the mesh with flat faces, which are guesses: nobody saw them.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np
from jaxtyping import Bool, Float64, Int64
from scipy.spatial import Delaunay, cKDTree

from ..types import Mesh
from .closest_points import Surface
from .reconstruct import Points, border_loops
from .strict import eigen, norm, products
from .topology import edge_lengths, face_means, face_normals, part_of, with_neighbours

RINGS = 8  # of faces around a hole that tell its plane (guess)
ROUNDS = 5  # of fitting a plane to those of them that lie on it (guess)
OFF = 3.0  # times the noise, largest distance of a face from its plane (guess)
ALIKE = 0.9  # least cosine between the normals of a face and of its plane (guess)
FEW, MOSTLY = 0.05, 0.5  # least share of the surroundings on the plane, at first, and in the end (guess)
OPEN = 0.05  # least share of a hole's area that is known to be open where the hole is an opening (guess)
EXACT = 1e-9  # share of a hole's area by which that of its triangles may differ: rounding
APART = 0.6  # spacings, least distance of a new vertex from those of the border (guess)
_ROW = 0.75**0.5  # of a spacing, between rows of equilateral triangles
_SKEW = np.array([[1.0, 0.0], [0.03, 1.01]])  # of places: no four are on a circle, so the triangles are unique

Places = Float64[np.ndarray, "_ 2"]  # on a plane
Noise = Callable[[Points], Float64[np.ndarray, " N"]]  # RMS of the surface at points
IsOpen = Callable[[Points, Points], Bool[np.ndarray, " N"]]  # of the places of a hole, with normals


def close_planes(mesh: Mesh, noise: Noise, is_open: IsOpen) -> Mesh:
    """Close holes in planes; new faces follow the mesh's own, and new vertices its vertices.

    A plane is one within the noise of its surface. Its outer border, where it ends, is no hole; a hole whose rim
    crosses itself stays open. What lies inside a hole, as the floor between two feet, is not covered.
    """
    vertices, faces, lengths = [mesh.vertices], [mesh.faces], edge_lengths(mesh)
    usual = float(np.median(lengths)) if lengths.size else 0.0
    surface = cache(lambda: Surface(mesh))
    for loop in border_loops(mesh):
        around = mesh.vertices[loop] - mesh.vertices[loop[0]]  # far from the origin, products would be coarse
        if norm(np.cross(around, np.roll(around, -1, axis=0)).sum(axis=0)) < usual**2:  # twice its area, at least
            continue
        if (plane := _plane(mesh, loop, noise)) is None:
            continue
        middle, axes, spacing = plane
        rim = products(mesh.vertices[loop] - middle, axes[:2].T)
        following = np.roll(rim, -1, axis=0)
        if (rim[:, 1] * following[:, 0] - rim[:, 0] * following[:, 1]).sum() < spacing**2:  # of a hole, twice its area
            continue
        inner, corners = _triangles(rim, spacing)
        if not len(corners):
            continue
        patch = Mesh.of(np.concatenate([mesh.vertices[loop], middle + products(inner, axes[:2])]), corners)
        middles = face_means(patch.vertices, patch.faces)
        hits = surface().closest(middles)
        near = np.linalg.norm(hits.points - middles, axis=1) <= OFF * noise(hits.points)
        patch = patch.with_faces(~near | surface().past_border(hits))
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
    most, level, spacing = OFF * noise(places), areas > 0, float(np.median(edge_lengths(around)))
    if not level.any() or spacing == 0:
        return None
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
    return middle + offset * normal, axes, spacing


def _triangles(rim: Places, spacing: float) -> tuple[Places, Int64[np.ndarray, "F 3"]]:
    """Return places inside a rim, and counterclockwise triangles; their corners are those of the rim, then these.

    There are no triangles where none fill the rim, as it crosses itself.
    """
    low, high = rim.min(axis=0), rim.max(axis=0)
    rows, columns = (np.arange(low[k], high[k], step * spacing) for k, step in ((1, _ROW), (0, 1.0)))
    shift = np.arange(len(rows)) % 2 * (spacing / 2)
    grid = np.stack(np.broadcast_arrays(columns + shift[:, None], rows[:, None]), axis=-1).reshape(-1, 2)
    grid = grid[_inside(grid, rim)]
    inner = grid[cKDTree(rim).query(grid)[0] > APART * spacing]
    places = np.concatenate([rim, inner])
    corners = _with_rim(places, Delaunay(products(places, _SKEW)).simplices.astype(np.int64), len(rim))
    corners = corners[_inside(places[corners].mean(axis=1), rim)]
    following = np.roll(rim, -1, axis=0)
    wanted = (rim[:, 0] * following[:, 1] - rim[:, 1] * following[:, 0]).sum()  # twice the area
    areas = _turns(*places[corners.T])
    if not len(corners) or areas.min() <= 0 or abs(areas.sum() - abs(wanted)) > EXACT * abs(wanted):
        return inner[:0], corners[:0]
    first = corners.argmin(axis=1)[:, None]
    corners = np.take_along_axis(corners, (first + np.arange(3)) % 3, axis=1)
    return inner, corners[np.lexsort(corners.T[::-1])]


def _with_rim(places: Places, corners: Int64[np.ndarray, "F 3"], count: int) -> Int64[np.ndarray, "F 3"]:
    """Return triangles with the edges of the rim, the first `count` places, where flips of edges make these.

    An edge that crosses one of the rim is flipped, where the triangles beside it make a convex shape (Sloan 1993).
    """
    corners = np.where((_turns(*places[corners.T]) < 0)[:, None], corners[:, ::-1], corners)
    for a, b in zip(range(count), [*range(1, count), 0], strict=True):
        for _ in range(len(corners)):
            sides = corners[:, [[0, 1, 2], [1, 2, 0], [2, 0, 1]]].reshape(-1, 3)  # an edge, and the corner opposite
            if ((sides[:, :2] == (a, b)) | (sides[:, :2] == (b, a))).all(axis=1).any():
                break
            crossing = np.flatnonzero(_cross(places, a, b, sides[:, 0], sides[:, 1]) & (sides[:, 0] < sides[:, 1]))
            opposite = {(c, d): e for c, d, e in sides.tolist()}
            pairs = [(c, d, e, opposite[d, c]) for c, d, e in sides[crossing].tolist() if (d, c) in opposite]
            convex = [each for each in pairs if _cross(places, *each[2:], *np.array(each[:2])[:, None])[0]]
            if not convex:
                break
            # First what does not cross the rim afterwards: the others would go back and forth.
            c, d, e, f = min(convex, key=lambda each: (_cross(places, a, b, *np.array(each[2:])[:, None])[0], each))
            beside = np.isin(corners, (c, d)).sum(axis=1) + np.isin(corners, (e, f)).any(axis=1) == 3
            corners = np.concatenate([corners[~beside], [[c, f, e], [f, d, e]]])
    return corners


def _turns(a: Places, b: Places, c: Places) -> Float64[np.ndarray, " N"]:
    """Return twice the areas of triangles, negative for clockwise ones."""
    (ux, uy), (vx, vy) = (b - a).T, (c - a).T
    return ux * vy - uy * vx


def _cross(
    places: Places, a: int, b: int, c: Int64[np.ndarray, " N"], d: Int64[np.ndarray, " N"]
) -> Bool[np.ndarray, " N"]:
    """Return whether the line from one place to another crosses the lines from some to others, between their ends."""
    start, end = (np.broadcast_to(places[each], (len(c), 2)) for each in (a, b))
    first, second = places[c], places[d]
    apart = _turns(start, end, first) * _turns(start, end, second) < 0
    return apart & (_turns(first, second, start) * _turns(first, second, end) < 0)


def _inside(places: Places, rim: Places) -> Bool[np.ndarray, " N"]:
    """Return the places inside a closed line: a ray from them to the right crosses it an odd number of times."""
    following, (x, y) = np.roll(rim, -1, axis=0), places.T[..., None]
    crosses = (rim[:, 1] > y) != (following[:, 1] > y)
    steps = following - rim
    at = rim[:, 0] + (y - rim[:, 1]) * steps[:, 0] / np.where(steps[:, 1] == 0, 1.0, steps[:, 1])
    return (crosses & (x < at)).sum(axis=1) % 2 == 1
