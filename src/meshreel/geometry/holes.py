"""Small holes closed: boundary loops that a cut has left, each filled by a fan around its middle.

In -> out: a mesh and the longest perimeter to close -> the mesh with more faces and one more vertex a hole.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Int64

from ..types import Mesh


def close_holes(mesh: Mesh, perimeter: float) -> Mesh:
    """The mesh with every simple boundary loop closed whose perimeter (units of the vertices) is at most this.

    Longer loops stay open: soles that a capture does not have, sleeves, the rim of what a camera saw.
    """
    vertices, faces = [mesh.vertices], [mesh.faces]
    count = len(mesh.vertices)
    for loop in _boundary_loops(mesh):
        around = mesh.vertices[loop]
        if np.linalg.norm(around - np.roll(around, -1, axis=0), axis=1).sum() > perimeter:
            continue
        vertices.append(around.mean(axis=0, keepdims=True))
        faces.append(_fan(loop, count))
        count += 1
    return Mesh.of(np.concatenate(vertices), np.concatenate(faces))


def _fan(loop: Int64[np.ndarray, " n"], middle: int) -> Int64[np.ndarray, "n 3"]:
    """Faces from the loop to one vertex; a loop runs as the faces beside it do, so these run the other way."""
    return np.stack([np.roll(loop, -1), loop, np.full(len(loop), middle)], axis=1)


def _boundary_loops(mesh: Mesh) -> list[Int64[np.ndarray, " n"]]:
    """Closed chains of half-edges that no face meets from the other side; vertices with several such are left out."""
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
