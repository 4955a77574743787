"""Closest points on a surface, by Open3D's ray-casting scene (needs the extra `encode`).

Open3D answers queries in float32: give coordinates near the origin.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Bool, Float32, Float64, Int64

from ..types import Mesh
from . import work
from .topology import blend, border_mask, face_normals, unique_edges

_AT_BORDER = 1e-4  # barycentric weight below which a point is on an edge (guess)
_CURVE_BITS = 10  # per coordinate, of the cells along the space-filling curve: three fit into 32 bits


@dataclass(frozen=True, slots=True)
class Hits:
    """Closest points of a surface to N queries."""

    points: Float64[np.ndarray, "N 3"]
    faces: Int64[np.ndarray, " N"]
    barycentric: Float64[np.ndarray, "N 3"]  # weights of the face's three vertices


class Surface:
    """A mesh with at least one face, prepared for closest-point queries."""

    def __init__(self, mesh: Mesh) -> None:
        import open3d as o3d

        assert not mesh.is_empty, "closest points need a surface"
        self.mesh = mesh
        self.scene = o3d.t.geometry.RaycastingScene()  # Open3D's own, also for `raycast`
        self.scene.add_triangles(
            o3d.core.Tensor.from_numpy(mesh.vertices.astype(np.float32)),
            o3d.core.Tensor.from_numpy(mesh.faces.astype(np.uint32)),
        )

    @property
    def normals(self) -> Float64[np.ndarray, "F 3"]:
        """Unit normals of the faces."""
        return self._oriented[0]

    @property
    def areas(self) -> Float64[np.ndarray, " F"]:
        """Areas of the faces, in squared units of the vertices."""
        return self._oriented[1]

    @cached_property
    def _oriented(self) -> tuple[Float64[np.ndarray, "F 3"], Float64[np.ndarray, " F"]]:
        return face_normals(self.mesh)  # computed on first use: most callers want points only

    def closest(self, queries: Float64[np.ndarray, "N 3"]) -> Hits:
        """Find the closest point of the surface to each query, with its face and barycentric weights."""
        import open3d as o3d

        work.count("closest points", len(queries))
        points = queries.astype(np.float32)
        order = _along_curve(points)  # neighbours visit the same boxes: a fifth of the time
        sorted_points = o3d.core.Tensor.from_numpy(points[order])
        # more threads cost a tenth and gain nothing
        answer = self.scene.compute_closest_points(sorted_points, nthreads=1)
        faces, uv = np.empty(len(queries), np.int64), np.empty((len(queries), 2))
        faces[order], uv[order] = answer["primitive_ids"].numpy(), answer["primitive_uvs"].numpy()
        barycentric = np.stack([1 - uv[:, 0] - uv[:, 1], uv[:, 0], uv[:, 1]], axis=1)
        found = blend(self.mesh.vertices, self.mesh.faces[faces], barycentric)  # float64 again
        return Hits(found, faces, barycentric)

    def past_border(self, hits: Hits) -> Bool[np.ndarray, " N"]:
        """Return which closest points are on the mesh's border: their queries lie beside the surface, not above it."""
        edges, corners = self._border
        on_edge = edges[hits.faces] & (hits.barycentric[:, [2, 0, 1]] < _AT_BORDER)  # opposite corners
        on_corner = corners[hits.faces] & (hits.barycentric > 1 - _AT_BORDER)
        return on_edge.any(axis=1) | on_corner.any(axis=1)

    @cached_property
    def _border(self) -> tuple[Bool[np.ndarray, "F 3"], Bool[np.ndarray, "F 3"]]:
        """Edges (01, 12, 20) and corners of each face that are on the border."""
        edges, face_edges = unique_edges(self.mesh.faces)
        border = border_mask(edges, face_edges)
        ends = np.zeros(len(self.mesh.vertices), bool)
        ends[edges[border].reshape(-1)] = True
        return border[face_edges], ends[self.mesh.faces]


def _along_curve(points: Float32[np.ndarray, "N 3"]) -> Int64[np.ndarray, " N"]:
    """Return an order in which neighbours follow each other: by the Morton code of each point's cell."""
    if len(points) == 0:
        return np.zeros(0, np.int64)
    low = points.min(axis=0)
    extent = float((points.max(axis=0) - low).max()) or 1.0
    cells = ((points - low) / extent * (2**_CURVE_BITS - 1)).astype(np.uint32)
    for shift, kept in ((16, 0x030000FF), (8, 0x0300F00F), (4, 0x030C30C3), (2, 0x09249249)):  # bits two apart
        cells = (cells | cells << np.uint32(shift)) & np.uint32(kept)
    return np.argsort(cells[:, 0] | cells[:, 1] << np.uint32(1) | cells[:, 2] << np.uint32(2))


class Outline:
    """Border of a mesh that has faces, prepared for repeated queries; the mesh may be far from the origin."""

    def __init__(self, mesh: Mesh) -> None:
        self._origin = (mesh.vertices.min(axis=0) + mesh.vertices.max(axis=0)) / 2
        self._surface = Surface(Mesh(mesh.vertices - self._origin, mesh.faces))

    def leaves_out(self, points: Float64[np.ndarray, "N 3"]) -> Bool[np.ndarray, " N"]:
        """Return which points lie past the border."""
        return self._surface.past_border(self._surface.closest(points - self._origin))


def distances(points: Float64[np.ndarray, "N 3"], mesh: Mesh) -> Float64[np.ndarray, " N"]:
    """Return the distance of each point from a mesh that has faces; both may be far from the origin."""
    origin = (mesh.vertices.min(axis=0) + mesh.vertices.max(axis=0)) / 2
    local = points - origin
    return np.linalg.norm(Surface(Mesh(mesh.vertices - origin, mesh.faces)).closest(local).points - local, axis=1)


def carried_labels(surface: Surface, labels: Bool[np.ndarray, " F"], mesh: Mesh) -> Bool[np.ndarray, " G"]:
    """Carry face labels from a surface to another mesh: each face takes that of the face nearest to its middle."""
    if mesh.is_empty:
        return np.zeros(0, bool)
    return labels[surface.closest(mesh.vertices[mesh.faces].mean(axis=1)).faces]
