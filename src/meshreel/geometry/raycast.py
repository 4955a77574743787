"""What rays meet of a mesh: Open3D's ray-casting scene behind one small class (the extra `encode`).

Inside, coordinates are float32 about an origin of the mesh's own, so that far-away worlds keep their millimetres.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Bool, Float32, Float64, Int32

from ..types import Mesh
from .cameras import PinholeCamera
from .closest_points import Surface
from .topology import face_normals


@dataclass(frozen=True, slots=True)
class Hit:
    """Where each of N rays first meets the surface."""

    faces: Int32[np.ndarray, " N"]  # -1: none
    distances: Float64[np.ndarray, " N"]  # in lengths of the ray's direction; infinite: none
    barycentric: Float64[np.ndarray, "N 3"]  # weights of the face's three vertices; (1, 0, 0): none


@dataclass(frozen=True, slots=True)
class Seen:
    """What a camera sees, pixel by pixel."""

    faces: Int32[np.ndarray, "H W"]  # the paper's eq. 1; -1: none
    depth: Float32[np.ndarray, "H W"]  # m, along the optical axis; infinite: none


class Rays:
    """A mesh prepared for ray casting; faces are met from both sides, and an empty mesh by no ray."""

    def __init__(self, mesh: Mesh, origin: Float64[np.ndarray, " 3"] | None = None) -> None:
        """`origin` is the point about which coordinates are float32; the middle of the box where none is given."""
        import open3d as o3d

        self._tensor = o3d.core.Tensor.from_numpy
        self._scene = o3d.t.geometry.RaycastingScene()
        self._origin = _middle(mesh) if origin is None else origin
        self._mesh = mesh
        if not mesh.is_empty:
            vertices = (mesh.vertices - self._origin).astype(np.float32)
            self._scene.add_triangles(self._tensor(vertices), self._tensor(mesh.faces.astype(np.uint32)))

    @staticmethod
    def of(surface: Surface) -> Rays:
        """For a mesh that is prepared for closest points, about 0: what has been built for these serves rays, too."""
        rays = Rays(Mesh.empty(), np.zeros(3))
        rays._mesh, rays._scene = surface.mesh, surface.scene
        return rays

    def cast(self, origins: Float64[np.ndarray, "N 3"], directions: Float64[np.ndarray, "N 3"]) -> Hit:
        """What N rays meet first."""
        answer = self._cast(origins, directions)
        uv = answer["primitive_uvs"].numpy().astype(np.float64)
        barycentric = np.stack([1 - uv.sum(axis=1), uv[:, 0], uv[:, 1]], axis=1)
        return Hit(_faces(answer), answer["t_hit"].numpy().astype(np.float64), barycentric)

    def look(self, camera: PinholeCamera) -> Seen:
        """What a camera sees."""
        rays = np.empty((camera.height, camera.width, 6), np.float32)
        rays[..., :3] = camera.eye - self._origin
        for axis, ways in enumerate(_ways(camera)):
            rays[..., 3 + axis] = ways
        answer = self._scene.cast_rays(self._tensor(rays))
        return Seen(_faces(answer), answer["t_hit"].numpy())

    def backs(self, camera: PinholeCamera, seen: Seen) -> Bool[np.ndarray, "H W"]:
        """Where a camera sees the back of a face; `seen` is what it sees."""
        if self._mesh.is_empty:
            return np.zeros(seen.faces.shape, bool)
        normals = self._normals[seen.faces]  # of some face where none is seen
        along = sum(normals[..., axis] * ways for axis, ways in enumerate(_ways(camera)))
        return (along > 0) & (seen.faces >= 0)

    @cached_property
    def _normals(self) -> Float64[np.ndarray, "F 3"]:
        return face_normals(self._mesh)[0]

    def _cast(self, origins: np.ndarray, directions: np.ndarray) -> dict:
        rays = np.concatenate([origins - self._origin, directions], axis=1).astype(np.float32)
        return self._scene.cast_rays(self._tensor(rays))


def _ways(camera: PinholeCamera) -> Iterator[Float64[np.ndarray, "H W"]]:
    """Where the ray of each pixel goes, axis by axis of the world; one metre along the optical axis."""
    columns, rows = np.arange(camera.width) + 0.5, np.arange(camera.height)[:, None] + 0.5
    for right, down, ahead in np.linalg.inv(camera.extrinsic[:3, :3]) @ np.linalg.inv(camera.intrinsic):
        yield right * columns + (down * rows + ahead)


def _faces(answer: dict) -> Int32[np.ndarray, "..."]:
    """A miss is 2^32 - 1 there and -1 here."""
    return answer["primitive_ids"].numpy().view(np.int32)


def _middle(mesh: Mesh) -> Float64[np.ndarray, " 3"]:
    if len(mesh.vertices) == 0:
        return np.zeros(3)
    return (mesh.vertices.min(axis=0) + mesh.vertices.max(axis=0)) / 2
