"""Pictures of meshes by the core's rasteriser: the face, the depth and the place that each pixel of a camera sees.

Faces are seen from both sides. Corners are rounded to 1/256 pixel, faces that share an edge leave no gap, and the bits
are the same on every machine. Rays that make no picture are `cameras.Rays`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Bool, Float32, Float64, Int32, Int64

from .. import _core
from ..types import Mesh
from .cameras import Camera
from .strict import products
from .topology import blend


@dataclass(frozen=True, slots=True)
class Parallel:
    """Camera with parallel rays, which begin behind everything."""

    width: int  # pixels
    height: int  # pixels
    pixel: float  # side of a pixel, in the unit of the vertices
    extrinsic: Float64[np.ndarray, "4 4"]  # world to camera

    def project(self, points: Float64[np.ndarray, "N 3"]) -> Float64[np.ndarray, "N 2"]:
        """Project points of the camera frame to image positions."""
        return points[:, :2] / self.pixel + np.array([self.width, self.height]) / 2

    def record(self) -> dict[str, Any]:
        """Return the camera as a record like Open3D's, with the side of a pixel in place of intrinsics."""
        place = {"class_name": "OrthographicCamera", "extrinsic": self.extrinsic.T.reshape(-1).tolist()}
        return place | {"size": [self.width, self.height], "pixel_m": self.pixel}


Viewer = Camera | Parallel
Corners = Int64[np.ndarray, "N 2"]  # of boxes of pixels, column and row
Numbers = Int64[np.ndarray, " _"]


@dataclass(frozen=True, slots=True)
class Crop:
    """Crop of a picture, a rectangle of pixels: rows top to bottom, columns left to right, ends excluded."""

    top: int
    bottom: int
    left: int
    right: int

    @staticmethod
    def whole(camera: Viewer) -> Crop:
        """Return all pixels of a camera."""
        return Crop(0, camera.height, 0, camera.width)

    @property
    def shape(self) -> tuple[int, int]:
        return self.bottom - self.top, self.right - self.left


@dataclass(frozen=True, slots=True)
class Seen:
    """Face and depth that a camera sees at each pixel."""

    faces: Int32[np.ndarray, "H W"]  # the paper's eq. 1; -1: none
    depth: Float32[np.ndarray, "H W"]  # m, along the optical axis; infinite: none


@dataclass(frozen=True, slots=True)
class SeenPlaces:
    """Places on a mesh that a camera sees at the N pixels that it covers, row by row."""

    mesh: Mesh
    covered: Bool[np.ndarray, "H W"]
    faces: Int32[np.ndarray, " N"]
    depth: Float64[np.ndarray, " N"]  # along the optical axis
    barycentric: Float64[np.ndarray, "N 3"]  # weights of the face's three vertices

    @property
    def points(self) -> Float64[np.ndarray, "N 3"]:
        """The places in the coordinates of the mesh."""
        return blend(self.mesh.vertices, self.mesh.faces[self.faces], self.barycentric)


def box_pixels(low: Corners, high: Corners, order: Numbers) -> tuple[Numbers, Numbers, Numbers]:
    """Return box, column and row of each pixel in boxes of pixels, these in an order; `high` is beyond the last."""
    sides = np.maximum(high - low, 0)
    counts = sides[order, 0] * sides[order, 1]
    index = np.repeat(order, counts)
    within = np.arange(len(index)) - np.repeat(np.cumsum(counts) - counts, counts)
    rows = within // sides[index, 0]
    return index, low[index, 0] + within - rows * sides[index, 0], low[index, 1] + rows


def draw(mesh: Mesh, camera: Viewer, crop: Crop | None = None) -> Seen:
    """Return the face and the depth at each pixel of a crop; a lens is taken to have no distortion."""
    faces, depth, _ = _drawn(mesh, camera, crop, False)
    return Seen(faces, depth.astype(np.float32))


def draw_places(mesh: Mesh, camera: Viewer, crop: Crop | None = None) -> SeenPlaces:
    """Return the places that the pixels of a crop see; a lens is taken to have no distortion."""
    faces, depth, weights = _drawn(mesh, camera, crop, True)
    covered = faces >= 0
    return SeenPlaces(mesh, covered, faces[covered], depth[covered], weights)


def backs(normals: Float64[np.ndarray, "F 3"], camera: Camera, seen: Seen) -> Bool[np.ndarray, "H W"]:
    """Return a mask of the pixels that see the back of a face, by the faces' normals and the result of `draw`."""
    covered, found = seen.faces >= 0, np.zeros(seen.faces.shape, bool)
    own = products(normals, camera.extrinsic[:3, :3].T)[seen.faces[covered]]
    found[covered] = np.einsum("nd,nd->n", own, camera.ahead[covered]) > 0
    return found


def _drawn(mesh: Mesh, camera: Viewer, crop: Crop | None, weighted: bool) -> tuple[Any, Any, Any]:
    crop = Crop.whole(camera) if crop is None else crop
    if isinstance(camera, Parallel):
        lens = [1 / camera.pixel, 1 / camera.pixel, camera.width / 2, camera.height / 2]
    else:
        lens = [*camera.focal, *camera.center]
    rectangle = np.array([crop.left, crop.top, crop.right - crop.left, crop.bottom - crop.top], np.int32)
    turn, shift = (np.ascontiguousarray(part) for part in (camera.extrinsic[:3, :3], camera.extrinsic[:3, 3]))
    return _core.draw(
        mesh.vertices, mesh.faces, turn, shift, np.array(lens), isinstance(camera, Parallel), rectangle, weighted
    )
