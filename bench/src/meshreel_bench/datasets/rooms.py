"""The benchmark scenes, as rigs of four cameras: `room2` and `room2-standing` of captures, `room3` procedural.

In `room3` a crate is pushed and left, a door opens, a box is carried and set down; two people touch and pass, one sits
down and stands up. y is up, in metres; the floor is at height 0.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
from jaxtyping import Bool, Float64, Int64

from meshreel.capture.rig.cameras import DepthCamera
from meshreel.capture.simulated.demo_room import Box, RoomOptions, box, furnished_room, room_cameras
from meshreel.capture.simulated.figure import Pose, figure, turn_about_y
from meshreel.capture.simulated.implicit import polygonize
from meshreel.capture.simulated.procedural import grid_of_frame
from meshreel.capture.simulated.sensors import CORNERS, LOW_DOWN, OVERHEAD, SENSORS, Mount, SensorOptions, mounted
from meshreel.capture.simulated.simulated_rig import TRUTH, ColorSensorOptions, SceneFrame, corner_cameras, simulate_rig
from meshreel.errors import InputError
from meshreel.geometry.topology import concatenate, subdivide_midpoint
from meshreel.io.meshes import read_mesh
from meshreel.io.write import replacing
from meshreel.types import Mesh

ROOM = Path("rooms/lr_kt2.obj")  # its y axis points down
WALKERS = {"crane": (0.2, 0.0, 3.0), "samba": (-0.9, 0.0, 2.85)}  # m: where there is room to walk
SPEEDS = {"room2": 1.0, "room2-standing": 0.4}  # of the people
WALLS = (0.35, 0.0, 0.35)  # m from the walls to the cameras
RATE = 30.0  # 1/s
Vector = Float64[np.ndarray, "3"]


@dataclass(frozen=True, slots=True)
class Setting:
    """Depth cameras that record a room; the paper's, where nothing else is said."""

    cameras: Callable[[Vector, Vector], tuple[DepthCamera, ...]] = corner_cameras  # of a box's corners
    errors: SensorOptions = SensorOptions()
    rate: float = RATE  # 1/s


PAPER = Setting()


def _setting(sensor: str, mount: Mount, rate: float) -> Setting:
    camera, errors = SENSORS[sensor]
    return Setting(partial(mounted, camera, mount=mount), errors, rate)


SETTINGS = {  # of the depth cameras of the market, 5 to 60 frames a second
    "azure_kinect-slow": _setting("azure_kinect", CORNERS, 5.0),
    "kinect_v1-corners": _setting("kinect_v1", CORNERS, 30.0),
    "kinect_v2-overhead": _setting("kinect_v2", OVERHEAD, 30.0),
    "d435-corners": _setting("d435", CORNERS, 60.0),
    "d455-low": _setting("d455", LOW_DOWN, 15.0),
    "l515-corners": _setting("l515", CORNERS, 30.0),
    "iphone_lidar-corners": _setting("iphone_lidar", CORNERS, 60.0),
}
ROOM2, ROOM3, PROCEDURAL = ROOMS = ("room2", "room3", "procedural_room")  # the last two need no benchmark data
SENSED = {f"sensors/{name}/{room}": (setting, room) for name, setting in SETTINGS.items() for room in ROOMS}


def record_procedural(folder: Path, options: RoomOptions, width: int = 256) -> None:
    """Write the rig of the procedural room, with colours, and its truth; `width`: pixels of a depth picture."""
    sensor, color = SensorOptions(noise=0.3, seed=options.seed), ColorSensorOptions(scale=1.5)
    simulate_rig(folder, furnished_room(options), room_cameras(width), options.frame_rate, sensor, color=color)


def simulate_room(folder: Path, data: Path, name: str, frames: int, setting: Setting = PAPER) -> None:
    """Write a scene's rig and its truth into a folder. Some five minutes for 60 frames."""
    room = furnished(data)
    cameras = setting.cameras(room.vertices.min(axis=0) + WALLS, room.vertices.max(axis=0) - np.array(WALLS))
    moments = scene(room, data, SPEEDS[name] * RATE / setting.rate, frames)
    simulate_rig(folder, moments, cameras, setting.rate, setting.errors)


