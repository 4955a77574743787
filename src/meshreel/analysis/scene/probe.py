"""Detect scenes: sequences of open surface most of which is in the same place in all frames.

In: a sequence. Out: True if it should be separated into a background and bodies. A lone body moves or is closed;
separating one that stands as still as a room would gain nothing.
"""

from __future__ import annotations

import numpy as np

from ...geometry.topology import border_edges, drop_unreferenced, edge_lengths
from ...geometry.voxels import Lattice, around, distinct, spread
from ...types import Frames, Mesh, evenly
from ..survey import check

# Set between captured rooms and captured bodies.
PROBES = 4  # frames inspected, spread over the sequence (guess)
SHARE = 0.6  # smallest share of a frame's surface that stands still in a scene (guess)
CELLS = 200  # cells along a frame's diagonal: 4 cm in a room (guess)
BORDER = 1.0  # diagonals, least length of the borders of an open surface; holes of a captured body have less (guess)
UNLIKE = 30.0  # largest ratio between the sizes of frames of one room (guess)
COARSEST = 32  # smallest number of median edge lengths along the diagonal of a captured room (guess)


def is_scene(frames: Frames) -> bool:
    """Return whether a sequence has a background; False for empty sequences and single frames.

    Raises InputError if one of the few inspected frames is invalid.
    """
    numbers = evenly(len(frames), PROBES)
    meshes = []
    for number in numbers:
        check(mesh := frames[number], f"frame {number}")
        meshes += [] if mesh.is_empty else [drop_unreferenced(mesh)]
    sizes = [mesh.diagonal for mesh in meshes]
    if len(meshes) < 2 or sizes[0] == 0 or max(sizes) > UNLIKE * min(sizes):
        return False
    if not _is_open(meshes[0]) or np.median(edge_lengths(meshes[0])) * COARSEST > sizes[0]:
        return False
    lattice = Lattice.near(meshes[0], meshes[0].diagonal / CELLS)
    cells = [distinct(lattice.keys(spread(mesh, lattice.size)[0])) for mesh in meshes]
    wide = [around(occupied) for occupied in cells]
    still = [np.mean([np.isin(occupied, other).mean() for other in wide]) for occupied in cells]
    return float(np.median(still)) >= SHARE


def _is_open(mesh: Mesh) -> bool:
    """Return whether the borders of a mesh are long; a few small holes do not make a body open."""
    border = border_edges(mesh)
    length = np.linalg.norm(mesh.vertices[border[:, 0]] - mesh.vertices[border[:, 1]], axis=1).sum()
    return bool(length > BORDER * mesh.diagonal)
