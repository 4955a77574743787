"""Points spread evenly over chosen faces of a mesh, each for the same area, without random numbers.

Mesh and chosen faces -> Scatter. Consecutive points are equal shares of area apart along the faces; inside a face they
follow a low-discrepancy sequence (R2, M. Roberts 2018), folded into the triangle. The same mesh gives the same points.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float64, Int64

from ..geometry.topology import blend, face_normals
from ..types import Mesh

_R2 = np.array([0.7548776662466927, 0.5698402909980532])  # 1 / g and 1 / g^2, where g^3 = g + 1


@dataclass(frozen=True, slots=True)
class Scatter:
    """N points on a mesh, with their faces and barycentric weights."""

    points: Float64[np.ndarray, "N 3"]  # in the mesh's unit
    faces: Int64[np.ndarray, " N"]
    barycentric: Float64[np.ndarray, "N 3"]  # weights of the face's three vertices
    area: float  # of the chosen faces, in the mesh's unit, squared

    def __len__(self) -> int:
        return len(self.points)


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
