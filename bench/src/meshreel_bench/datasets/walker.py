"""A person who walks on the spot, seen by six simulated colour cameras that err in exposure and pose; and the truth."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
from jaxtyping import Bool, Float64

from meshreel.capture.calibration.colors import Corrected, corrections_of
from meshreel.capture.recording import open_recording
from meshreel.capture.rig.cameras import DepthCamera
from meshreel.capture.rig.rig import RIG
from meshreel.capture.simulated.figure import Pose, figure
from meshreel.capture.simulated.implicit import polygonize
from meshreel.capture.simulated.procedural import grid_of_frame
from meshreel.capture.simulated.sensors import SensorOptions
from meshreel.capture.simulated.simulated_rig import ColorSensorOptions, SceneFrame, shade_of, simulate_rig
from meshreel.capture.simulated.solid_colors import WALKER, person_colors
from meshreel.geometry.cameras import Camera, CameraPose, looking_at
from meshreel.geometry.closest_points import Surface
from meshreel.geometry.color_views import ColorPicture, ColorViews
from meshreel.geometry.topology import face_normals
from meshreel.metrics.color import TO_YUV
from meshreel.types import Frames, Mesh, Up

FRAMES, RATE = 300, 30.0
SPACING = 0.016  # m, of the grid that the surface is found in: 14k vertices
CYCLE = 1.0  # s, of the steps
SENSOR = ColorSensorOptions(gain=0.06, balance=0.02, pose_error=0.2)  # 1024 x 1280 pixels of 1.7 mm
TEXEL = 0.002  # m: what a texel of 1024 x 1024 is on a person
SAMPLES = 12  # places in a texel whose mean is its true colour
TrueLuma = Callable[[int, np.ndarray], tuple[np.ndarray, np.ndarray]]  # like `true_luma`


class Walker(Frames):
    """The frames of the person, with the pictures of the cameras."""

    up: Up = "y"
    frame_rate = RATE

    def __init__(self, folder: Path, frames: int) -> None:
        """Take the pictures where the folder lacks them: some seconds a frame."""
        self._count = frames
        if not (folder / RIG).exists():
            every = (_scene(number) for number in range(frames))
            simulate_rig(folder, every, CAMERAS, RATE, SensorOptions(noise=0.0), color=SENSOR)
        pictures = open_recording(folder, keep=False)[0].pictures
        self.colors = Corrected(pictures, lambda: corrections_of(self, pictures))  # on clean meshes

    def __len__(self) -> int:
        return self._count

    def __getitem__(self, index: int) -> Mesh:
        return _scene(range(self._count)[index]).mesh


def true_luma(number: int, points: Float64[np.ndarray, "N 3"]) -> tuple[np.ndarray, Bool[np.ndarray, " N"]]:
    """Return the luma of a texel at the surface closest to each point in a frame; whether a camera sees it."""
    frame, random = _scene(number), np.random.default_rng(number)
    assert frame.paint is not None
    hits = Surface(frame.mesh).closest(points)
    faces, normals = hits.faces.astype(np.int64), face_normals(frame.mesh)[0][hits.faces]
    black = [ColorPicture(c.view, np.zeros((c.view.height, c.view.width, 3), np.uint8)) for c in CAMERAS]
    seen = ColorViews(black, frame.mesh).at(hits.points, normals)[1]
    along = np.cross(normals, [0.3, 0.5, 0.8])
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    ways, found = (along, np.cross(normals, along)), np.zeros((len(points), 3))
    for _ in range(SAMPLES):
        u, v = TEXEL * (random.random((2, len(points), 1)) - 0.5)
        found += frame.paint(hits.points + u * ways[0] + v * ways[1], faces) / SAMPLES
    return found @ TO_YUV[0] * shade_of(frame.mesh, faces, number), seen


def _scene(number: int) -> SceneFrame:
    """Return the person in a frame; each frame has a grid, and so a connectivity, of its own."""
    step = number / (CYCLE * RATE)
    pose = Pose(np.zeros(3), 0.4 * math.sin(0.1 * number), step, 0.4, softness=math.sin(4 * math.pi * step))
    mesh = polygonize((figure(pose, 0.7 * SPACING),), 0.01, grid_of_frame(number, SPACING, 0))
    paint = lambda points, _faces: person_colors(pose, 0.7 * SPACING, WALKER, points)  # noqa: E731
    return SceneFrame(mesh, np.ones(len(mesh.faces), bool), paint)


def _camera(number: int) -> DepthCamera:
    """Return one of six cameras on a circle of 2.6 m; every second one stands higher."""
    angle = 2 * math.pi * number / 6
    eye = np.array([2.6 * math.sin(angle), 1.6 if number % 2 else 0.8, 2.6 * math.cos(angle)])
    pose = looking_at(eye, np.array([0.0, 0.9, 0.0]))
    width, height = 512, 640
    focal = 0.8 * height / 1.75 * 2.6  # the person fills four fifths of the height
    view = Camera(width, height, (focal, focal), (width / 2, height / 2), CameraPose.of_camera(pose))
    return DepthCamera(f"c{number}", view)


CAMERAS = tuple(map(_camera, range(6)))
