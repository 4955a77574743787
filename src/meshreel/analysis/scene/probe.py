"""Whether a sequence is a scene: most of what is seen in one frame is in the same place in the others, and it is open.

A body on its own moves, or is closed: where one stands as still as a room does, there is nothing to be won by taking it
apart.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Int64

from ...geometry.topology import border_edges, drop_unreferenced, edge_lengths
from ...geometry.voxels import Lattice, around, distinct, spread
from ...types import Frames, Mesh, evenly
from ..survey import check

PROBES = 4  # frames, spread over the sequence
SHARE = 0.6  # of a frame's surface that stands still in a scene
CELLS = 200  # along a frame's diagonal: 4 cm in a room
BORDER = 1.0  # diagonals: the length of the borders of what is open; of the holes of a captured body, less
UNLIKE = 30.0  # of the sizes of two frames: no room is in both, and cells of one are no cells of the other
COARSEST = 32  # edges along it: a mesh of fewer is no capture of a room


def is_scene(frames: Frames) -> bool:
    """True where there is a background worth the name; False for empty and single frames.

    Raises InputError for frames that cannot be used, as far as they are looked at.
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
    wide = [around(own) for own in cells]
    still = [np.mean([_shared(own, other) for other in wide]) for own in cells]
    return float(np.median(still)) >= SHARE


def _is_open(mesh: Mesh) -> bool:
    """True where the borders are long; a few small holes do not open a body."""
    border = border_edges(mesh)
    length = np.linalg.norm(mesh.vertices[border[:, 0]] - mesh.vertices[border[:, 1]], axis=1).sum()
    return bool(length > BORDER * mesh.diagonal)


def _shared(own: Int64[np.ndarray, " C"], other: Int64[np.ndarray, " D"]) -> float:
    """The share of some cells that are among others; both are sorted."""
    at = np.minimum(np.searchsorted(other, own), len(other) - 1)
    return float((other[at] == own).mean())
