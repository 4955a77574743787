"""Match a template and a frame's surface by closest points, both ways, as point-to-plane rows.

In: template positions, a prepared frame. Out: Rows. A pair is weighted by a Gaussian of its distance; its weight is 0
past the gate, where normals disagree, and where the closest point lies on an open border, past which nothing is known.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from ...geometry.closest_points import Hits, Surface
from ...geometry.strict import exp
from ...geometry.topology import border_edges, face_normals, vertex_normals
from ...types import Mesh
from .border import border_sides, match_borders, sample_border
from .rows import Rows
from .system import Template

ON_BORDER = 1e-6  # points of a surface with an interpolated `inside` up to this lie on an open border: rounding


@dataclass(frozen=True, slots=True)
class MatchOptions:
    """Conditions for a pair of closest points to count."""

    gate: float  # largest distance of a pair, in bounding-box diagonals; half of it is the Gaussian's sigma
    agreement: float  # smallest cosine between the normals of a pair


class FrameSurface:
    """A frame prepared for matching: search structure, vertex normals, border samples, and 0 for border vertices."""

    def __init__(self, mesh: Mesh) -> None:
        self.mesh = mesh
        self.surface = Surface(mesh)
        self.normals = vertex_normals(mesh)
        self.inside = _inside(mesh)
        self.border = sample_border(mesh, border_sides(mesh.faces))

    def normals_at(self, hits: Hits) -> Float64[np.ndarray, "N 3"]:
        """Interpolate the vertex normals at points of the surface; unit vectors."""
        return interpolated(self.normals, self.mesh.faces, hits)


def match(
    template: Template, positions: Float64[np.ndarray, "V 3"], frame: FrameSurface, options: MatchOptions
) -> Rows:
    """Return the rows that pull the template at `positions` to the frame."""
    mesh = Mesh(positions, template.faces.astype(np.int32))
    forward = _from_frame(mesh, frame, options)
    backward = _from_template(template, mesh, frame, options)
    border = match_borders(
        sample_border(mesh, border_sides(mesh.faces)), frame.border, 2 * options.gate, options.agreement
    )
    return forward + backward + border


def _from_frame(mesh: Mesh, frame: FrameSurface, options: MatchOptions) -> Rows:
    surface = Surface(mesh)
    points = frame.mesh.vertices
    hits = surface.closest(points)
    inside = interpolated_scalar(_inside(mesh), mesh.faces, hits)
    normals = frame.normals
    weights = _pair_weights(points - hits.points, normals, surface.normals[hits.faces], options) * inside * frame.inside
    weights *= len(mesh.vertices) / max(len(points), 1)  # makes the pull independent of the frame's density
    keep = np.flatnonzero(weights > 0)
    values = np.einsum("nd,nd->n", normals[keep], points[keep])
    return Rows(hits.faces[keep], hits.barycentric[keep], normals[keep], values, weights[keep])


def _from_template(template: Template, mesh: Mesh, frame: FrameSurface, options: MatchOptions) -> Rows:
    used = np.flatnonzero(template.corner >= 0)
    points, own = mesh.vertices[used], vertex_normals(mesh)[used]
    faces, corners = template.corner[used] // 3, np.eye(3)[template.corner[used] % 3]
    points = np.concatenate([points, mesh.vertices[mesh.faces].mean(axis=1)])
    faces = np.concatenate([faces, np.arange(len(mesh.faces))])
    corners = np.concatenate([corners, np.full((len(mesh.faces), 3), 1 / 3)])
    own = np.concatenate([own, face_normals(mesh)[0]])
    hits = frame.surface.closest(points)
    normals = frame.normals_at(hits)
    weights = _pair_weights(points - hits.points, normals, own, options)
    weights *= interpolated_scalar(frame.inside, frame.mesh.faces, hits)
    values = np.einsum("nd,nd->n", normals, hits.points)
    scale = np.where(np.arange(len(points)) < len(used), 1.0, 0.5)  # there are two faces per vertex
    return Rows(faces, corners, normals, values, weights * scale)


def _pair_weights(
    gaps: Float64[np.ndarray, "N 3"],
    normals: Float64[np.ndarray, "N 3"],
    others: Float64[np.ndarray, "N 3"],
    options: MatchOptions,
) -> Float64[np.ndarray, " N"]:
    distance = np.linalg.norm(gaps, axis=1) / options.gate
    agree = np.einsum("nd,nd->n", normals, others) > options.agreement
    return np.where(agree & (distance < 1), exp(-2 * distance**2), 0.0)  # sigma = half the gate


def interpolated(values: Float64[np.ndarray, "V 3"], faces: np.ndarray, hits: Hits) -> Float64[np.ndarray, "N 3"]:
    """Interpolate unit vectors of a mesh's vertices at points of its surface; zero where they cancel."""
    n = np.einsum("nk,nkd->nd", hits.barycentric, values[faces[hits.faces]])
    length = np.linalg.norm(n, axis=1)
    return n / np.where(length > 0, length, 1.0)[:, None]


def interpolated_scalar(values: Float64[np.ndarray, " V"], faces: np.ndarray, hits: Hits) -> Float64[np.ndarray, " N"]:
    """Interpolate numbers of a mesh's vertices at points of its surface."""
    return np.einsum("nk,nk->n", hits.barycentric, values[faces[hits.faces]])


def _inside(mesh: Mesh) -> Float64[np.ndarray, " V"]:
    inside = np.ones(len(mesh.vertices))
    inside[border_edges(mesh).reshape(-1)] = 0.0
    return inside
