"""Ray casting on a mesh, by the core's tree of boxes.

The tree decides in float32, about the middle of the mesh, which face a ray meets; the distance to it is float64.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Bool, Float32, Float64, Int32

from .. import _core
from ..types import Mesh
from .cameras import Camera
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

    def __init__(self, mesh: Mesh) -> None:
        self._mesh = mesh
        self._tree = None if mesh.is_empty else _core.SurfaceTree(mesh.vertices, mesh.faces)

    def cast(self, origins: Float64[np.ndarray, "M 3"], directions: Float64[np.ndarray, "N 3"]) -> Hit:
        """Find the first intersection of each of N rays; they have N origins, or one."""
        if self._tree is None:
            weights = np.zeros((len(directions), 3))
            weights[:, 0] = 1
            return Hit(np.full(len(directions), -1, np.int32), np.full(len(directions), np.inf), weights)
        origins, directions = np.ascontiguousarray(origins), np.ascontiguousarray(directions)
        return Hit(*self._tree.cast(origins, directions, True))

    def look(self, camera: Camera) -> Seen:
        """Find the face and the depth that a camera sees at each pixel."""
        shape = camera.height, camera.width
        faces, depth = self._from(camera, np.stack([*_ways(camera)], axis=-1).reshape(-1, 3))
        return Seen(faces.reshape(shape), depth.astype(np.float32).reshape(shape))

    def faces_in(self, camera: Camera, pixels: Bool[np.ndarray, "H W"]) -> Int32[np.ndarray, " N"]:
        """Find the face that a camera sees in each of some pixels, row by row; -1: none."""
        return self._from(camera, np.stack([ways[pixels] for ways in _ways(camera)], axis=-1))[0]

    def _from(
        self, camera: Camera, ways: Float64[np.ndarray, "N 3"]
    ) -> tuple[Int32[np.ndarray, " N"], Float64[np.ndarray, " N"]]:
        """Return the faces that rays of a camera meet, and the distances in lengths of their ways."""
        if self._tree is None:
            return np.full(len(ways), -1, np.int32), np.full(len(ways), np.inf)
        return self._tree.cast(camera.eye[None], ways, False)[:2]

    def backs(self, camera: Camera, seen: Seen) -> Bool[np.ndarray, "H W"]:
        """Return a mask of the pixels that see the back of a face; `seen` is the result of `look`."""
        if self._mesh.is_empty:
            return np.zeros(seen.faces.shape, bool)
        normals = self._normals[seen.faces]  # arbitrary where no face is seen
        along = sum(normals[..., axis] * ways for axis, ways in enumerate(_ways(camera)))
        return (along > 0) & (seen.faces >= 0)

    @cached_property
    def _normals(self) -> Float64[np.ndarray, "F 3"]:
        return face_normals(self._mesh)[0]


def pixels_near(camera: Camera, mesh: Mesh) -> Bool[np.ndarray, "H W"]:
    """Return a mask of pixels that contains all that see faces: the boxes of projected faces, a pixel wider.

    If the camera's plane cuts a face, these are all pixels.
    """
    local = camera.local(mesh.vertices)
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


def _ways(camera: Camera) -> Iterator[Float64[np.ndarray, "H W"]]:
    """Yield the ray directions of all pixels, one world axis at a time; each goes one metre along the optical axis."""
    columns, rows = np.arange(camera.width) + 0.5, np.arange(camera.height)[:, None] + 0.5
    for right, down, ahead in products(inverse(camera.extrinsic[:3, :3]), inverse(camera.intrinsic)):
        yield right * columns + (down * rows + ahead)
