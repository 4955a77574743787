"""Fixed views around a bounding box, for renderings and SSIM, and their file (Open3D's pinhole camera JSON)."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from jaxtyping import Float64

from ..errors import InputError
from ..geometry.cameras import Camera, CameraPose, matrix_of, unpack_cameras
from ..io.files import read_input
from ..types import UP_AXES, Mesh, check_up

MARGIN = 1.05  # times the box, so that nothing touches the border (guess)


@dataclass(frozen=True, slots=True)
class ViewOptions:
    """Size, field of view and orientation of four views around a bounding box."""

    width: int = 1920  # pixels
    height: int = 1080  # pixels
    fov: float = 60.0  # degrees, vertical
    up: str = "y"  # the axis that points up: y, z, -y or -z

    def __post_init__(self) -> None:
        if self.width < 8 or self.height < 8:
            raise InputError(f"view size {self.width} x {self.height}: give at least 8 x 8 pixels")
        check_up(self.up)


@dataclass(frozen=True, slots=True)
class Box:
    """An axis-aligned bounding box, m."""

    low: Float64[np.ndarray, " 3"]
    high: Float64[np.ndarray, " 3"]

    @staticmethod
    def of(sequence: Iterable[Mesh]) -> Box:
        """Return the box around all frames, read one at a time; a unit box around 0 if no frame has a vertex."""
        boxes = [mesh.box for mesh in sequence if len(mesh.vertices)] or [(np.full(3, -0.5), np.full(3, 0.5))]
        lows, highs = zip(*boxes, strict=True)
        return Box(np.min(lows, axis=0), np.max(highs, axis=0))

    @property
    def center(self) -> Float64[np.ndarray, " 3"]:
        return (self.low + self.high) / 2

    @property
    def size(self) -> Float64[np.ndarray, " 3"]:
        return self.high - self.low


def views_around(box: Box, options: ViewOptions = ViewOptions()) -> list[Camera]:
    """Return perspective views of the box from its front, right, back and left, all at the same distance.

    The viewer of the front is at +z if y is up and at -y if z is up; at -z and +y if -y and -z are up.
    """
    across, height = extent(box, options.up)
    tangent = math.tan(math.radians(options.fov) / 2)
    distance = across / 2 + MARGIN * max(height, across * options.height / options.width) / 2 / tangent
    focal = options.height / 2 / tangent
    option = Camera(options.width, options.height, (focal, focal), (options.width / 2, options.height / 2))
    poses = [CameraPose.of_world(looking(box.center, axes, distance)) for axes in sides(options.up)]
    return [replace(option, pose=pose) for pose in poses]


def read_cameras(path: Path) -> list[Camera]:
    """Read the cameras of an Open3D PinholeCameraParameters or PinholeCameraTrajectory JSON file."""
    return unpack_cameras(read_input(path, "give Open3D pinhole camera JSON"), str(path))


def extent(box: Box, up: str) -> tuple[float, float]:
    """Return the larger horizontal side and the height of the box, both above 0."""
    vertical = int(np.abs(UP_AXES[up]).argmax())
    least = float(box.size.max()) * 1e-3 or 1.0
    return max(float(np.delete(box.size, vertical).max()), least), max(float(box.size[vertical]), least)


def sides(up: str) -> list[np.ndarray]:
    """Return the rows right, down and forward of each view."""
    above = np.array(UP_AXES[up])
    front = np.array([0.0, -above[2], above[1]])
    side = np.cross(above, front)
    return [np.stack([np.cross(-to, above), -above, -to]) for to in (front, side, -front, -side)]


def looking(target: np.ndarray, axes: np.ndarray, distance: float) -> Float64[np.ndarray, "4 4"]:
    """Return the pose, world to camera, that looks at a target from a distance along the last of these axes."""
    return matrix_of(axes, -axes @ (target - distance * axes[2]))
