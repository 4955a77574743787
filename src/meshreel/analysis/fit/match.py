"""Closest-point correspondences between a template and a frame's surface, both ways, as point-to-plane rows.

In: template positions, a prepared frame. Out: Rows. A pair counts by a Gaussian of its distance and not at all past the
gate, where the normals disagree, or where the closest point lies on an open border (nothing is known beyond it).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from ...geometry.closest_points import Hits, Surface
from ...geometry.topology import border_edges, face_normals, vertex_normals
from ...types import Mesh
from .border import border_sides, match_borders, sample_border
from .rows import Rows
from .system import Template

ON_BORDER = 1e-6  # interpolated `inside` up to which a point of a surface lies on an open border


@dataclass(frozen=True, slots=True)
class MatchOptions:
    """Which pairs of closest points count, and how much."""

    gate: float  # pairs farther apart count nothing; fraction of the bounding-box diagonal
    agreement: float  # least cosine between the normals of a pair


class Target:
    """A frame prepared for matching: its surface, vertex normals, and 1 where a vertex is not on a border."""

    def __init__(self, mesh: Mesh) -> None:
        self.mesh = mesh
        self.surface = Surface(mesh)
        self.normals = vertex_normals(mesh)
        self.inside = _inside(mesh)
        self.border = sample_border(mesh, border_sides(mesh.faces))

    def normals_at(self, hits: Hits) -> Float64[np.ndarray, "N 3"]:
        """Unit interpolated normals at points of the surface."""
        return interpolated(self.normals, self.mesh.faces, hits)


def match(template: Template, positions: Float64[np.ndarray, "V 3"], target: Target, options: MatchOptions) -> Rows:
    """The rows that pull the template at `positions` to the frame."""
    mesh = Mesh(positions, template.faces.astype(np.int32))
    forward = _from_target(mesh, target, options)
    backward = _from_template(template, mesh, target, options)
    border = match_borders(
        sample_border(mesh, border_sides(mesh.faces)), target.border, 2 * options.gate, options.agreement
    )
    return forward + backward + border


def _from_target(mesh: Mesh, target: Target, options: MatchOptions) -> Rows:
    surface = Surface(mesh)
    points = target.mesh.vertices
    hits = surface.closest(points)
    inside = interpolated_scalar(_inside(mesh), mesh.faces, hits)
    normals = target.normals
    weights = (
        _pair_weights(points - hits.points, normals, surface.normals[hits.faces], options) * inside * target.inside
    )
    weights *= len(mesh.vertices) / max(len(points), 1)  # the same pull however dense the frame is
    keep = np.flatnonzero(weights > 0)
    values = np.einsum("nd,nd->n", normals[keep], points[keep])
    return Rows(hits.faces[keep], hits.barycentric[keep], normals[keep], values, weights[keep])


def _from_template(template: Template, mesh: Mesh, target: Target, options: MatchOptions) -> Rows:
    used = np.flatnonzero(template.corner >= 0)
    points, own = mesh.vertices[used], vertex_normals(mesh)[used]
    faces, corners = template.corner[used] // 3, np.eye(3)[template.corner[used] % 3]
    points = np.concatenate([points, mesh.vertices[mesh.faces].mean(axis=1)])
    faces = np.concatenate([faces, np.arange(len(mesh.faces))])
    corners = np.concatenate([corners, np.full((len(mesh.faces), 3), 1 / 3)])
    own = np.concatenate([own, face_normals(mesh)[0]])
    hits = target.surface.closest(points)
    normals = target.normals_at(hits)
    weights = _pair_weights(points - hits.points, normals, own, options)
    weights *= interpolated_scalar(target.inside, target.mesh.faces, hits)
    values = np.einsum("nd,nd->n", normals, hits.points)
    scale = np.where(np.arange(len(points)) < len(used), 1.0, 0.5)  # two faces a vertex
    return Rows(faces, corners, normals, values, weights * scale)


def _pair_weights(
    gaps: Float64[np.ndarray, "N 3"],
    normals: Float64[np.ndarray, "N 3"],
    others: Float64[np.ndarray, "N 3"],
    options: MatchOptions,
) -> Float64[np.ndarray, " N"]:
    distance = np.linalg.norm(gaps, axis=1) / options.gate
    agree = np.einsum("nd,nd->n", normals, others) > options.agreement
    return np.where(agree & (distance < 1), np.exp(-2 * distance**2), 0.0)  # sigma = half the gate


def interpolated(values: Float64[np.ndarray, "V 3"], faces: np.ndarray, hits: Hits) -> Float64[np.ndarray, "N 3"]:
    """Unit vectors of a mesh's vertices at points of its surface; zero where they cancel."""
    n = np.einsum("nk,nkd->nd", hits.barycentric, values[faces[hits.faces]])
    length = np.linalg.norm(n, axis=1)
    return n / np.where(length > 0, length, 1.0)[:, None]


def interpolated_scalar(values: Float64[np.ndarray, " V"], faces: np.ndarray, hits: Hits) -> Float64[np.ndarray, " N"]:
    """Numbers of a mesh's vertices at points of its surface."""
    return np.einsum("nk,nk->n", hits.barycentric, values[faces[hits.faces]])


def _inside(mesh: Mesh) -> Float64[np.ndarray, " V"]:
    inside = np.ones(len(mesh.vertices))
    inside[border_edges(mesh).reshape(-1)] = 0.0
    return inside
