"""Midpoint subdivision by levels: connectivity, curved midpoints, and new vertices placed along the normals there.

Faces and the coarser level's vertices in T frames -> the finer level's vertices. Encoder, decoder and analysis share
it; the arithmetic is in the core and gives the same bits everywhere.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .. import _core
from ..errors import FormatError
from ..shapes import Float, Float64, Int32
from ..types import Mesh, Placement
from .topology import vertex_normals

LEAST_COSINE = 0.3  # between direction and surface normal; below it the tangent plane is useless (guess)


@dataclass(frozen=True, slots=True)
class Level:
    """Connectivity before and after one midpoint subdivision."""

    coarse: Int32[np.ndarray, "F 3"]
    edges: Int32[np.ndarray, "E 2"]  # sorted; edge e has the vertex `vertices + e` in its middle
    faces: Int32[np.ndarray, "G 3"]  # G = 4 F
    vertices: int  # of the coarser mesh

    @property
    def count(self) -> int:
        return self.vertices + len(self.edges)


def subdivide(faces: Int32[np.ndarray, "F 3"], vertices: int) -> Level:
    """Subdivide the connectivity once; vertices are in the order of `topology.subdivide_midpoint`.

    Raises FormatError if a face refers to a missing vertex.
    """
    try:
        edges, finer = _core.subdivide(faces, vertices)
    except ValueError as error:
        raise FormatError(f"a face that names none of {vertices} vertices, or too many of them") from error
    return Level(faces, edges, finer, vertices)


def levels_of(faces: Int32[np.ndarray, "F 3"], vertices: int, count: int) -> tuple[Level, ...]:
    """Subdivide the connectivity `count` times and return every level."""
    levels = list[Level]()
    for _ in range(count):
        levels.append(subdivide(faces, vertices))
        faces, vertices = levels[-1].faces, levels[-1].count
    return tuple(levels)


def heights(
    wanted: Float64[np.ndarray, "T W 3"], known: Float64[np.ndarray, "T V 3"], level: Level, curvature: int
) -> Float64[np.ndarray, "T E"]:
    """Return the signed distance from each curved midpoint, along its direction, to the wanted surface.

    `wanted` are positions of the finer level's vertices: the surface is the tangent plane at such a vertex or, if the
    direction runs along that plane, the vertex itself. `known` are the coarser level's vertices as both encoder and
    decoder have them. No distance exceeds the length of its edge.
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
    coarse: Float64[np.ndarray, "T V 3"], level: Level, scalars: Float64[np.ndarray, "T E"], curvature: int
) -> Float64[np.ndarray, "T W 3"]:
    """Return the finer level's vertices: the coarser ones, then curved midpoint + scalar x direction for each edge.

    The direction is the unit sum of the normals at both ends. The curved midpoint lies `curvature` / 64 of the sagitta
    that these normals imply away from the middle of the edge.
    """
    rows = np.ascontiguousarray(coarse.transpose(1, 2, 0))
    return _core.refine(rows, level.coarse, level.edges, np.ascontiguousarray(scalars.T), curvature)


def write_frames(
    rows: Float64[np.ndarray, "V 3 T"], place: Placement | None, frames: Float[np.ndarray, "T V 3"]
) -> None:
    """Transpose rows, each of one coordinate in all frames, into `frames`. Raises FormatError if one is not finite."""
    _core.frames_of_rows(rows, None if place is None else place.numbers, frames)
