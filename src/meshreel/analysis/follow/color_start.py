"""Guess how far a body has moved by the colours of its places, for a tracker that shape alone leads astray.

In: places of a key as they were last, with the colours of the key; samples of the next frame with theirs. Out: an
offset for each node. What lies nearest is another finger, leg or side where a body moves by its own thickness between
two frames; what lies near and has the same colour is the same place more often.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float64, Int64
from scipy.spatial import cKDTree

from ...geometry.painted import Paint
from ...geometry.topology import vertex_normals
from ...types import Mesh
from ..fit.frame import FrameSurface

GREY = 0.001  # diagonals that a level of one colour, of 255, is worth; .0003 does as well (decision 28)
REACH = 0.3  # diagonals, and their worth in colour, that a place is looked for (guess)
AROUND = 40  # samples next to a node whose median offset it takes (guess)
FEWEST = 200  # samples of known colour, on either side, without which colours tell nothing (guess)


class ColoredPlaces:
    """Places of a key mesh with the colours that they have there."""

    def __init__(self, mesh: Mesh, samples: Int64[np.ndarray, " S"], paint: Paint) -> None:
        """Take the key's mesh, which of its vertices are its samples, and what knows its colours."""
        self._colors, self._known = paint.at(mesh.vertices[samples], vertex_normals(mesh)[samples])

    def offsets(
        self,
        nodes: Float64[np.ndarray, "N 3"],
        points: Float64[np.ndarray, "S 3"],
        frame: FrameSurface,
        count: int,
        paint: Paint,
    ) -> Float64[np.ndarray, "N 3"] | None:
        """Return how far the nodes are from where about `count` samples of a frame have their colours; None: unknown.

        `points` are the samples of the key where they were last.
        """
        some = frame.samples(count)
        colors, known = paint.at(frame.mesh.vertices[some], frame.normals[some])
        theirs, own = frame.mesh.vertices[some][known], points[self._known]
        if min(len(theirs), len(own)) < FEWEST:
            return None
        joint = cKDTree(np.concatenate([theirs, GREY * colors[known]], axis=1))
        far, near = joint.query(np.concatenate([own, GREY * self._colors[self._known]], axis=1))
        paired = far <= REACH
        if paired.sum() < FEWEST:
            return None
        around = cKDTree(own[paired]).query(nodes, AROUND)[1]
        return np.median((theirs[near[paired]] - own[paired])[around], axis=1)
