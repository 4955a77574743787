"""Pinhole cameras, packed into and unpacked from Open3D's pinhole camera JSON.

A camera looks along +z of its own frame, with x to the right and y down, as in Open3D and OpenCV. Pixel (column i,
row j) covers [i, i + 1) x [j, j + 1); its ray goes through the middle.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float64, Int64

from ..errors import InputError
from .strict import inverse, products

_RIGID = 1e-3  # largest error of an entry of R R^T: some tools write few digits (guess)
_LARGEST = 1e9  # largest number of a matrix: keeps everything computed from it finite (guess)


def looking_at(
    eye: Float64[np.ndarray, "3"], target: Float64[np.ndarray, "3"], up: int = 1
) -> Float64[np.ndarray, "4 4"]:
    """Return the matrix from camera to world of a camera at a place that looks at another; axis `up` points up."""
    forward = target - eye
    forward /= np.linalg.norm(forward)
    right = np.cross(forward, np.eye(3)[up])
    right /= np.linalg.norm(right)
    pose = np.eye(4)
    pose[:3, :3] = np.stack([right, np.cross(forward, right), forward], axis=1)
    pose[:3, 3] = eye
    return pose


@dataclass(frozen=True, slots=True, eq=False)
class PinholeCamera:
    """Perspective camera; cameras with equal numbers are equal, so that options with cameras can be compared."""

    width: int
    height: int
    intrinsic: Float64[np.ndarray, "3 3"]  # pixels; the last row is 0 0 1
    extrinsic: Float64[np.ndarray, "4 4"]  # world to camera

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, PinholeCamera):
            return NotImplemented
        sizes = (self.width, self.height) == (other.width, other.height)
        pairs = ((self.intrinsic, other.intrinsic), (self.extrinsic, other.extrinsic))
        return sizes and all(np.array_equal(a, b) for a, b in pairs)

    def __hash__(self) -> int:
        return hash((self.width, self.height))

    @property
    def eye(self) -> Float64[np.ndarray, " 3"]:
        """Position of the camera in world coordinates."""
        return -products(inverse(self.extrinsic[:3, :3]), self.extrinsic[:3, 3:])[:, 0]

    def rays(self, pixels: Float64[np.ndarray, "N 2"]) -> tuple[np.ndarray, np.ndarray]:
        """Return the rays from the eye through image positions: origins and unit directions in the camera frame."""
        homogeneous = np.column_stack([pixels, np.ones(len(pixels))])
        directions = products(homogeneous, inverse(self.intrinsic).T)
        return np.zeros_like(directions), directions / np.linalg.norm(directions, axis=1)[:, None]

    def project(self, points: Float64[np.ndarray, "N 3"]) -> Float64[np.ndarray, "N 2"]:
        """Project points of the camera frame to image positions; points that are not in front give NaN."""
        depth = np.where(points[:, 2:] > 0, points[:, 2:], np.nan)
        return products(points, self.intrinsic.T)[:, :2] / depth

    def seen(
        self, points: Float64[np.ndarray, "P 3"]
    ) -> tuple[Int64[np.ndarray, " N"], Int64[np.ndarray, " N"], Float64[np.ndarray, " N"]]:
        """Project points of the world; return the pixels, counted row by row, of those inside the picture, the numbers
        of these points, and their depths.
        """
        local = products(points, self.extrinsic[:3, :3].T) + self.extrinsic[:3, 3]
        with np.errstate(invalid="ignore"):
            columns, rows = np.floor(self.project(local)).T
        inside = np.flatnonzero((columns >= 0) & (columns < self.width) & (rows >= 0) & (rows < self.height))
        pixels = rows[inside].astype(np.int64) * self.width + columns[inside].astype(np.int64)
        return pixels, inside, local[inside, 2]

    def record(self) -> dict[str, Any]:
        """Return the camera as a record of Open3D's JSON, in which matrices are stored column by column."""
        return {
            "class_name": "PinholeCameraParameters",
            "extrinsic": self.extrinsic.T.reshape(-1).tolist(),
            "intrinsic": {
                "height": self.height,
                "intrinsic_matrix": self.intrinsic.T.reshape(-1).tolist(),
                "width": self.width,
            },
            "version_major": 1,
            "version_minor": 0,
        }


def scaled_lens(
    focal: tuple[float, float], center: tuple[float, float], x: float, y: float
) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return focal lengths and principal point, pixels, of pictures that are scaled; the middle of pixel i is at i."""
    return (focal[0] * x, focal[1] * y), ((center[0] + 0.5) * x - 0.5, (center[1] + 0.5) * y - 0.5)


def pack_cameras(cameras: Sequence[PinholeCamera]) -> bytes:
    """Pack cameras into the JSON of an Open3D PinholeCameraTrajectory."""
    record = {
        "class_name": "PinholeCameraTrajectory",
        "parameters": [camera.record() for camera in cameras],
        "version_major": 1,
        "version_minor": 0,
    }
    return (json.dumps(record, indent=1) + "\n").encode()


def unpack_cameras(data: bytes, name: str) -> list[PinholeCamera]:
    """Unpack an Open3D PinholeCameraParameters or PinholeCameraTrajectory; errors name the data `name`."""
    found: list[PinholeCamera] = []
    try:
        record = json.loads(data)
        for entry in record.get("parameters", [record]):
            found.append(_camera(entry))
        return found
    except (UnicodeDecodeError, json.JSONDecodeError, RecursionError) as error:
        raise InputError(f"{name}: cannot read cameras ({error}); give Open3D pinhole camera JSON") from error
    except (KeyError, TypeError, ValueError, AttributeError, OverflowError, np.linalg.LinAlgError) as error:
        text = f"{name}: not Open3D pinhole camera JSON (camera number {len(found)}: {error!r})"
        raise InputError(f"{text}; mend it or leave it out") from error


def _camera(entry: dict[str, Any]) -> PinholeCamera:
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
    if not (intrinsic[0, 0] > 0 and intrinsic[1, 1] > 0):
        raise ValueError(f"focal lengths {intrinsic[0, 0]:g} and {intrinsic[1, 1]:g}, not above 0")
    turn = extrinsic[:3, :3]
    if np.abs(turn @ turn.T - np.eye(3)).max() > _RIGID or np.linalg.det(turn) < 0:
        raise ValueError("an extrinsic matrix that is no rotation with a translation, column by column")
    if not np.allclose(extrinsic[3], (0, 0, 0, 1)):
        raise ValueError(f"an extrinsic matrix whose last row is {extrinsic[3].tolist()} and not 0 0 0 1")
    np.linalg.inv(intrinsic)  # raises where singular
    return PinholeCamera(width, height, intrinsic, extrinsic)
