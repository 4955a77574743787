"""Estimate a body's motion by its colours, where shape alone misleads the tracker.

In: the key's samples at their last positions, with its colours; samples of the next frame with theirs. Out: an offset
for each node. If a body moves by its own thickness between two frames, the nearest surface is another finger, leg or
side; near surface of the same colour is more often the same place.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float64, Int64
from scipy.spatial import cKDTree

from ...geometry.color_views import Paint
from ...geometry.topology import vertex_normals
from ...types import Mesh
from ..fit.frame import FrameSurface

GREY = 0.001  # diagonals equivalent to one level of a colour, of 255; .0003 does as well (decision 28)
REACH = 0.3  # diagonals, largest joint distance in place and colour of a pair (guess)
AROUND = 40  # samples next to a node whose median offset it takes (guess)
FEWEST = 200  # smallest number of samples of known colour, on either side, for an estimate (guess)


class ColoredPlaces:
    """Samples of a key mesh with their colours."""

    def __init__(self, mesh: Mesh, samples: Int64[np.ndarray, " S"], paint: Paint) -> None:
        """Take the key's mesh, the vertices that are its samples, and the source of its colours."""
        self._colors, self._known = paint.at(mesh.vertices[samples], vertex_normals(mesh)[samples])

    def offsets(
        self,
        nodes: Float64[np.ndarray, "N 3"],
        points: Float64[np.ndarray, "S 3"],
        frame: FrameSurface,
        count: int,
        paint: Paint,
    ) -> Float64[np.ndarray, "N 3"] | None:
        """Return each node's offset to samples of its colour, of about `count` in a frame; None: unknown.

        `points` are the last positions of the key's samples.
        """
        samples = frame.samples(count)
        colors, known = paint.at(frame.mesh.vertices[samples], frame.normals[samples])
        frame_points, key_points = frame.mesh.vertices[samples][known], points[self._known]
        if min(len(frame_points), len(key_points)) < FEWEST:
            return None
        joint = cKDTree(np.concatenate([frame_points, GREY * colors[known]], axis=1))
        far, near = joint.query(np.concatenate([key_points, GREY * self._colors[self._known]], axis=1))
        paired = far <= REACH
        if paired.sum() < FEWEST:
            return None
        around = cKDTree(key_points[paired]).query(nodes, AROUND)[1]
        return np.median((frame_points[near[paired]] - key_points[paired])[around], axis=1)
