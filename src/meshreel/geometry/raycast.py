"""Ray casting on a mesh, by Open3D's ray-casting scene (needs the extra `encode`).

Open3D works in float32; coordinates are taken about an origin near the mesh, so that meshes far from the world's origin
keep their millimetres.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Bool, Float32, Float64, Int32

from ..types import Mesh
from .cameras import PinholeCamera
from .strict import inverse, products
from .topology import face_normals


@dataclass(frozen=True, slots=True)
class Hit:
    """First intersection of each of N rays with the surface."""

    faces: Int32[np.ndarray, " N"]  # -1: none
    distances: Float64[np.ndarray, " N"]  # in lengths of the ray's direction; infinite: none
    barycentric: Float64[np.ndarray, "N 3"]  # weights of the face's three vertices; (1, 0, 0): none


@dataclass(frozen=True, slots=True)
class Seen:
    """Face and depth that a camera sees at each pixel."""

    faces: Int32[np.ndarray, "H W"]  # the paper's eq. 1; -1: none
    depth: Float32[np.ndarray, "H W"]  # m, along the optical axis; infinite: none


class Rays:
    """A mesh prepared for ray casting; rays meet faces from both sides, and no ray meets an empty mesh."""

    def __init__(self, mesh: Mesh, origin: Float64[np.ndarray, " 3"] | None = None) -> None:
        """Prepare a mesh; `origin` is the point about which coordinates become float32, by default the box's middle."""
        import open3d as o3d

        self._tensor = o3d.core.Tensor.from_numpy
        self._scene = o3d.t.geometry.RaycastingScene()
        self._origin = mesh.middle if origin is None else origin
        self._mesh = mesh
        if not mesh.is_empty:
            vertices = (mesh.vertices - self._origin).astype(np.float32)
            self._scene.add_triangles(self._tensor(vertices), self._tensor(mesh.faces.astype(np.uint32)))

    def cast(self, origins: Float64[np.ndarray, "N 3"], directions: Float64[np.ndarray, "N 3"]) -> Hit:
        """Find the first intersection of each of N rays."""
        rays = np.concatenate([origins - self._origin, directions], axis=1).astype(np.float32)
        answer = self._scene.cast_rays(self._tensor(rays))
        uv = answer["primitive_uvs"].numpy().astype(np.float64)
        barycentric = np.stack([1 - uv.sum(axis=1), uv[:, 0], uv[:, 1]], axis=1)
        return Hit(_faces(answer), answer["t_hit"].numpy().astype(np.float64), barycentric)

    def look(self, camera: PinholeCamera) -> Seen:
        """Find the face and the depth that a camera sees at each pixel."""
        rays = np.empty((camera.height, camera.width, 6), np.float32)
        rays[..., :3] = camera.eye - self._origin
        for axis, ways in enumerate(_ways(camera)):
            rays[..., 3 + axis] = ways
        answer = self._scene.cast_rays(self._tensor(rays))
        return Seen(_faces(answer), answer["t_hit"].numpy())

    def faces_in(self, camera: PinholeCamera, pixels: Bool[np.ndarray, "H W"]) -> Int32[np.ndarray, " N"]:
        """Find the face that a camera sees in each of some pixels, row by row; -1: none."""
        rays = np.empty((np.count_nonzero(pixels), 6), np.float32)
        rays[:, :3] = camera.eye - self._origin
        for axis, ways in enumerate(_ways(camera)):
            rays[:, 3 + axis] = ways[pixels]
        return _faces(self._scene.cast_rays(self._tensor(rays)))

    def backs(self, camera: PinholeCamera, seen: Seen) -> Bool[np.ndarray, "H W"]:
        """Return where a camera sees the back of a face; `seen` is the result of `look`."""
        if self._mesh.is_empty:
            return np.zeros(seen.faces.shape, bool)
        normals = self._normals[seen.faces]  # of some face where none is seen
        along = sum(normals[..., axis] * ways for axis, ways in enumerate(_ways(camera)))
        return (along > 0) & (seen.faces >= 0)

    @cached_property
    def _normals(self) -> Float64[np.ndarray, "F 3"]:
        return face_normals(self._mesh)[0]


def pixels_near(camera: PinholeCamera, mesh: Mesh) -> Bool[np.ndarray, "H W"]:
    """Return the pixels in the boxes of the projected faces, a pixel wider: a camera sees the faces in no others.

    These are all pixels where the plane of the camera cuts a face.
    """
    local = products(mesh.vertices, camera.extrinsic[:3, :3].T) + camera.extrinsic[:3, 3]
    ahead = (local[:, 2] > 0)[mesh.faces]
    if (ahead.any(axis=1) & ~ahead.all(axis=1)).any():
        return np.ones((camera.height, camera.width), bool)
    size = np.array([camera.width, camera.height])
    corners = camera.project(local)[mesh.faces[ahead.all(axis=1)]]
    low = np.clip(np.floor(corners.min(axis=1)) - 1, 0, size).astype(np.int64)
    high = np.clip(np.floor(corners.max(axis=1)) + 2, 0, size).astype(np.int64)
    steps = np.zeros((camera.height + 1, camera.width + 1), np.int64)  # of the number of boxes, along both axes
    for x, y, step in ((low, low, 1), (high, high, 1), (low, high, -1), (high, low, -1)):
        np.add.at(steps, (y[:, 1], x[:, 0]), step)
    return steps.cumsum(axis=0).cumsum(axis=1)[:-1, :-1] > 0


def _ways(camera: PinholeCamera) -> Iterator[Float64[np.ndarray, "H W"]]:
    """Yield the ray directions of all pixels, one world axis at a time; each goes one metre along the optical axis."""
    columns, rows = np.arange(camera.width) + 0.5, np.arange(camera.height)[:, None] + 0.5
    for right, down, ahead in products(inverse(camera.extrinsic[:3, :3]), inverse(camera.intrinsic)):
        yield right * columns + (down * rows + ahead)


def _faces(answer: dict) -> Int32[np.ndarray, "..."]:
    """Return the faces that rays hit; a miss, 2^32 - 1 in Open3D, becomes -1."""
    return answer["primitive_ids"].numpy().view(np.int32)