def furnished(data: Path) -> Mesh:
    """The room, upright, on a floor at height 0: the scan has holes where things stand."""
    scan = read_mesh(data / ROOM).mesh
    vertices = scan.vertices * (1.0, -1.0, -1.0)
    vertices[:, 1] -= vertices[:, 1].min()
    (left, _, back), (right, _, front) = vertices.min(axis=0), vertices.max(axis=0)
    corners = [(left, 0.0, back), (left, 0.0, front), (right, 0.0, front), (right, 0.0, back)]
    start = len(vertices)
    floor = [(start, start + 1, start + 2), (start, start + 2, start + 3)]
    return Mesh.of(np.concatenate([vertices, corners]), np.concatenate([scan.faces, floor]))


def scene(room: Mesh, data: Path, speed: float, count: int) -> Iterator[SceneFrame]:
    """The clean frames; the people's vertices are interpolated between those of their captures."""
    people = []
    for name, place in WALKERS.items():
        path = data / "performers" / f"{name}.npz"
        if not path.exists():
            raise InputError(f"{path}: is missing; give the folder of the benchmark data")
        with np.load(path) as capture:
            people.append((capture["vertices"].astype(np.float64) + place, capture["faces"]))
    for number in range(count):
        moving = [Mesh.of(_at(vertices, speed * number), faces) for vertices, faces in people]
        yield SceneFrame.of([room], moving)


def _at(frames: Float64[np.ndarray, "T ..."], time: float) -> Float64[np.ndarray, "..."]:
    """Interpolate values, of which there is one a frame, at a time in frames."""
    before = min(int(time), len(frames) - 2)
    share = min(time - before, 1.0)
    return (1 - share) * frames[before] + share * frames[before + 1]


FRAMES, LEFT = 60, 28  # at `RATE`; the one from which on the crate stands
THINGS, PEOPLE = ("crate", "door", "box"), ("person 0", "person 1", "person 2")  # carrier, pusher, sitter
NAMES = ("room", *THINGS, *PEOPLE)  # in the order of their faces in a frame
LOW, HIGH = np.array([-1.9, 0.0, -1.75]), np.array([1.9, 2.5, 1.75])  # of the cameras
CYCLE, STRIDE, SOLE = 0.86, 0.5, 0.005  # m: walked in a step cycle; a step at 1 m/s; by which feet would sink in
PARTS = "parts.npz"  # beside the truth
STILL: tuple[Box, ...] = (
    ((-2.3, -0.1, -2.1), (2.3, 0.0, 2.1)),  # floor and walls; that at the back has a doorway,
    ((-2.3, 0.0, -2.1), (0.8, 2.5, -2.0)),
    ((1.65, 0.0, -2.1), (2.3, 2.5, -2.0)),
    ((0.8, 2.05, -2.1), (1.65, 2.5, -2.0)),
    ((-2.3, 0.0, 2.0), (2.3, 2.5, 2.1)),
    *(((x, 0.0, -2.0), (x + 0.1, 2.5, 2.0)) for x in (-2.3, 2.2)),
    ((0.3, -0.1, -3.2), (2.2, 0.0, -2.1)),  # which leads to a corridor
    ((0.3, 0.0, -3.3), (2.2, 2.5, -3.2)),
    ((1.62, 0.0, 0.6), (2.15, 0.44, 1.7)),  # a seat with a back
    ((2.05, 0.44, 0.6), (2.2, 0.85, 1.7)),
    ((1.06, 0.68, -0.4), (1.56, 0.72, 0.35)),  # a table
    *(((x, 0.0, z), (x + 0.05, 0.68, z + 0.05)) for x in (1.14, 1.48) for z in (-0.38, 0.28)),
    ((-2.2, 0.0, -2.0), (-1.3, 1.6, -1.6)),  # a cupboard, a shelf, a chest with things on it
    ((-2.2, 0.95, 0.2), (-1.9, 1.0, 1.4)),
    ((-1.6, 0.0, 1.5), (-0.5, 0.6, 2.0)),
    ((-1.4, 0.6, 1.6), (-1.15, 0.9, 1.85)),
    ((-0.9, 0.6, 1.65), (-0.6, 0.7, 1.95)),
)
BOXES: dict[str, Box] = {  # of the things, about their own origins
    "crate": ((-0.2, 0.0, -0.2), (0.2, 0.78, 0.2)),
    "door": ((0.0, 0.01, -0.02), (0.83, 2.04, 0.02)),
    "box": ((-0.15, -0.12, -0.13), (0.15, 0.12, 0.13)),
}
HINGE, OPEN = (0.81, 0.0, -1.97), np.radians(-80)  # of the door: it opens into the room
ARM, HELD = (0.0, -SOLE, 0.56), (0.0, 1.04, 0.36)  # m: the crate before the pusher, the box before the carrier
ON_TABLE = (1.24, 0.841, -0.08)  # m: the box, set down
TURNED = -np.pi / 2  # rad: heading to the left, -x
TO_LEFT, TO_RIGHT = turn_about_y(TURNED), turn_about_y(-TURNED)

