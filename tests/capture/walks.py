"""A camera that a hand carries past the demo's people and room of capsules and boxes, small and with known poses."""

from dataclasses import replace

import numpy as np

from meshreel.capture.simulated.demo_room import RoomOptions, furnished_room, room_cameras
from meshreel.capture.simulated.simulated_rig import ColorSensorOptions, SensorOptions, simulate_rig
from meshreel.geometry.cameras import CameraPose, looking_at


def walking_camera(count, width=128, sway=0.5):
    """A camera on an arc of `sway` rad before the open front of the room, with the tremble of a hand."""
    path = {}
    for number in range(count):
        angle = sway * np.sin(2 * np.pi * number / count) + 0.5
        tremble = 0.02 * np.array([np.sin(0.9 * number), np.sin(1.7 * number), np.cos(1.3 * number)])
        eye = np.array([2.6 * np.sin(angle), 1.6, 2.6 * np.cos(angle)]) + tremble
        path[number] = CameraPose.of_camera(looking_at(eye, np.array([0.2 * np.sin(0.4 * number), 0.7, -0.2])))
    one = room_cameras(width)[0]
    return replace(one, name="phone", view=replace(one.view, pose=path[0]), path=path)


def record_walk(folder, count=12, drift=(0.01, 0.5), people=True, width=128):
    """The rig of a walk whose recorded poses drift by so many metres and degrees; return the camera with the truth."""
    camera, room = walking_camera(count, width), furnished_room(RoomOptions(count, 10.0, spacing=0.05))
    frames = room if people else [room[0]] * count
    sensor = SensorOptions(noise=0.3, pose_error=drift)
    simulate_rig(folder, frames, (camera,), 10.0, sensor, color=ColorSensorOptions(scale=1.5))
    return camera
