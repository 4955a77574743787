"""Causal prediction graphs, built from decoded meshes alone, so that they are the same on both sides.

In -> out: a base mesh -> an order of its vertices, coarse to fine, and their predictors; the connectivity of a level ->
that of the next level, with each new vertex's siblings.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ... import _core
from ...errors import FormatError
from ...geometry.topology import Level, subdivide
from ...shapes import Float64, Int32, Int64
from ...types import Mesh


@dataclass(frozen=True, slots=True)
class Graph:
    """Value v is predicted by the sum of weights[k] * value[near[k]], k in starts[v] .. starts[v + 1], near[k] < v."""

    starts: Int64[np.ndarray, " S"]  # S = V + 1
    near: Int32[np.ndarray, " E"]
    weights: Float64[np.ndarray, " E"]

    @property
    def core(self) -> _core.Graph:
        """The graph for calls of the core, which refers to these arrays."""
        return _core.Graph(self.starts, self.near, self.weights)


@dataclass(frozen=True, slots=True)
class Siblings:
    """Siblings of each new vertex of a level: earlier new vertices on the same face of the coarser level."""

    starts: Int64[np.ndarray, " S"]  # S = E + 1
    near: Int32[np.ndarray, " N"]

    def graph(self, weight: int) -> Graph:
        """Return the graph that predicts each new vertex's scalar by weight / 64 of the mean of its siblings'."""
        counts = np.diff(self.starts)
        return Graph(self.starts, self.near, np.repeat(weight / (64.0 * np.maximum(counts, 1)), counts))


@dataclass(frozen=True, slots=True)
class Connectivity:
    """Connectivity of a level; it follows from the coarser level's faces, so groups with the same faces share it."""

    level: Level
    siblings: Siblings

    @property
    def core(self) -> _core.Level:
        """The level for calls of the core, which refers to these arrays."""
        return _core.Level(self.level.coarse, self.level.edges, self.siblings.starts, self.siblings.near)


def connectivity(faces: Int32[np.ndarray, "F 3"], vertices: int) -> Connectivity:
    """Build the connectivity of the next level. Raises FormatError if a face refers to a missing vertex."""
    level = subdivide(faces, vertices)
    return Connectivity(level, siblings(level))


def hierarchy(base: Mesh) -> tuple[Int32[np.ndarray, " V"], Graph]:
    """Return the vertices of a base mesh from the coarsest shape to the finest detail, and the graph of their places.

    Raises FormatError if a face refers to a missing vertex.
    """
    try:
        order, starts, near, weights = _core.hierarchy(base.vertices, base.faces)
    except ValueError as error:
        raise FormatError(f"a face that names none of {len(base.vertices)} vertices") from error
    return order, Graph(starts.view(np.int64), near, weights)  # the core's int64 may be NumPy's longlong


def siblings(level: Level) -> Siblings:
    starts, near = _core.siblings(level.faces, level.vertices, len(level.edges))
    return Siblings(starts.view(np.int64), near)
