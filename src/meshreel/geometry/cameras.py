"""Pinhole cameras, rays that meet a mesh, and the packing of cameras into Open3D's pinhole camera JSON.

A camera looks along +z of its own frame, with x to the right and y down, as in Open3D and OpenCV. Pixel (column i,
row j) covers [i, i + 1) x [j, j + 1), and its middle is at i + 1/2, j + 1/2. Files in which the middles of pixels are
whole numbers (rig.json, calibrations of OpenCV) are converted where they are read and written.

Rays are cast by the core's tree of boxes: it decides in float32, about the middle of the mesh, which face a ray meets;
the distance to it is float64. Pictures from a camera are drawn (`drawing`).
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from jaxtyping import Float64, Int32, Int64

from .. import _core
from ..errors import InputError
from ..texts import json_of
from ..types import Mesh, Placement
from .strict import inverse, products

Matrix = Float64[np.ndarray, "4 4"]
Points = Float64[np.ndarray, "N 3"]
Numbers = Int64[np.ndarray, " N"]
Lengths = Float64[np.ndarray, "*S"]
_RIGID = 1e-3  # largest error of an entry of R R^T: some tools write few digits (guess)
_VERSION = {"version_major": 1, "version_minor": 0}  # of Open3D's JSON
_LARGEST = 1e9  # largest number of a matrix: keeps everything computed from it finite (guess)


def matrix_of(turn: Float64[np.ndarray, "3 3"], shift: Float64[np.ndarray, "3"]) -> Matrix:
    """Return the matrix of a rotation followed by a translation."""
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = turn, shift
    return matrix


def looking_at(eye: Float64[np.ndarray, "3"], target: Float64[np.ndarray, "3"], up: int = 1) -> Matrix:
    """Return the matrix from camera to world of a camera at a place that looks at another; axis `up` points up."""
    forward = target - eye
    forward /= np.linalg.norm(forward)
    right = np.cross(forward, np.eye(3)[up])
    right /= np.linalg.norm(right)
    return matrix_of(np.stack([right, np.cross(forward, right), forward], axis=1), eye)


def broken(matrix: Matrix) -> str:
    """Return why a matrix is no rotation with a translation, as a clause that follows its name; empty if it is one."""
    if not np.isfinite(matrix).all():
        return "has a number that is not finite"
    turn, last = matrix[:3, :3], matrix[3].tolist()
    if not np.allclose(last, (0, 0, 0, 1)):
        return f"is no pose: its last row is {last} and not 0 0 0 1"
    if np.abs(turn @ turn.T - np.eye(3)).max() > _RIGID or np.linalg.det(turn) < 0:
        return "is no rotation with a translation"
    return ""


@dataclass(frozen=True, slots=True, eq=False)
class CameraPose:
    """Place of a camera in the world: both matrices are stored, so that the given one keeps its bits."""

    to_world: Matrix  # camera to world
    from_world: Matrix  # world to camera

    @staticmethod
    def of_camera(to_world: Matrix) -> CameraPose:
        """Return the pose of a matrix from camera to world."""
        return CameraPose(to_world, np.linalg.inv(to_world))

    @staticmethod
    def of_world(from_world: Matrix) -> CameraPose:
        """Return the pose of a matrix from world to camera, which other programs call extrinsic."""
        return CameraPose(np.linalg.inv(from_world), from_world)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, CameraPose) and np.array_equal(self.from_world, other.from_world)

    def __hash__(self) -> int:
        return hash(tuple(self.from_world.flat))


@dataclass(frozen=True, slots=True)
class Camera:
    """Pinhole camera whose lens distorts by OpenCV's `k1 k2 p1 p2 k3 k4 k5 k6`; equal numbers make equal cameras.

    Rays and what is computed from them leave the bends out.
    """

    width: int  # pixels
    height: int  # pixels
    focal: tuple[float, float]  # pixels, along x and y
    center: tuple[float, float]  # pixels, where the optical axis meets the picture
    pose: CameraPose = CameraPose.of_camera(np.eye(4))
    distortion: tuple[float, ...] = ()  # missing coefficients are 0

    @staticmethod
    def of(width: int, height: int, intrinsic: Float64[np.ndarray, "3 3"], extrinsic: Matrix) -> Camera:
        """Return the camera of two matrices: camera coordinates to homogeneous pixels, and world to camera."""
        (fx, _, cx), (_, fy, cy) = intrinsic[:2].tolist()
        return Camera(width, height, (fx, fy), (cx, cy), CameraPose.of_world(extrinsic))

    @property
    def intrinsic(self) -> Float64[np.ndarray, "3 3"]:
        """Camera coordinates to homogeneous pixels."""
        return np.array([[self.focal[0], 0.0, self.center[0]], [0.0, self.focal[1], self.center[1]], [0.0, 0.0, 1.0]])

    @property
    def extrinsic(self) -> Matrix:
        """World to camera."""
        return self.pose.from_world

    @property
    def eye(self) -> Float64[np.ndarray, " 3"]:
        """Position of the camera in world coordinates."""
        return -products(inverse(self.extrinsic[:3, :3]), self.extrinsic[:3, 3:])[:, 0]

    @property
    def straight(self) -> Camera:
        """The camera without the distortion of its lens."""
        return replace(self, distortion=())

    def resized(self, width: int, height: int) -> Camera:
        """Return the camera with the same view in pictures of another size."""
        x, y = width / self.width, height / self.height
        focal, center = (self.focal[0] * x, self.focal[1] * y), (self.center[0] * x, self.center[1] * y)
        return replace(self, width=width, height=height, focal=focal, center=center)

    def placed(self, place: Placement) -> Camera:
        """Return the camera for places in normalised coordinates, in which depths are normalised, too."""
        origin, extrinsic = np.asarray(place.origin), self.extrinsic.copy()
        extrinsic[:3, 3] = (products(extrinsic[:3, :3], origin[:, None])[:, 0] + extrinsic[:3, 3]) / place.scale
        return replace(self, pose=CameraPose.of_world(extrinsic))

    def local(self, points: Points) -> Points:
        """Return points of the world in the camera frame."""
        return products(points, self.extrinsic[:3, :3].T) + self.extrinsic[:3, 3]

    @property
    def ahead(self) -> Float64[np.ndarray, "H W 3"]:
        """The point at depth 1 that each pixel sees, in the camera frame."""
        rows, columns = np.mgrid[: self.height, : self.width] + 0.5
        (fx, fy), (cx, cy) = self.focal, self.center
        return np.stack([(columns - cx) / fx, (rows - cy) / fy, np.ones(rows.shape)], axis=-1)

    def project(self, points: Float64[np.ndarray, "N 3"]) -> Float64[np.ndarray, "N 2"]:
        """Project points of the camera frame to image positions; points that are not in front give NaN."""
        depth = np.where(points[:, 2:] > 0, points[:, 2:], np.nan)
        if not any(self.distortion):
            return products(points, self.intrinsic.T)[:, :2] / depth
        with np.errstate(all="ignore"):
            x, y = bent(points[:, 0] / depth[:, 0], points[:, 1] / depth[:, 0], self.distortion)
        return products(np.stack([x, y, np.ones(len(x))], axis=1), self.intrinsic.T)[:, :2]

    def seen(self, points: Float64[np.ndarray, "P 3"]) -> tuple[Numbers, Numbers, Float64[np.ndarray, " N"]]:
        """Project points of the world; return what `pixels` does, and the depths of the points inside the picture."""
        local = self.local(points)
        pixels, inside = self.pixels(local)
        return pixels, inside, local[inside, 2]

    def pixels(self, points: Float64[np.ndarray, "P 3"]) -> tuple[Numbers, Numbers]:
        """Project points of the camera frame; return the pixels, counted row by row, of those inside the picture, and
        the numbers of these points.
        """
        with np.errstate(invalid="ignore"):
            columns, rows = np.floor(self.project(points)).T
        inside = np.flatnonzero((columns >= 0) & (columns < self.width) & (rows >= 0) & (rows < self.height))
        return rows[inside].astype(np.int64) * self.width + columns[inside].astype(np.int64), inside

    def record(self) -> dict[str, Any]:
        """Return the camera as a record of Open3D's JSON, in which matrices are stored column by column."""
        matrix, extrinsic = self.intrinsic.T.reshape(-1).tolist(), self.extrinsic.T.reshape(-1).tolist()
        intrinsic = {"height": self.height, "intrinsic_matrix": matrix, "width": self.width}
        return {"class_name": "PinholeCameraParameters", "extrinsic": extrinsic, "intrinsic": intrinsic} | _VERSION


