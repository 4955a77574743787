"""Closest points on a surface, by the core's tree of boxes.

The tree decides in float32, about the middle of the mesh, which face is closest; the point on it is float64.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Bool, Float64, Int32, Int64

from .. import _core
from ..types import Mesh
from . import work
from .topology import blend, border_mask, face_means, face_normals, unique_edges

_AT_BORDER = 1e-4  # barycentric weight below which a point is on an edge (guess)


@dataclass(frozen=True, slots=True)
class Hits:
    """Closest points of a surface to N queries."""

    points: Float64[np.ndarray, "N 3"]
    faces: Int32[np.ndarray, " N"]
    barycentric: Float64[np.ndarray, "N 3"]  # weights of the face's three vertices


class Surface:
    """A mesh with at least one face, prepared for closest-point queries."""

    def __init__(self, mesh: Mesh) -> None:
        assert not mesh.is_empty, "closest points need a surface"
        self.mesh = mesh
        self.tree = _core.SurfaceTree(mesh.vertices, mesh.faces)  # the core's own

    @cached_property
    def normals(self) -> Float64[np.ndarray, "F 3"]:
        return face_normals(self.mesh)[0]  # computed on first use: most callers want points only

    @cached_property
    def areas(self) -> Float64[np.ndarray, " F"]:
        """Areas of the faces, in squared units of the vertices."""
        return face_normals(self.mesh)[1]

    def closest(self, queries: Float64[np.ndarray, "N 3"], gone: Bool[np.ndarray, " F"] | None = None) -> Hits:
        """Find the closest point of the surface to each query, with its face and barycentric weights.

        Faces that are `gone`, of which some must be left, do not count. Among equally close faces, the one with the
        lowest number is chosen.
        """
        work.count("closest points", len(queries))
        out = None if gone is None else gone.view(np.uint8)
        faces, barycentric = self.tree.closest(np.ascontiguousarray(queries), np.inf, None, out)
        return Hits(blend(self.mesh.vertices, self.mesh.faces[faces], barycentric), faces, barycentric)

    def distances(self, points: Float64[np.ndarray, "N 3"]) -> Float64[np.ndarray, " N"]:
        return np.linalg.norm(self.closest(points).points - points, axis=1)

    def move(self, vertices: Float64[np.ndarray, "V 3"]) -> None:
        """Move the vertices; updating the search structure takes a tenth of the time of building a new one."""
        self.mesh = Mesh(vertices, self.mesh.faces)
        self.tree.move(vertices)
        for computed in ("normals", "areas"):
            self.__dict__.pop(computed, None)

    def past_border(self, hits: Hits) -> Bool[np.ndarray, " N"]:
        """Return a mask of closest points on the mesh's border, whose queries lie beside the surface, not above it."""
        edges, corners = self._border
        on_edge = edges[hits.faces] & (hits.barycentric[:, [2, 0, 1]] < _AT_BORDER)  # opposite corners
        on_corner = corners[hits.faces] & (hits.barycentric > 1 - _AT_BORDER)
        return on_edge.any(axis=1) | on_corner.any(axis=1)

    @cached_property
    def _border(self) -> tuple[Bool[np.ndarray, "F 3"], Bool[np.ndarray, "F 3"]]:
        """Masks of the edges (01, 12, 20) and corners of each face that are on the border."""
        edges, face_edges = unique_edges(self.mesh.faces)
        border = border_mask(edges, face_edges)
        ends = np.zeros(len(self.mesh.vertices), bool)
        ends[edges[border].reshape(-1)] = True
        return border[face_edges], ends[self.mesh.faces]


class MovingSurface:
    """A mesh whose vertices move; threads that ask at the same time get a search structure each."""

    def __init__(self, mesh: Mesh) -> None:
        self._mesh, self._free = mesh, [Surface(mesh)]

    @contextmanager
    def at(self, vertices: Float64[np.ndarray, "V 3"]) -> Iterator[Surface]:
        """Yield the surface with its vertices there."""
        try:
            surface = self._free.pop()
        except IndexError:
            surface = Surface(self._mesh)
        surface.move(vertices)
        try:
            yield surface
        finally:
            self._free.append(surface)


def area_samples(mesh: Mesh, count: int) -> Int64[np.ndarray, " S"]:
    """Choose about `count` vertices, spread evenly over the area; ascending, the same for the same mesh."""
    if len(mesh.vertices) <= count:
        return np.arange(len(mesh.vertices))
    _, areas = face_normals(mesh)
    share = np.bincount(mesh.faces.reshape(-1), np.repeat(areas, 3), len(mesh.vertices))
    reached = np.cumsum(share)
    steps = (np.arange(count) + 0.5) * (reached[-1] / count)
    return np.unique(np.minimum(np.searchsorted(reached, steps), len(share) - 1))


def distances(points: Float64[np.ndarray, "N 3"], mesh: Mesh) -> Float64[np.ndarray, " N"]:
    return Surface(mesh).distances(points)


def carried_labels(surface: Surface, labels: Bool[np.ndarray, " F"], mesh: Mesh) -> Bool[np.ndarray, " G"]:
    """Transfer face labels to another mesh: each face takes the label of the face nearest to its middle."""
    return labels[surface.closest(face_means(mesh.vertices, mesh.faces)).faces]