PerFrame = Float64[np.ndarray, " T"]
_Walk = Float64[np.ndarray, "T 6"]  # what a `Pose` begins with, in each frame


@dataclass(frozen=True, slots=True)
class Parts:
    """Truth of the parts of each frame, whose faces follow each other in the order of `NAMES`, people's last."""

    faces: Int64[np.ndarray, "T P"]  # number of a part's faces in a frame
    poses: Float64[np.ndarray, "T K 4 4"]  # of `THINGS`, to the world: the same faces move rigidly

    def of_faces(self, number: int) -> Int64[np.ndarray, " F"]:
        """Return the part, as its number in `NAMES`, of each face of a clean frame."""
        return np.repeat(np.arange(len(NAMES)), self.faces[number])


def moving_parts(poses: Float64[np.ndarray, "T K 4 4"]) -> Bool[np.ndarray, "T P"]:
    """Return a mask of moving parts: people always, things whose pose differs in the frame before or after."""
    steps = (np.diff(poses, axis=0) != 0).any(axis=(2, 3))
    things = np.pad(steps, ((1, 0), (0, 0))) | np.pad(steps, ((0, 1), (0, 0)))
    return np.pad(np.pad(things, ((0, 0), (1, 0))), ((0, 0), (0, len(PEOPLE))), constant_values=True)


@dataclass(frozen=True, slots=True)
class Room3:
    """Clean frames of the scene, made when they are read."""

    frames: int = FRAMES  # the first ones
    spacing: float = 0.012  # m, of the grid of people's surface
    setting: Setting = PAPER

    def parts(self, number: int) -> list[Mesh]:
        """Return the mesh of each part of a frame in the order of `NAMES`; people and things are closed."""
        still = concatenate([box(corners) for corners in STILL])
        time = number * (RATE / self.setting.rate)  # in frames of the story
        [poses], grid = thing_poses([time]), grid_of_frame(number, self.spacing, 0)
        boxes = ((box(BOXES[name]), pose) for name, pose in zip(THINGS, poses, strict=True))
        things = [Mesh.of(mesh.vertices @ pose[:3, :3].T + pose[:3, 3], mesh.faces) for mesh, pose in boxes]
        people = [polygonize((figure(pose, 0.7 * self.spacing),), 0.01, grid) for pose in _people(time)]
        return [*(subdivide_midpoint(mesh) for mesh in (still, *things)), *people]

    def record(self, folder: Path) -> None:
        """Write the rig and its truth, with `parts.npz`; three minutes for 60 frames."""
        counts, poses = list[list[int]](), thing_poses(np.arange(self.frames) * (RATE / self.setting.rate))

        def frames() -> Iterator[SceneFrame]:
            for number in range(self.frames):
                parts = self.parts(number)
                counts.append([len(part.faces) for part in parts])
                yield SceneFrame(concatenate(parts), np.repeat(moving_parts(poses)[number], counts[-1]))

        simulate_rig(folder, frames(), self.setting.cameras(LOW, HIGH), self.setting.rate, self.setting.errors)
        with replacing(folder / TRUTH / PARTS) as file:
            np.savez_compressed(file, allow_pickle=False, faces=np.array(counts), poses=poses)


def read_parts(rig: Path) -> Parts | None:
    """Read the parts beside the truth of a rig; None where it has none."""
    if not (rig / TRUTH / PARTS).exists():
        return None
    with np.load(rig / TRUTH / PARTS, allow_pickle=False) as archive:
        return Parts(archive["faces"], archive["poses"])