def bent(x: Lengths, y: Lengths, distortion: tuple[float, ...]) -> tuple[Lengths, Lengths]:
    """Return where a lens shows places of the plane at depth 1; `distortion` is OpenCV's, missing numbers are 0."""
    k1, k2, p1, p2, k3, k4, k5, k6 = (*distortion, *[0.0] * 8)[:8]
    r2 = x * x + y * y
    bend = (1 + r2 * (k1 + r2 * (k2 + r2 * k3))) / (1 + r2 * (k4 + r2 * (k5 + r2 * k6)))
    bent_x = x * bend + 2 * p1 * x * y + p2 * (r2 + 2 * x * x)
    return bent_x, y * bend + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y


def pack_cameras(cameras: Sequence[Camera]) -> bytes:
    """Pack cameras into the JSON of an Open3D PinholeCameraTrajectory."""
    parameters = [camera.record() for camera in cameras]
    record = {"class_name": "PinholeCameraTrajectory", "parameters": parameters} | _VERSION
    return (json.dumps(record, indent=1) + "\n").encode()


def unpack_cameras(data: bytes, name: str) -> list[Camera]:
    """Unpack an Open3D PinholeCameraParameters or PinholeCameraTrajectory; errors name the data `name`."""
    cameras: list[Camera] = []
    try:
        try:
            record = json_of(data)
        except ValueError as error:
            raise InputError(f"{name}: cannot read cameras ({error}); give Open3D pinhole camera JSON") from error
        for entry in record.get("parameters", [record]):
            cameras.append(_camera(entry))
        return cameras
    except (KeyError, TypeError, ValueError, AttributeError, OverflowError, np.linalg.LinAlgError) as error:
        text = f"{name}: not Open3D pinhole camera JSON (camera number {len(cameras)}: {error!r})"
        raise InputError(f"{text}; mend it or leave it out") from error


