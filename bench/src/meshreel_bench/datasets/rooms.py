"""The benchmark scenes `room2` and `room2-standing`: a furnished room, two people, four simulated cameras, as a rig."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float64

from meshreel.capture.simulated.simulated_rig import SceneFrame, SensorOptions, corner_cameras, simulate_rig
from meshreel.errors import InputError
from meshreel.io.meshes import read_mesh
from meshreel.types import Mesh

ROOM = Path("rooms/lr_kt2.obj")  # its y axis points down
PEOPLE = {"crane": (0.2, 0.0, 3.0), "samba": (-0.9, 0.0, 2.85)}  # m: where there is room to walk
SPEEDS = {"room2": 1.0, "room2-standing": 0.4}  # of the people
FRAMES = 60
FRAME_RATE = 30.0  # 1/s
CAMERAS = 4
WALLS = (0.35, 0.0, 0.35)  # m from the walls to the cameras


@dataclass(frozen=True, slots=True)
class RoomOptions:
    """Choice of a scene, and precision of its measurement."""

    name: str = "room2"
    frames: int = FRAMES
    sensor: SensorOptions = SensorOptions()


def simulate_room(
    folder: Path,
    data: Path,
    options: RoomOptions = RoomOptions(),
    progress: Callable[[int], None] = lambda _done: None,
) -> int:
    """Writes the scene's rig and its truth into a folder; the number of frames. Some five minutes for 60 frames."""
    room = furnished(data)
    low, high = room.vertices.min(axis=0), room.vertices.max(axis=0)
    cameras = corner_cameras(low + WALLS, high - np.array(WALLS), count=CAMERAS)
    frames = scene(room, data, SPEEDS[options.name], options.frames)
    return simulate_rig(folder, frames, cameras, FRAME_RATE, options.sensor, progress)


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
    for name, place in PEOPLE.items():
        path = data / "performers" / f"{name}.npz"
        if not path.exists():
            raise InputError(f"{path}: is missing; give the folder of the benchmark data")
        with np.load(path) as capture:
            people.append((capture["vertices"].astype(np.float64) + place, capture["faces"]))
    for number in range(count):
        moving = [Mesh.of(_at(vertices, speed * number), faces) for vertices, faces in people]
        yield SceneFrame.of([room], moving)


def _at(vertices: Float64[np.ndarray, "T V 3"], time: float) -> Float64[np.ndarray, "V 3"]:
    before = min(int(time), len(vertices) - 2)
    share = min(time - before, 1.0)
    return (1 - share) * vertices[before] + share * vertices[before + 1]
