"""Simulated colour cameras around a procedural person or a painted ball, said to be elsewhere than they are."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache, partial

import numpy as np

from meshreel.capture.calibration.colors import halved
from meshreel.capture.rig.cameras import DepthCamera, posed
from meshreel.capture.simulated.figure import Pose, figure
from meshreel.capture.simulated.implicit import polygonize
from meshreel.capture.simulated.procedural import grid_of_frame
from meshreel.capture.simulated.simulated_rig import ColorSensorOptions, Painter, SimulatedColor
from meshreel.capture.simulated.solid_colors import WALKER, person_colors
from meshreel.geometry.cameras import Camera, CameraPose, looking_at
from meshreel.geometry.color_views import ColorPicture
from meshreel.types import Mesh, MeshSequence
from tests.metrics.shapes import sphere

SPACING = 0.02  # m, of the person's grid
TRUE = ColorSensorOptions()
WRONG = replace(TRUE, gain=0.06, balance=0.02, pose_error=0.2)


@dataclass(frozen=True)
class Shown(MeshSequence):
    """Frames with the cameras that see them."""

    shape: Callable[[int], Mesh]
    paint: Callable[[int], Painter]
    cameras: list[tuple[SimulatedColor, DepthCamera]]  # as they are, and as they are said to be
    count: int
    halvings: int = 0  # of the pictures as they are rendered: each pixel sees its whole area
    frame_rate: float = 30.0

    def __len__(self) -> int:
        return self.count

    def __getitem__(self, index: int) -> Mesh:
        return self.shape(index)

    @property
    def colors(self) -> Shown.Pictures:
        return Shown.Pictures(self)

    @dataclass(frozen=True)
    class Pictures:
        """The pictures as they are taken, each with the pose that its camera is said to have."""

        of: Shown

        def __getitem__(self, index: int) -> list[ColorPicture | None]:
            found = list[ColorPicture | None]()
            for k, (eye, said) in enumerate(self.of.cameras):
                random = np.random.default_rng([index, k])
                pixels = eye.picture(self.of.shape(index), self.of.paint(index), index, random)
                picture = ColorPicture(said.view, pixels)
                for _ in range(self.of.halvings):
                    picture = halved(picture)
                found.append(picture)
            return found


def person(sensor: ColorSensorOptions, count: int) -> Shown:
    """A person who walks on the spot, in stripes and cloth, before six cameras of 1024 x 1280 pixels."""
    fine = replace(sensor, scale=2 * sensor.scale, blur=2 * sensor.blur, noise=2 * sensor.noise)
    return Shown(_walker, lambda index: partial(_cloth, index), around(fine), count, 1)


def ball(cameras: list[tuple[SimulatedColor, DepthCamera]], count: int = 4, detail: float = 60.0) -> Shown:
    """A ball with dents that turns and changes its form; its colours follow its places, and change by `detail`."""

    def paint(_points: np.ndarray, _faces: np.ndarray) -> np.ndarray:
        way = _points @ np.array([[17.0, 5, 3], [-4, 19, 6], [2, -7, 18]])
        return 110 + detail * np.sin(way) * np.cos(0.6 * way[:, [1, 2, 0]])

    return Shown(_dented, lambda _index: paint, cameras, count)


def around(sensor: ColorSensorOptions, count: int = 6, width: int = 512, seed: int = 0) -> list:
    """Cameras on a circle of 2.6 m, every second one higher, that see a whole person."""
    random, height, found = np.random.default_rng(seed), round(1.25 * width), []
    for number in range(count):
        angle = 2 * math.pi * number / count
        eye = np.array([2.6 * math.sin(angle), 1.6 if number % 2 else 0.8, 2.6 * math.cos(angle)])
        pose = looking_at(eye, np.array([0.0, 0.9, 0.0]))
        focal = 0.8 * height / 1.75 * 2.6
        view = Camera(width, height, (focal, focal), (width / 2, height / 2), CameraPose.of_camera(pose))
        found.append(SimulatedColor.beside(DepthCamera(f"c{number}", view), sensor, random))
    poses = [np.array(eye.record("", random)["camera_to_world"]).reshape(4, 4) for eye in found]
    return [(eye, posed(eye.camera, pose)) for eye, pose in zip(found, poses, strict=True)]


def _pose(index: int) -> Pose:
    step = index / 30
    return Pose(np.zeros(3), 0.4 * math.sin(0.1 * index), step, 0.4, softness=math.sin(4 * math.pi * step))


def _walker(index: int) -> Mesh:
    return polygonize((figure(_pose(index), 0.7 * SPACING),), 0.01, grid_of_frame(index, SPACING, 0))


def _cloth(index: int, points: np.ndarray, _faces: np.ndarray) -> np.ndarray:
    return person_colors(_pose(index), 0.7 * SPACING, WALKER, points)


@cache
def _dented(index: int) -> Mesh:
    turn, around_ball = 0.2 * index, sphere(levels=5).vertices
    points = around_ball / np.linalg.norm(around_ball, axis=1)[:, None]
    radius = 0.5 + 0.08 * np.sin(4 * points[:, 0] + turn) * np.cos(3 * points[:, 1] - turn)
    return Mesh.of(points * radius[:, None] + [0, 0.9, 0], sphere(levels=5).faces)
