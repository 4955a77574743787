"""A ball in front of a wall as depth cameras see it: exact depths, by arithmetic alone."""

import numpy as np

from meshreel.capture.rig.cameras import DepthCamera
from meshreel.capture.rig.rig import write_rig
from meshreel.capture.simulated.demo_room import RoomOptions, furnished_room, room_cameras
from meshreel.capture.simulated.simulated_rig import ColorSensorOptions, SensorOptions, simulate_rig
from meshreel.geometry.cameras import Camera, CameraPose
from meshreel.io.write import write_picture

RADIUS, WALL = 0.4, 1.2  # m; the ball is at the origin, the wall behind it at z = WALL


def camera(name="front", side=0.0, size=96, focal=None, **changed):
    """A camera two metres from the ball, `side` degrees around the vertical axis, that looks at it."""
    angle = np.radians(side)
    turn = np.array([[np.cos(angle), 0, np.sin(angle)], [0, 1, 0], [-np.sin(angle), 0, np.cos(angle)]])
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = turn, turn @ [0, 0, -2]
    view = Camera(size, size, focal or (float(size), float(size)), (size / 2, size / 2), CameraPose.of_camera(pose))
    return DepthCamera(name, view, **({"depth_range": (0.2, 4.0)} | changed))


def measured(camera, ball=(0.0, 0.0, 0.0), wall=True):
    """What a camera measures of the ball and the wall, in its unit; 0 where it sees neither."""
    turn, eye = camera.view.pose.to_world[:3, :3], camera.view.pose.to_world[:3, 3]
    rays = camera.view.ahead @ turn.T
    away = eye - np.asarray(ball)
    a, b, c = (rays**2).sum(axis=-1), rays @ away, away @ away - RADIUS**2
    inside = b * b - a * c
    depth = np.where(inside >= 0, (-b - np.sqrt(np.maximum(inside, 0))) / a, np.inf)
    if wall:
        with np.errstate(divide="ignore"):
            behind = (WALL - eye[2]) / rays[..., 2]
        depth = np.minimum(depth, np.where(behind > 0, behind, np.inf))
    return np.where(np.isfinite(depth), np.rint(depth / camera.depth_unit), 0).astype(np.uint16)


def record(folder, cameras, balls, wall=True):
    """A rig's folder: a frame for each place of the ball."""
    places = [folder / one.name / "depth" for one in cameras]
    for place in places:
        place.mkdir(parents=True, exist_ok=True)
    write_rig(folder, tuple(cameras), 15.0)
    for one, place in zip(cameras, places, strict=True):
        for number, ball in enumerate(balls):
            write_picture(measured(one, ball, wall), place / f"depth_{number:05}.png")
    return folder


def record_room(folder, options: RoomOptions):
    """The rig of a room with people and its colours, in small pictures."""
    sensor, color = SensorOptions(noise=0.3, seed=options.seed), ColorSensorOptions(scale=1.5)
    simulate_rig(folder, furnished_room(options), room_cameras(96), options.frame_rate, sensor, color=color)
