"""Midpoint subdivision as levels: connectivity, curved midpoints, and vertices placed along the normals there.

In: faces and the coarser level's vertices in T frames. Out: the finer level's. Both sides of the coder and the analysis
use it; the arithmetic is the core's, the same to the last bit everywhere.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int32

from .. import _core
from ..errors import FormatError
from ..types import Mesh, Placement
from .topology import vertex_normals

LEAST_COSINE = 0.3  # between direction and the surface's normal; below, the tangent plane says nothing


@dataclass(frozen=True, slots=True)
class Level:
    """One midpoint subdivision: what it does to the connectivity."""

    coarse: Int32[np.ndarray, "F 3"]
    edges: Int32[np.ndarray, "E 2"]  # sorted; edge e has the vertex `vertices + e` in its middle
    faces: Int32[np.ndarray, "G 3"]  # G = 4 F
    vertices: int  # of the coarser mesh

    @property
    def count(self) -> int:
        """Vertices of the finer mesh."""
        return self.vertices + len(self.edges)


def subdivide(faces: Int32[np.ndarray, "F 3"], vertices: int) -> Level:
    """The next level, its vertices in the order of `topology.subdivide_midpoint`.

    Raises FormatError where a face names none of the vertices.
    """
    try:
        edges, finer = _core.subdivide(faces, vertices)
    except ValueError as error:
        raise FormatError(f"a face that names none of {vertices} vertices, or too many of them") from error
    return Level(faces, edges, finer, vertices)


def levels_of(faces: Int32[np.ndarray, "F 3"], vertices: int, count: int) -> tuple[Level, ...]:
    """So many levels, one on the other."""
    levels = list[Level]()
    for _ in range(count):
        levels.append(subdivide(faces, vertices))
        faces, vertices = levels[-1].faces, levels[-1].count
    return tuple(levels)


def heights(
    wanted: Float64[np.ndarray, "T W 3"], known: Float64[np.ndarray, "T V 3"], level: Level, curvature: int
) -> Float64[np.ndarray, "T E"]:
    """Where each new vertex's line meets the wanted surface, from its curved midpoint; at most an edge's length away.

    `wanted` are places of the finer level's vertices: the surface is the tangent plane there, or, where the line runs
    along it, the place itself. `known` are the coarser level's, as both sides have them.
    """
    scalars = np.empty((len(wanted), len(level.edges)))
    for t, (target, coarse) in enumerate(zip(wanted, known, strict=True)):
        coarse = np.ascontiguousarray(coarse)
        midpoints, directions = _core.edge_frames(coarse, level.coarse, level.edges, curvature)
        normals = vertex_normals(Mesh(np.ascontiguousarray(target), level.faces))[level.vertices :]
        away = target[level.vertices :] - midpoints
        cosine = (directions * normals).sum(axis=1)
        steep = cosine >= LEAST_COSINE
        met = (away * normals).sum(axis=1) / np.where(steep, cosine, 1.0)
        ends = coarse[level.edges]
        length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
        scalars[t] = np.clip(np.where(steep, met, (away * directions).sum(axis=1)), -length, length)
    return scalars


def refine(
    known: Float64[np.ndarray, "T V 3"], level: Level, scalars: Float64[np.ndarray, "T E"], curvature: int
) -> Float64[np.ndarray, "T W 3"]:
    """The finer level's vertices: the coarser one's, then curved midpoint + scalar x direction for each edge.

    The direction is the unit sum of the normals at both ends; `curvature` / 64 of the sagitta that they say is how far
    the midpoint lies from the edge's.
    """
    rows = np.ascontiguousarray(known.transpose(1, 2, 0))
    return checked(*_core.refine(rows, level.coarse, level.edges, np.ascontiguousarray(scalars.T), curvature))


def frames_of(rows: Float64[np.ndarray, "V 3 T"], place: Placement | None = None) -> Float64[np.ndarray, "T V 3"]:
    """The frames of rows: all frames of a number are neighbours in memory. FormatError where they are not finite."""
    return checked(*_core.frames_of_rows(rows, None if place is None else place.numbers))


def checked(frames: Float64[np.ndarray, "T V 3"], finite: bool) -> Float64[np.ndarray, "T V 3"]:
    """Frames which the core says are finite. Raises FormatError where it does not."""
    if not finite:
        raise FormatError("vertices that are not finite")
    return frames
