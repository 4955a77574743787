"""Closing of small holes: each boundary loop that a cut has left is filled by a fan around its middle.

A mesh and the longest perimeter to close -> the mesh with additional faces and one additional vertex per hole.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Int64

from ..types import Mesh


def close_holes(mesh: Mesh, perimeter: float) -> Mesh:
    """Close every simple boundary loop of at most this perimeter, in the unit of the vertices.

    Longer loops stay open: soles missing from a capture, sleeves, the rim of what a camera saw.
    """
    vertices, faces = [mesh.vertices], [mesh.faces]
    count = len(mesh.vertices)
    for loop in _boundary_loops(mesh):
        around = mesh.vertices[loop]
        if np.linalg.norm(around - np.roll(around, -1, axis=0), axis=1).sum() > perimeter:
            continue
        vertices.append(around.mean(axis=0, keepdims=True))
        faces.append(np.stack([np.roll(loop, -1), loop, np.full(len(loop), count)], axis=1))  # wound against it
        count += 1
    return Mesh.of(np.concatenate(vertices), np.concatenate(faces))


def _boundary_loops(mesh: Mesh) -> list[Int64[np.ndarray, " n"]]:
    """Return closed chains of half-edges without an opposite one; vertices where several chains meet are left out."""
    f = mesh.faces.astype(np.int64)
    half = np.concatenate([f[:, [0, 1]], f[:, [1, 2]], f[:, [2, 0]]])
    count = len(mesh.vertices)
    open_ = half[~np.isin(half[:, 0] * count + half[:, 1], half[:, 1] * count + half[:, 0])]
    starts, times = np.unique(open_[:, 0], return_counts=True)
    branching = set(starts[times > 1].tolist())
    following = {a: b for a, b in open_.tolist() if a not in branching}
    loops = []
    while following:
        start, vertex = following.popitem()
        chain = [start]
        while vertex != start and vertex in following:
            chain.append(vertex)
            vertex = following.pop(vertex)
        if vertex == start and len(chain) >= 3:
            loops.append(np.array(chain))
    return loops
