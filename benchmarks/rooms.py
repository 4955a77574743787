"""The benchmark scenes `room2` and `room2-standing`: a furnished room and two people, seen by four simulated cameras.

python benchmarks/rooms.py -o build/room2                            # 60 frames in which they walk; five minutes
python benchmarks/rooms.py --scene room2-standing -o build/standing   # in which they hardly move

In: the room and the performers of the benchmark data. Out: a rig's folder, for `meshreel capture`, with the truth.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from jaxtyping import Float64

from meshreel.capture.simulate import SceneFrame, SensorOptions, corner_cameras, simulate_rig
from meshreel.io.meshes import read_mesh
from meshreel.types import Mesh

ROOM = Path("rooms/lr_kt2.obj")  # its y axis points down
PEOPLE = {
    "crane": (0.2, 0.0, 3.0),
    "samba": (-0.9, 0.0, 2.85),
}  # m: where there is room to walk
SPEEDS = {"room2": 1.0, "room2-standing": 0.4}  # of the people
FRAME_RATE = 30.0  # 1/s
CAMERAS = 4


def main(arguments: list[str]) -> int:
    """Writes one scene."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-o", "--output", type=Path, required=True)
    parser.add_argument("--scene", choices=tuple(SPEEDS), default="room2")
    parser.add_argument("--data", type=Path, default=Path("../shared/data"))
    parser.add_argument("--frames", type=int, default=60)
    parser.add_argument("--noise", type=float, default=SensorOptions().noise)
    chosen = parser.parse_args(arguments)
    room = furnished(chosen.data)
    low, high = room.vertices.min(axis=0), room.vertices.max(axis=0)
    inside = np.array([0.35, 0.0, 0.35])  # m from the walls to the cameras
    cameras = corner_cameras(low + inside, high - inside, CAMERAS)
    frames = scene(room, chosen.data, SPEEDS[chosen.scene], chosen.frames)
    sensor = SensorOptions(noise=chosen.noise)
    count = simulate_rig(chosen.output, frames, cameras, FRAME_RATE, sensor, lambda done: print(f"\r{done}", end=""))
    print(f"\r{chosen.output}: {count} frames of {CAMERAS} cameras")
    return 0


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
        with np.load(data / "performers" / f"{name}.npz") as capture:
            people.append((capture["vertices"].astype(np.float64) + place, capture["faces"]))
    for number in range(count):
        moving = [Mesh.of(_at(vertices, speed * number), faces) for vertices, faces in people]
        yield SceneFrame.of([room], moving)


def _at(vertices: Float64[np.ndarray, "T V 3"], time: float) -> Float64[np.ndarray, "V 3"]:
    before = min(int(time), len(vertices) - 2)
    share = min(time - before, 1.0)
    return (1 - share) * vertices[before] + share * vertices[before + 1]


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