def _camera(entry: dict[str, Any]) -> Camera:
    intrinsic = np.array(entry["intrinsic"]["intrinsic_matrix"], dtype=np.float64).reshape(3, 3).T
    extrinsic = np.array(entry["extrinsic"], dtype=np.float64).reshape(4, 4).T
    width, height = int(entry["intrinsic"]["width"]), int(entry["intrinsic"]["height"])
    if not (np.isfinite(intrinsic).all() and np.isfinite(extrinsic).all()):
        raise ValueError("a matrix is not finite")
    if np.abs(intrinsic).max() > _LARGEST or np.abs(extrinsic).max() > _LARGEST:
        raise ValueError(f"a matrix with a number over {_LARGEST:g}")
    if not (8 <= width <= 16384 and 8 <= height <= 16384):
        raise ValueError(f"image size {width} x {height}")
    if not np.array_equal(intrinsic[2], (0, 0, 1)):
        raise ValueError(f"an intrinsic matrix whose last row is {intrinsic[2].tolist()} and not 0 0 1")
    if intrinsic[0, 1] or intrinsic[1, 0]:
        raise ValueError(f"an intrinsic matrix with the skew {intrinsic[0, 1] or intrinsic[1, 0]:g}, not 0")
    if not (intrinsic[0, 0] > 0 and intrinsic[1, 1] > 0):
        raise ValueError(f"focal lengths {intrinsic[0, 0]:g} and {intrinsic[1, 1]:g}, not above 0")
    if reason := broken(extrinsic):
        raise ValueError(f"an extrinsic matrix, column by column, that {reason}")
    return Camera.of(width, height, intrinsic, extrinsic)


@dataclass(frozen=True, slots=True)
class Hit:
    """First intersection of each of N rays with the surface."""

    faces: Int32[np.ndarray, " N"]  # -1: none
    distances: Float64[np.ndarray, " N"]  # in lengths of the ray's direction; infinite: none
    barycentric: Float64[np.ndarray, "N 3"]  # weights of the face's three vertices; (1, 0, 0): none


class Rays:
    """A mesh prepared for ray casting; rays meet faces from both sides, and no ray meets an empty mesh."""

    def __init__(self, mesh: Mesh) -> None:
        self._tree = None if mesh.is_empty else _core.SurfaceTree(mesh.vertices, mesh.faces)

    def cast(self, origins: Float64[np.ndarray, "M 3"], directions: Float64[np.ndarray, "N 3"]) -> Hit:
        """Find the first intersection of each of N rays; they have N origins, or one."""
        if self._tree is None:
            weights = np.zeros((len(directions), 3))
            weights[:, 0] = 1
            return Hit(np.full(len(directions), -1, np.int32), np.full(len(directions), np.inf), weights)
        origins, directions = np.ascontiguousarray(origins), np.ascontiguousarray(directions)
        return Hit(*self._tree.cast(origins, directions, True))
