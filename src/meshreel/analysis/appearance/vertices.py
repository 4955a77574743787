"""Colours of the vertices of a mesh that show a painted surface best, in the sense of least squares.

In: a painted surface, and the mesh that stands for it. Out: 8-bit colours of its vertices, between which faces blend.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float64, UInt8

from ...geometry.painted import Painted
from ...geometry.topology import face_normals
from ...types import GREY, Mesh

# Where each face is looked at: its middle, and on the way from there to each corner. Vertices alone would alias.
PLACES = np.array([[1, 1, 1], [4, 1, 1], [1, 4, 1], [1, 1, 4]]) / np.array([[3], [6], [6], [6]])
ROUNDS = 4  # of refinement: the rest of the error falls below a grey level (guess)


def vertex_colors(painted: Painted, mesh: Mesh) -> UInt8[np.ndarray, "V 3"]:
    """Return the colours of a mesh's vertices; grey where a vertex has no face with an area."""
    corners = mesh.vertices[mesh.faces]
    points = np.einsum("pk,fkc->fpc", PLACES, corners).reshape(-1, 3)
    wanted = painted.at(points).reshape(len(mesh.faces), len(PLACES), 3)
    areas = face_normals(mesh)[1]
    weights = areas[:, None, None] * PLACES[None]  # of a face's places on its corners
    total = _gathered(mesh, weights.sum(axis=1)[..., None])[:, 0]
    known = total > 0
    colors = np.full((len(mesh.vertices), 3), float(GREY))
    for _ in range(ROUNDS):
        shown = np.einsum("pk,fkc->fpc", PLACES, colors[mesh.faces])
        change = _gathered(mesh, np.einsum("fpk,fpc->fkc", weights, wanted - shown))
        colors[known] += change[known] / total[known, None]
    return np.clip(np.rint(colors), 0, 255).astype(np.uint8)


def _gathered(mesh: Mesh, values: Float64[np.ndarray, "F 3 C"]) -> Float64[np.ndarray, "V C"]:
    """Return the sums of values of faces' corners over the vertices."""
    places = mesh.faces.reshape(-1)
    flat = values.reshape(len(places), -1)
    return np.stack([np.bincount(places, column, len(mesh.vertices)) for column in flat.T], axis=1)
