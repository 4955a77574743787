"""Pictures of surface normals by ray casting, without GL, window or lighting.

A pixel that a mesh covers has the color (n + 1) / 2 of the interpolated vertex normal n in world axes, as in the paper
(section 4.1); all others are white, the default background of Open3D's viewer. Faces are visible from both sides, with
the same normal.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Bool, Float32, Float64, Int32

from ..geometry.cameras import Rays
from ..geometry.topology import blend
from ..types import Mesh
from .normals import interpolate, welded_normals
from .surface_samples import used_surface
from .viewpoints import AnyCamera

BACKGROUND = 1.0  # white


@dataclass(frozen=True, slots=True)
class Crop:
    """Crop of a picture, a rectangle of pixels: rows top to bottom, columns left to right, ends excluded."""

    top: int
    bottom: int
    left: int
    right: int

    @property
    def shape(self) -> tuple[int, int]:
        return self.bottom - self.top, self.right - self.left


@dataclass(frozen=True, slots=True)
class View:
    """Surface that one camera sees in one crop."""

    crop: Crop
    covered: Bool[np.ndarray, "H W"]
    mesh: Mesh
    corners: Int32[np.ndarray, "N 3"]  # vertices of the faces that the covered pixels see, row by row
    weights: Float64[np.ndarray, "N 3"]  # barycentric, of the points where their rays end
    normals: Float64[np.ndarray, "N 3"]

    @property
    def points(self) -> Float64[np.ndarray, "N 3"]:
        """End points of the covered pixels' rays in world coordinates, m."""
        return blend(self.mesh.vertices, self.corners, self.weights)

    @property
    def colors(self) -> Float32[np.ndarray, "H W 3"]:
        """The normal-colored picture of the crop, 0 to 1."""
        image = np.full((*self.covered.shape, 3), BACKGROUND, dtype=np.float32)
        image[self.covered] = (self.normals + 1) / 2
        return image


def crop_of(meshes: list[Mesh], camera: AnyCamera, border: int = 8) -> Crop:
    """Return the crop of all pixels that can see a mesh, widened by `border` pixels and clipped to the image."""
    full = Crop(0, camera.height, 0, camera.width)
    vertices = np.concatenate([m.vertices for m in meshes])
    if len(vertices) == 0:
        return Crop(0, 0, 0, 0)
    pixels = camera.project(_to_camera(vertices, camera))
    if not np.isfinite(pixels).all():  # something reaches behind the eye: no rectangle bounds it
        return full
    limits = np.array([camera.width, camera.height])
    low = np.clip(np.floor(pixels.min(axis=0)) - border, 0, limits).astype(int)
    high = np.clip(np.ceil(pixels.max(axis=0)) + border, 0, limits).astype(int)
    return Crop(int(low[1]), int(high[1]), int(low[0]), int(high[0]))


def look(mesh: Mesh, camera: AnyCamera, crop: Crop) -> View:
    return Visible(mesh).look(Pixels(camera, crop))


@runtime_checkable
class Picture(Protocol):
    """Picture of a mesh in a crop: a `View`, or one in the mesh's own colours."""

    @property
    def covered(self) -> Bool[np.ndarray, "H W"]:
        """Pixels that see the mesh."""

    @property
    def colors(self) -> Float32[np.ndarray, "H W 3"]:
        """Colors, 0 to 1."""


class Pixels:
    """Crop of a camera's picture, with the rays through its pixels, which all meshes rendered there share."""

    def __init__(self, camera: AnyCamera, crop: Crop) -> None:
        self.camera, self.crop = camera, crop

    @cached_property
    def rays(self) -> tuple[Float64[np.ndarray, "N 3"], Float64[np.ndarray, "N 3"]]:
        """Origins and unit directions of the rays in the camera frame, row by row."""
        crop = self.crop
        rows, columns = np.mgrid[crop.top : crop.bottom, crop.left : crop.right]
        return self.camera.rays(np.column_stack([columns.ravel(), rows.ravel()]) + 0.5)

    @cached_property
    def world_rays(self) -> tuple[Float64[np.ndarray, "N 3"], Float64[np.ndarray, "N 3"]]:
        """Origins and unit directions of the same rays in world coordinates."""
        (origins, directions), pose = self.rays, self.camera.extrinsic
        return (origins - pose[:3, 3]) @ pose[:3, :3], directions @ pose[:3, :3]


class Visible:
    """A mesh prepared for several views: its surface and its normals are computed once."""

    def __init__(self, mesh: Mesh) -> None:
        self.mesh = used_surface(mesh)
        self._normals, self._rays = welded_normals(self.mesh), Rays(self.mesh)

    def look(self, pixels: Pixels) -> View:
        mesh, crop = self.mesh, pixels.crop
        if mesh.is_empty or 0 in crop.shape:
            covered, nothing = np.zeros(crop.shape, dtype=bool), np.zeros((0, 3))
            return View(crop, covered, mesh, nothing.astype(np.int32), nothing, nothing)
        answer = self._rays.cast(*pixels.world_rays)
        hit = answer.faces >= 0
        corners, weights = mesh.faces[answer.faces[hit]], answer.barycentric[hit]
        normals = interpolate(self._normals, corners, weights)
        return View(crop, hit.reshape(crop.shape), mesh, corners, weights, normals)


def _to_camera(vertices: Float64[np.ndarray, "V 3"], camera: AnyCamera) -> Float64[np.ndarray, "V 3"]:
    rotation = camera.extrinsic[:3, :3]
    eye = -np.linalg.solve(rotation, camera.extrinsic[:3, 3])
    return (vertices - eye) @ rotation.T
