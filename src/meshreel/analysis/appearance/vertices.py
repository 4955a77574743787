"""Fit colours of a mesh's vertices to a painted surface by least squares.

In: the source of colours, and the mesh. Out: 8-bit colours of its vertices, which faces interpolate.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float64, UInt8

from ...geometry.color_views import Paint, spread_colors
from ...geometry.topology import face_normals
from ...types import GREY, Mesh

# Samples of each face: its middle, and a point towards each corner. Samples at vertices alone would alias.
PLACES = np.array([[1, 1, 1], [4, 1, 1], [1, 4, 1], [1, 1, 4]]) / np.array([[3], [6], [6], [6]])
ROUNDS = 4  # of refinement: the rest of the error falls below a grey level (guess)


def vertex_colors(paint: Paint, mesh: Mesh) -> UInt8[np.ndarray, "V 3"]:
    """Return the colours of a mesh's vertices; vertices of unknown colour get the means of their neighbours."""
    normals, areas = face_normals(mesh)
    points = np.einsum("pk,fkc->fpc", PLACES, mesh.vertices[mesh.faces]).reshape(-1, 3)
    colors, known_places = paint.at(points, normals.repeat(len(PLACES), axis=0))
    target = colors.reshape(len(mesh.faces), len(PLACES), 3)
    weights = (areas[:, None] * known_places.reshape(-1, len(PLACES)))[..., None] * PLACES  # places on corners
    total = _gathered(mesh, weights.sum(axis=1)[..., None])[:, 0]
    known = total > 0
    fitted = np.full((len(mesh.vertices), 3), float(GREY))
    for _ in range(ROUNDS):
        blended = np.einsum("pk,fkc->fpc", PLACES, fitted[mesh.faces])
        change = _gathered(mesh, np.einsum("fpk,fpc->fkc", weights, target - blended))
        fitted[known] += change[known] / total[known, None]
    return spread_colors(mesh, fitted, known)


def _gathered(mesh: Mesh, values: Float64[np.ndarray, "F 3 C"]) -> Float64[np.ndarray, "V C"]:
    """Return the sums of values of faces' corners over the vertices."""
    places = mesh.faces.reshape(-1)
    flat = values.reshape(len(places), -1)
    return np.stack([np.bincount(places, column, len(mesh.vertices)) for column in flat.T], axis=1)
