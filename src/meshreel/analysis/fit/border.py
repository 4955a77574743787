"""Samples along the open borders of a mesh, to which a fit pulls the template's borders.

In: a mesh. Out: Border. Point-to-plane rows leave the position across a border free: without these samples, a template
that is too small or too large at a rim (soles cut off at the floor, sleeves, the edge of a camera's view) stays so, and
those few vertices carry most of the error: 3.5 dB on a captured dancer.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int32, Int64

from ...geometry.topology import border_mask, face_normals, unique_edges
from ...types import Mesh

SAMPLES = 8  # per border edge: a guess; sliding along the border is free, so a finer search gains nothing


@dataclass(frozen=True, slots=True)
class Border:
    """Points along the open borders of a mesh, each with its local frame."""

    points: Float64[np.ndarray, "N 3"]
    normals: Float64[np.ndarray, "N 3"]  # of the face
    outward: Float64[np.ndarray, "N 3"]  # in the face's plane, away from the surface


def border_sides(faces: Int32[np.ndarray, "F 3"]) -> tuple[Int64[np.ndarray, " E"], Int64[np.ndarray, " E"]]:
    """Find the half-edges that no second face shares: the face of each, and the corner where it starts."""
    edges, of_faces = unique_edges(faces)
    face_numbers, sides = np.nonzero(border_mask(edges, of_faces)[of_faces])
    return face_numbers, sides


def sample_border(mesh: Mesh) -> Border:
    """Place `SAMPLES` evenly spaced points on each border edge, in order."""
    faces, sides = border_sides(mesh.faces)
    ends = mesh.vertices[mesh.faces[faces]]
    pick = np.arange(len(faces))
    start, end = ends[pick, sides], ends[pick, (sides + 1) % 3]
    along = end - start
    along /= np.maximum(np.linalg.norm(along, axis=1), 1e-300)[:, None]
    normals = face_normals(Mesh(mesh.vertices, mesh.faces[faces]))[0]
    outward = np.cross(along, normals)  # counter-clockwise faces lie to the left of their edges
    share = (np.arange(SAMPLES) + 0.5) / SAMPLES
    points = start[:, None] + share[:, None] * (end - start)[:, None]
    return Border(points.reshape(-1, 3), normals.repeat(SAMPLES, axis=0), outward.repeat(SAMPLES, axis=0))
