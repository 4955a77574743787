"""Cuts faces in two at their longest edges, without cracks."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool

from ..types import Mesh
from .topology import unique_edges


def bisected(mesh: Mesh, chosen: Bool[np.ndarray, " F"]) -> Mesh:
    """Return the surface with the chosen faces cut in two at their longest edges, and faces beside as need be.

    New vertices follow the old ones; a face whose edge is cut is cut at its longest edge, too (Rivara 1984).
    """
    edges, face_edges = unique_edges(mesh.faces)
    ends = mesh.vertices[edges]
    lengths = np.square(ends[:, 0] - ends[:, 1]).sum(axis=1)
    turn = lengths[face_edges].argmax(axis=1)[:, None]
    faces, sides = (np.take_along_axis(each, (turn + np.arange(3)) % 3, axis=1) for each in (mesh.faces, face_edges))
    cut = np.zeros(len(edges), bool)
    cut[sides[chosen, 0]] = True
    while (more := sides[cut[sides].any(axis=1), 0])[~cut[more]].size:
        cut[more] = True
    middle = np.cumsum(cut) - 1 + len(mesh.vertices)
    pieces = [faces[~cut[sides[:, 0]]]]
    a, b, c = faces.T
    m, n, o = middle[sides].T  # of ab, bc and ca
    halved, second, third = cut[sides].T
    for taken, corners in (
        (halved & ~third, (a, m, c)),
        (halved & third, (a, m, o)),
        (halved & third, (o, m, c)),
        (halved & ~second, (m, b, c)),
        (halved & second, (m, b, n)),
        (halved & second, (m, n, c)),
    ):
        pieces.append(np.stack(corners, axis=1)[taken])
    vertices = np.concatenate([mesh.vertices, ends[cut].mean(axis=1)])
    return Mesh(vertices, np.concatenate(pieces).astype(np.int32))
