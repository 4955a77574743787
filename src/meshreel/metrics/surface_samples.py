"""Samples of two surfaces around the same origin, and the closest points of one surface to the samples of the other.

Two meshes -> Samples -> Matches. Samples of a mesh are its vertices, in order, followed by a quadrature of its area, so
that one round of queries serves both the vertex-based metrics and the area-weighted ones.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float64, Int32

from ..geometry.closest_points import Surface
from ..geometry.topology import drop_unreferenced, face_normals, subdivide_midpoint
from ..types import Mesh
from .normals import interpolate, unit, welded_normals

RESOLUTION = 2.0**-22  # of the diagonal; below it a distance is rounding of the float32 queries and counts as 0
_ENOUGH_FACES = 12_000  # a coarser mesh is subdivided before it is sampled (guess)
_MOST_LEVELS = 6  # of that subdivision (guess)


@dataclass(frozen=True)
class Samples:
    """Points on one mesh, weights that integrate over its area (they sum to 1), and the mesh's normals."""

    mesh: Mesh  # centered, without zero-area faces and unreferenced vertices
    vertex_normals: Float64[np.ndarray, "V 3"]
    points: Float64[np.ndarray, "N 3"]  # the V vertices of the mesh first
    normals: Float64[np.ndarray, "N 3"]  # interpolated at the points
    weights: Float64[np.ndarray, " N"]

    @cached_property
    def surface(self) -> Surface:
        return Surface(self.mesh)


@dataclass(frozen=True, slots=True)
class Matches:
    """Closest points of one mesh to the samples of the other."""

    distances: Float64[np.ndarray, " N"]  # m, to the closest point
    offsets: Float64[np.ndarray, "N 3"]  # m, from the sample to its closest point
    normals: Float64[np.ndarray, "N 3"]  # interpolated at the closest point


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
    points = np.concatenate([fine.vertices, _centroids(fine.vertices, fine.faces)])
    directions = np.concatenate([fine_normals, _centroids(fine_normals, fine.faces)])
    return Samples(mesh, normals, points, unit(directions), weights / weights.sum())


def match(source: Samples, target: Samples, resolution: float) -> Matches:
    """Find the closest points of the target to the source's samples; distances below `resolution` (m) become 0."""
    hits = target.surface.closest(source.points)
    offsets = hits.points - source.points
    distances = np.sqrt(np.einsum("nd,nd->n", offsets, offsets))
    noise = distances < resolution
    offsets[noise] = 0
    distances[noise] = 0
    corners = target.mesh.faces[hits.faces]
    return Matches(distances, offsets, interpolate(target.vertex_normals, corners, hits.barycentric))


def used_surface(mesh: Mesh) -> Mesh:
    """Remove zero-area faces and vertices that no face uses; the result may be empty."""
    areas = face_normals(mesh)[1]
    return drop_unreferenced(Mesh.of(mesh.vertices, mesh.faces[areas > 0]))


def _centroids(values: Float64[np.ndarray, "V 3"], faces: Int32[np.ndarray, "F 3"]) -> Float64[np.ndarray, "F 3"]:
    return (values[faces[:, 0]] + values[faces[:, 1]] + values[faces[:, 2]]) / 3
