"""What rays meet of a mesh: Open3D's ray-casting scene behind one small class (the extra `encode`).

Inside, coordinates are float32 about an origin of the mesh's own, so that far-away worlds keep their millimetres.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float32, Float64, Int32

from ..types import Mesh
from .cameras import PinholeCamera


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
        if not mesh.is_empty:
            vertices = (mesh.vertices - self._origin).astype(np.float32)
            self._scene.add_triangles(self._tensor(vertices), self._tensor(mesh.faces.astype(np.uint32)))

    def cast(self, origins: Float64[np.ndarray, "N 3"], directions: Float64[np.ndarray, "N 3"]) -> Hit:
        """What N rays meet first."""
        answer = self._cast(origins, directions)
        uv = answer["primitive_uvs"].numpy().astype(np.float64)
        barycentric = np.stack([1 - uv.sum(axis=1), uv[:, 0], uv[:, 1]], axis=1)
        return Hit(_faces(answer), answer["t_hit"].numpy().astype(np.float64), barycentric)

    def look(self, camera: PinholeCamera) -> Seen:
        """What a camera sees."""
        rows, columns = np.mgrid[: camera.height, : camera.width]
        _, directions = camera.rays(np.column_stack([columns.ravel(), rows.ravel()]) + 0.5)
        ahead = directions / directions[:, 2:]  # one metre along the axis: distances are depths
        answer = self._cast(np.broadcast_to(camera.eye, ahead.shape), ahead @ np.linalg.inv(camera.extrinsic[:3, :3]).T)
        shape = (camera.height, camera.width)
        return Seen(_faces(answer).reshape(shape), answer["t_hit"].numpy().reshape(shape))

    def _cast(self, origins: np.ndarray, directions: np.ndarray) -> dict:
        rays = np.concatenate([origins - self._origin, directions], axis=1).astype(np.float32)
        return self._scene.cast_rays(self._tensor(rays))


def _faces(answer: dict) -> Int32[np.ndarray, " N"]:
    """A miss is 2^32 - 1 there and -1 here."""
    return answer["primitive_ids"].numpy().view(np.int32)


def _middle(mesh: Mesh) -> Float64[np.ndarray, " 3"]:
    if len(mesh.vertices) == 0:
        return np.zeros(3)
    return (mesh.vertices.min(axis=0) + mesh.vertices.max(axis=0)) / 2
