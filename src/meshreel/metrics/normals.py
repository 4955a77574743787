"""Angles between surface normals, an error that distance PSNR does not show (57-63 dB can go with 11-17 degrees).

Normals are area-weighted vertex normals, interpolated with barycentric weights; vertices at equal positions (UV seams)
share one normal. Mesh -> normals; pairs of normals -> angles in degrees.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float64, Int32, Int64

from ..geometry.strict import angle
from ..geometry.topology import blend, vertex_normals
from ..types import Mesh

WORST_ANGLE = 180.0  # degrees; the error where one of the two meshes is empty


def welded_normals(mesh: Mesh) -> Float64[np.ndarray, "V 3"]:
    """Return unit normals of the vertices of `mesh`, in order; vertices at exactly equal positions share one."""
    if len(mesh.vertices) == 0:
        return np.zeros((0, 3))
    representative = _first_at_position(mesh.vertices)
    if representative is None:
        return vertex_normals(mesh)
    return vertex_normals(Mesh.of(mesh.vertices, representative[mesh.faces]))[representative]


def interpolate(
    normals: Float64[np.ndarray, "V 3"], corners: Int32[np.ndarray, "N 3"], weights: Float64[np.ndarray, "N 3"]
) -> Float64[np.ndarray, "N 3"]:
    """Interpolate unit normals inside faces given by their corners; zero where the corners' normals cancel."""
    return unit(blend(normals, corners, weights))


def unit(vectors: Float64[np.ndarray, "N 3"]) -> Float64[np.ndarray, "N 3"]:
    """Scale vectors to length 1; zero stays zero."""
    length = np.sqrt(np.einsum("nd,nd->n", vectors, vectors))
    return vectors / np.where(length > 0, length, 1.0)[:, None]


def angles(a: Float64[np.ndarray, "N 3"], b: Float64[np.ndarray, "N 3"]) -> Float64[np.ndarray, " N"]:
    """Return angles in degrees between unit vectors, 0 to 180; exact for small angles, unlike an arc cosine.

    The angle is 180 where either vector is zero: a surface without a normal matches none that has one.
    """
    differences = np.linalg.norm(a - b, axis=1)
    sums = np.linalg.norm(a + b, axis=1)
    undefined = (~a.any(axis=1)) | (~b.any(axis=1))
    return np.where(undefined, WORST_ANGLE, np.degrees(2 * angle(differences, sums)))


def _first_at_position(vertices: Float64[np.ndarray, "V 3"]) -> Int64[np.ndarray, " V"] | None:
    """Return, for each vertex, the index of one vertex at its position; None if all positions differ."""
    order = np.lexsort(vertices.T)
    ordered = vertices[order]
    new = np.ones(len(order), dtype=bool)
    new[1:] = (ordered[1:] != ordered[:-1]).any(axis=1)
    if new.all():
        return None
    representative = np.empty(len(order), dtype=np.int64)
    representative[order] = order[np.flatnonzero(new)[np.cumsum(new) - 1]]
    return representative
