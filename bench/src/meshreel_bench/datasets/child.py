"""The child of the demo alone, seen by six simulated colour cameras that err in exposure and pose, and by others."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from meshreel.capture.demo_room import Room, RoomOptions
from meshreel.capture.recording import open_recording
from meshreel.capture.rig import RIG
from meshreel.capture.simulated_color import ColorSensorOptions, SimulatedColor
from meshreel.capture.simulated_rig import SceneFrame, SensorOptions, corner_cameras, simulate_rig
from meshreel.geometry.color_views import ColorFrames, ColorPicture
from meshreel.types import Frames, Mesh, Up

FRAMES = 300
CAMERAS = corner_cameras(np.array([-1.1, 0.0, -1.1]), np.array([1.1, 1.5, 1.1]), 6)  # some 3 mm a pixel
SENSOR = ColorSensorOptions(scale=1.0, gain=0.06, blur=1.0, pose_error=0.2)  # degrees; blurred, for grain is finer
PERFECT = replace(SENSOR, gain=0.0, noise=0.0)


class Child(Frames):
    """The frames of the child, with the pictures of its colour cameras."""

    up: Up = "y"

    def __init__(self, folder: Path, frames: int) -> None:
        """Make the rig where the folder lacks it: some seconds a frame."""
        self.room = Room(RoomOptions(frames), Mesh.empty())
        self.frame_rate = self.room.options.frame_rate
        if not (folder / RIG).exists():
            every = (child(self.room, number) for number in range(frames))
            simulate_rig(folder, every, CAMERAS, self.frame_rate, SensorOptions(noise=0.0), color=SENSOR)
        self.colors = open_recording(folder, keep=False)[0].colors

    def __len__(self) -> int:
        return len(self.room)

    def __getitem__(self, index: int) -> Mesh:
        return child(self.room, range(len(self))[index]).mesh


@dataclass(frozen=True, slots=True)
class Clean(ColorFrames):
    """Pictures without errors."""

    room: Room

    def __getitem__(self, index: int) -> list[ColorPicture | None]:
        frame, random = child(self.room, index), np.random.default_rng(0)
        assert frame.paint is not None
        eyes = [SimulatedColor(camera, np.ones(3), PERFECT) for camera in CAMERAS]
        return [ColorPicture(eye.camera.view, eye.picture(frame.mesh, frame.paint, index, random)) for eye in eyes]


def child(room: Room, number: int) -> SceneFrame:
    """Return a frame of the demo without all but the child."""
    whole, own = room[number], room.people(number)[1]
    paint, before = whole.paint, len(whole.mesh.faces) - len(own.faces)
    assert paint is not None
    return replace(SceneFrame.of([], [own]), paint=lambda points, faces: paint(points, faces + before))