def thing_poses(times: Sequence[float] | PerFrame = range(FRAMES)) -> Float64[np.ndarray, "T K 4 4"]:
    """Return the poses of crate, door and box at some times, in frames."""
    carrier, pusher = _walks()
    poses, down = np.tile(np.eye(4), (len(times), len(THINGS), 1, 1)), _eased(45, 56, times)[:, None]
    poses[:, 0, :3, 3] = [_at(pusher, min(time, LEFT))[:3] + TO_LEFT @ ARM for time in times]
    poses[:, 1, :3, 3] = HINGE
    poses[:, 1, :3, :3] = [turn_about_y(OPEN * share) for share in _eased(3, 27, times)]
    poses[:, 2, :3, 3] = (1 - down) * [_at(carrier, time)[:3] + TO_RIGHT @ HELD for time in times] + down * ON_TABLE
    poses[:, 2, :3, :3] = TO_RIGHT
    return poses


def _people(time: float) -> tuple[Pose, Pose, Pose]:
    """Return the poses of the carrier, the pusher and the sitter."""
    carrier, pusher = ((row[:3], row[3], row[4], row[5]) for row in (_at(walk, time) for walk in _walks()))
    held, seat = thing_poses([time])[0, 2, :3, 3], np.array([1.38, SOLE, 1.15])
    hands = _both(held, TO_RIGHT, (0.17, 0.0, -0.1))
    grips = _both(pusher[0], TO_LEFT, (0.12, 0.84, 0.33))
    knees = _both(seat, TO_LEFT, (0.12, 0.6, 0.06))
    bow, on, sits, rises = (_eased(*span, [time])[0] for span in ((45, 56), (27, 35), (4, 24), (34, 57)))
    on, down = 1 - on, sits * (1 - rises)
    hips, lean = (-0.4 * down, -0.36 * down), 0.55 * np.sin(np.pi * down)
    return (
        Pose(*carrier, wrists=hands, reach=(1.0, 1.0), lean=0.15 * bow),
        Pose(*pusher, wrists=grips, reach=(on, on), lean=0.5 * on, girth=1.1),
        Pose(seat, TURNED, 0.25, 0.0, knees, (down, down), hips=hips, lean=lean, size=0.98, girth=0.92),
    )


def _both(place: Vector, turn: Float64[np.ndarray, "3 3"], apart: tuple[float, float, float]) -> tuple[Vector, Vector]:
    """Return the places of a left and a right wrist beside a place."""
    return place + turn @ apart, place + turn @ (apart * np.array([-1.0, 1.0, 1.0]))


def _walks() -> tuple[_Walk, _Walk]:
    """Return the ways of the carrier, to the table, and of the pusher, who leaves the crate and turns away."""
    speeds = 1.25 * _eased(2, 6) * (1 - _eased(23, LEFT)) + _eased(31, 38)
    pusher = _walked((1.0, SOLE, -0.62), speeds, TURNED * (1 + _eased(29, 42)))
    return _walked((-0.88, SOLE, -0.12), 1.1 * (1 - _eased(42, 52)), np.full(FRAMES, -TURNED)), pusher


def _walked(start: tuple[float, float, float], speeds: PerFrame, headings: PerFrame) -> _Walk:
    """Return place, heading, step cycles so far and stride in each frame; speeds in m/s."""
    ways = np.stack([np.sin(headings), np.zeros(FRAMES), np.cos(headings)], axis=1)
    steps = np.concatenate([[0.0], speeds[:-1] / RATE])
    places = start + np.cumsum(steps[:, None] * np.roll(ways, 1, axis=0), axis=0)
    return np.column_stack([places, headings, np.cumsum(steps) / CYCLE, STRIDE * np.minimum(speeds, 1.0)])


def _eased(first: int, last: int, times: Sequence[float] | PerFrame = range(FRAMES)) -> PerFrame:
    """Return a smooth step over times, in frames: 0 up to `first`, 1 from `last` on."""
    share = np.clip((np.asarray(times) - first) / (last - first), 0, 1)
    return share * share * (3 - 2 * share)
