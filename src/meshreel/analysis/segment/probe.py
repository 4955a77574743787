"""Whether a sequence is a scene: most of what is seen in one frame is in the same place in the others, and it is open.

A body on its own moves, or is closed: where one stands as still as a room does, there is nothing to be won by taking it
apart.
"""

from __future__ import annotations

import numpy as np

from ...geometry.topology import drop_unreferenced, unique_edges
from ...geometry.voxels import Lattice, around, distinct, spread
from ...types import Frames, Mesh
from ..survey import check

PROBES = 6  # frames, spread over the sequence
SHARE = 0.6  # of a frame's surface that stands still in a scene
_FINEST = 400  # cells along a frame's diagonal
_COARSEST = 32  # likewise: of fewer, what has moved by one is in the same place still


def is_scene(frames: Frames) -> bool:
    """True where there is a background worth the name; False for empty and single frames.

    Raises InputError for frames that cannot be used, as far as they are looked at.
    """
    numbers = sorted({round(k) for k in np.linspace(0, len(frames) - 1, min(PROBES, len(frames)))})
    meshes = []
    for number in numbers:
        check(mesh := frames[number], f"frame {number}")
        meshes += [] if mesh.is_empty else [drop_unreferenced(mesh)]
    if len(meshes) < 2 or not all(_is_open(mesh) for mesh in meshes):
        return False
    size = _cell(meshes[0])
    if size * _COARSEST > meshes[0].diagonal or size == 0:
        return False
    lattice = Lattice.near(meshes[0], size)
    cells = [distinct(lattice.keys(spread(mesh, lattice.size)[0])) for mesh in meshes]
    wide = [around(own) for own in cells]
    still = [np.mean([np.isin(own, other).mean() for other in wide]) for own in cells]
    return float(np.median(still)) >= SHARE


def _is_open(mesh: Mesh) -> bool:
    edges, face_edges = unique_edges(mesh.faces)
    return bool((np.bincount(face_edges.reshape(-1), minlength=len(edges)) == 1).any())


def _cell(mesh: Mesh) -> float:
    """About the length of an edge, m."""
    pairs = mesh.vertices[unique_edges(mesh.faces)[0]]
    edge = float(np.median(np.linalg.norm(pairs[:, 1] - pairs[:, 0], axis=1)))
    return max(edge, mesh.diagonal / _FINEST)
