"""Samples of surfaces, and the angles between normals.

Samples of a mesh are its vertices, in order, followed by a quadrature of its area, so that one round of queries serves
both the vertex-based metrics and the area-weighted ones. Normals are area-weighted vertex normals, interpolated with
barycentric weights; vertices at equal positions (UV seams) share one.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Bool, Float64, Int32, Int64

from ..geometry.closest_points import Surface
from ..geometry.strict import angle
from ..geometry.topology import blend, drop_unreferenced, face_means, face_normals, subdivide_midpoint, vertex_normals
from ..types import Mesh

Points = Float64[np.ndarray, "N 3"]
RESOLUTION = 2.0**-22  # of the diagonal; below it a distance is rounding of the float32 queries and counts as 0
_ENOUGH_FACES = 12_000  # a coarser mesh is subdivided before it is sampled (guess)
_MOST_LEVELS = 6  # of that subdivision (guess)
WORST_ANGLE = 180.0  # degrees; the error where one of the two meshes is empty
_R2 = np.array([0.7548776662466927, 0.5698402909980532])  # 1 / g and 1 / g^2, where g^3 = g + 1


@dataclass(frozen=True)
class Samples:
    """Points on one mesh, weights that integrate over its area (they sum to 1), and the mesh's normals."""

    mesh: Mesh  # centered, without zero-area faces and unreferenced vertices
    vertex_normals: Float64[np.ndarray, "V 3"]
    points: Points  # the V vertices of the mesh first
    normals: Points  # interpolated at the points
    weights: Float64[np.ndarray, " N"]

    @cached_property
    def surface(self) -> Surface:
        return Surface(self.mesh)


def sample(mesh: Mesh, center: Float64[np.ndarray, " 3"]) -> Samples:
    """Move a result of `used_surface` so that `center` is the origin, and sample it."""
    mesh = Mesh.of(mesh.vertices - center, mesh.faces)
    normals = welded_normals(mesh)
    levels = 0
    while len(mesh.faces) * 4**levels < _ENOUGH_FACES and levels < _MOST_LEVELS:
        levels += 1
    fine = subdivide_midpoint(mesh, levels)  # the same surface; old vertices stay first
    fine_normals = subdivide_midpoint(Mesh.of(normals, mesh.faces), levels).vertices
    areas = face_normals(fine)[1]
    # 1/12 for each corner and 3/4 for the centroid integrate quadratics over a triangle exactly
    shares = np.bincount(fine.faces.reshape(-1), np.repeat(areas / 12, 3), len(fine.vertices))
    weights = np.concatenate([shares, areas * 0.75])
    points = np.concatenate([fine.vertices, face_means(fine.vertices, fine.faces)])
    directions = np.concatenate([fine_normals, face_means(fine_normals, fine.faces)])
    return Samples(mesh, normals, points, unit(directions), weights / weights.sum())


def used_surface(mesh: Mesh) -> Mesh:
    """Remove zero-area faces and vertices that no face uses; the result may be empty."""
    return drop_unreferenced(Mesh.of(mesh.vertices, mesh.faces[face_normals(mesh)[1] > 0]))


def welded_normals(mesh: Mesh) -> Float64[np.ndarray, "V 3"]:
    """Return unit normals of the vertices of `mesh`, in order; vertices at exactly equal positions share one."""
    order = np.lexsort(mesh.vertices.T)
    ordered = mesh.vertices[order]
    new = np.ones(len(order), dtype=bool)
    new[1:] = (ordered[1:] != ordered[:-1]).any(axis=1)
    if new.all():
        return vertex_normals(mesh)
    representative = np.empty(len(order), dtype=np.int64)  # of each vertex: one at its position
    representative[order] = order[np.flatnonzero(new)[np.cumsum(new) - 1]]
    return vertex_normals(Mesh.of(mesh.vertices, representative[mesh.faces]))[representative]


def interpolate(normals: Float64[np.ndarray, "V 3"], corners: Int32[np.ndarray, "N 3"], weights: Points) -> Points:
    """Interpolate unit normals inside faces given by their corners; zero where the corners' normals cancel."""
    return unit(blend(normals, corners, weights))


def unit(vectors: Points) -> Points:
    """Scale vectors to length 1; zero stays zero."""
    length = np.sqrt(np.einsum("nd,nd->n", vectors, vectors))
    return vectors / np.where(length > 0, length, 1.0)[:, None]


def angles(a: Points, b: Points) -> Float64[np.ndarray, " N"]:
    """Return angles in degrees between unit vectors, 0 to 180; exact for small angles, unlike an arc cosine.

    The angle is 180 where either vector is zero: a surface without a normal matches none that has one.
    """
    differences = np.linalg.norm(a - b, axis=1)
    sums = np.linalg.norm(a + b, axis=1)
    undefined = (~a.any(axis=1)) | (~b.any(axis=1))
    return np.where(undefined, WORST_ANGLE, np.degrees(2 * angle(differences, sums)))


@dataclass(frozen=True, slots=True)
class Scatter:
    """N points on a mesh, with their faces and barycentric weights."""

    points: Points  # in the mesh's unit
    faces: Int64[np.ndarray, " N"]
    barycentric: Points  # weights of the face's three vertices
    area: float  # of the chosen faces, in the mesh's unit, squared

    def __len__(self) -> int:
        return len(self.points)

    def only(self, kept: Bool[np.ndarray, " N"]) -> Scatter:
        share = float(kept.mean()) if len(kept) else 0.0
        return Scatter(self.points[kept], self.faces[kept], self.barycentric[kept], self.area * share)


def scatter(mesh: Mesh, chosen: Bool[np.ndarray, " F"], count: int) -> Scatter:
    """Spread `count` points over the chosen faces; none if these have no area."""
    which = np.flatnonzero(chosen)
    ends = np.cumsum(face_normals(mesh)[1][which])
    area = float(ends[-1]) if len(ends) else 0.0
    if area <= 0:
        return Scatter(np.zeros((0, 3)), np.zeros(0, np.int64), np.zeros((0, 3)), 0.0)
    steps = np.arange(count)
    at = np.searchsorted(ends, (steps + 0.5) * (area / count), side="right")
    faces = which[np.minimum(at, len(which) - 1)]
    square = (0.5 + _R2 * (steps[:, None] + 1)) % 1
    folded = np.where(square.sum(axis=1, keepdims=True) > 1, 1 - square, square)  # the square onto a triangle
    weights = np.column_stack([1 - folded.sum(axis=1), folded])
    return Scatter(blend(mesh.vertices, mesh.faces[faces], weights), faces, weights, area)
