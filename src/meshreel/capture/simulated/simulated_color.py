"""Simulation of colour cameras: what they would see of a mesh whose colours are known, with sensor errors.

In: a mesh, the colours of places on it, a depth camera beside which the colour camera is. Out: pictures.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from jaxtyping import Float64, Int64, UInt8

from ...errors import InputError
from ...geometry.raycast import Rays
from ...geometry.strict import products
from ...geometry.topology import face_normals
from ...types import Mesh
from ..rig.cameras import DepthCamera, posed

# Colours, 0 to 255, of places and the faces that they are on.
Painter = Callable[[Float64[np.ndarray, "N 3"], Int64[np.ndarray, " N"]], Float64[np.ndarray, "N 3"]]
AMBIENT = 0.8  # of the light that comes from everywhere (guess)
LIGHT = (0.3, 0.9, 0.3)  # where the rest comes from, at first; it turns about the second axis (guess)
TURNS = 0.02  # of the light a frame, rad (guess)


@dataclass(frozen=True, slots=True)
class ColorSensorOptions:
    """Errors of colour cameras."""

    scale: float = 2.0  # pixels of a colour picture's width for each of a depth picture's
    gain: float = 0.0  # standard deviation of a camera's exposure, as a share
    balance: float = 0.0  # the same of each channel's
    blur: float = 0.5  # pixels, standard deviation
    noise: float = 1.5  # levels of 255, standard deviation
    pose_error: float = 0.0  # degrees, standard deviation of the error in the rig's file

    def __post_init__(self) -> None:
        numbers = (self.gain, self.balance, self.blur, self.noise, self.pose_error)
        if not all(math.isfinite(value) and value >= 0 for value in numbers) or not 0.1 <= self.scale <= 16:
            raise InputError(f"color sensor {numbers}, scale {self.scale:g}: give numbers from 0 on, scale 0.1 to 16")


@dataclass(frozen=True, slots=True)
class SimulatedColor:
    """A colour camera with the eyes of a depth camera."""

    camera: DepthCamera  # with the size and the numbers of the colour pictures
    gains: Float64[np.ndarray, "3"]  # of the channels
    sensor: ColorSensorOptions

    @staticmethod
    def beside(depth: DepthCamera, sensor: ColorSensorOptions, random: np.random.Generator) -> SimulatedColor:
        """Return a camera in the place of a depth camera, with errors of its own."""
        width, height = (round(side * sensor.scale) for side in (depth.view.width, depth.view.height))
        camera = replace(depth, view=depth.view.resized(width, height))
        gains = np.exp(sensor.gain * random.standard_normal() + sensor.balance * random.standard_normal(3))
        return SimulatedColor(camera, gains, sensor)

    def record(self, folder: str, random: np.random.Generator) -> dict[str, Any]:
        """Return the object of `rig.json` that describes it, with the error of its pose."""
        known = posed(self.camera, turned(self.camera.view.pose.to_world, self.sensor.pose_error, random)).record()
        names = ("width", "height", "fx", "fy", "cx", "cy", "camera_to_world")
        return {"folder": folder} | {name: known[name] for name in names}

    def picture(
        self, mesh: Mesh, paint: Painter, frame: int, random: np.random.Generator
    ) -> UInt8[np.ndarray, "H W 3"]:
        """Render a mesh in a frame as the camera sees it, on black."""
        from scipy.ndimage import gaussian_filter

        camera = self.camera.view
        seen = Rays(mesh).look(camera)
        rows, columns = np.nonzero(seen.faces >= 0)
        depth, faces = seen.depth[rows, columns].astype(np.float64), seen.faces[rows, columns].astype(np.int64)
        ahead = np.linalg.solve(camera.intrinsic, np.stack([columns + 0.5, rows + 0.5, np.ones(len(rows))])).T
        to_world = camera.pose.to_world
        points = products(ahead * depth[:, None], to_world[:3, :3].T) + to_world[:3, 3]
        image = np.zeros((*seen.faces.shape, 3))
        image[rows, columns] = paint(points, faces) * shade_of(mesh, faces, frame)[:, None] * self.gains
        image = np.stack([gaussian_filter(image[..., k], self.sensor.blur) for k in range(3)], axis=2)
        image += self.sensor.noise * random.standard_normal(image.shape)
        return np.clip(np.rint(image), 0, 255).astype(np.uint8)


def turned(pose: Float64[np.ndarray, "4 4"], degrees: float, random: np.random.Generator) -> Float64[np.ndarray, "4 4"]:
    """Return a pose that is wrong by a turn with this standard deviation."""
    from scipy.spatial.transform import Rotation

    wrong = pose.copy()
    wrong[:3, :3] = Rotation.from_rotvec(degrees * random.standard_normal(3), degrees=True).as_matrix() @ pose[:3, :3]
    return wrong


def shade_of(mesh: Mesh, faces: Int64[np.ndarray, " N"], frame: int) -> Float64[np.ndarray, " N"]:
    """Return the share of light that faces have in a frame; part of it turns about the second axis."""
    x, y, z = np.array(LIGHT) / np.linalg.norm(LIGHT)
    c, s = math.cos(TURNS * frame), math.sin(TURNS * frame)
    light = np.array([c * x + s * z, y, c * z - s * x])
    return AMBIENT + (1 - AMBIENT) * np.abs(face_normals(mesh)[0][faces] @ light)
