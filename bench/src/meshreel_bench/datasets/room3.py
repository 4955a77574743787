"""The benchmark scene `room3`: things that move for a while, and three people, in a procedural room; four cameras.

A crate is pushed and left, a door opens, a box is carried and set down; two people touch and pass, one sits down and
stands up. y is up, in metres; the floor is at height 0. The truth has each part by name: see `Parts`.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Bool, Float64, Int64

from meshreel.capture.demo_room import Box, box
from meshreel.capture.figure import Pose, figure, turn_about_y
from meshreel.capture.implicit import polygonize
from meshreel.capture.procedural import grid_of_frame
from meshreel.capture.simulated_rig import TRUTH, SceneFrame, corner_cameras, simulate_rig
from meshreel.geometry.topology import concatenate, subdivide_midpoint
from meshreel.io.write import replacing
from meshreel.types import Mesh

FRAMES, RATE, LEFT = 60, 30.0, 28  # frames, 1/s; the frame from which on the crate stands
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
    ((-2.3, 0.0, -2.0), (-2.2, 2.5, 2.0)),
    ((2.2, 0.0, -2.0), (2.3, 2.5, 2.0)),
    ((0.3, -0.1, -3.2), (2.2, 0.0, -2.1)),  # which leads to a corridor
    ((0.3, 0.0, -3.3), (2.2, 2.5, -3.2)),
    ((1.62, 0.0, 0.6), (2.15, 0.44, 1.7)),  # a seat with a back
    ((2.05, 0.44, 0.6), (2.2, 0.85, 1.7)),
    ((1.06, 0.68, -0.4), (1.56, 0.72, 0.35)),  # a table
    ((1.14, 0.0, -0.38), (1.19, 0.68, -0.33)),
    ((1.48, 0.0, -0.38), (1.53, 0.68, -0.33)),
    ((1.14, 0.0, 0.28), (1.19, 0.68, 0.33)),
    ((1.48, 0.0, 0.28), (1.53, 0.68, 0.33)),
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
ARM, HELD, ON_TABLE = (0.0, -SOLE, 0.56), (0.0, 1.04, 0.36), (1.24, 0.841, -0.08)  # m: crate and box before a person; box
FACING_X = np.pi / 2  # heading, rad


@dataclass(frozen=True, slots=True)
class Parts:
    """Truth of the parts of each frame, whose faces follow each other in the order of `NAMES`."""

    faces: Int64[np.ndarray, "T P"]  # number of a part's faces in a frame
    poses: Float64[np.ndarray, "T K 4 4"]  # of `THINGS`, to the world: the same faces move rigidly

    def of_faces(self, number: int) -> Int64[np.ndarray, " F"]:
        """Return the part, as its number in `NAMES`, of each face of a clean frame."""
        return np.repeat(np.arange(len(NAMES)), self.faces[number])

    @property
    def moving(self) -> Bool[np.ndarray, "T P"]:
        """Which parts move in a frame: people always, things whose pose is another in the frame before or after."""
        steps = (np.diff(self.poses, axis=0) != 0).any(axis=(2, 3))
        things = np.pad(steps, ((1, 0), (0, 0))) | np.pad(steps, ((0, 1), (0, 0)))
        still, people = np.zeros((len(things), 1), bool), np.ones((len(things), len(PEOPLE)), bool)
        return np.concatenate([still, things, people], axis=1)


@dataclass(frozen=True, slots=True)
class Room3:
    """Clean frames of the scene, made when they are read."""

    frames: int = FRAMES  # the first ones
    spacing: float = 0.012  # m, of the grid of people's surface

    def parts(self, number: int) -> list[Mesh]:
        """Return the mesh of each part of a frame in the order of `NAMES`; all are closed."""
        still = concatenate([box(corners) for corners in STILL])
        things = [_placed(box(BOXES[name]), pose) for name, pose in zip(THINGS, _things()[number], strict=True)]
        grid = grid_of_frame(number, self.spacing, 0)
        people = [polygonize((figure(pose, 0.7 * self.spacing),), 0.01, grid) for pose in _people(number)]
        return [*(subdivide_midpoint(mesh) for mesh in (still, *things)), *people]

    def record(self, folder: Path, width: int = 640) -> None:
        """Write the rig and its truth, with `parts.npz`; two minutes for 60 frames."""
        poses, counts = _things()[: self.frames], list[list[int]]()
        moving = Parts(np.zeros((0, 0), np.int64), poses).moving

        def frames() -> Iterator[SceneFrame]:
            for number in range(self.frames):
                parts = self.parts(number)
                counts.append([len(part.faces) for part in parts])
                yield SceneFrame(concatenate(parts), np.repeat(moving[number], counts[-1]))

        cameras = (camera.resized(width, round(0.9 * width)) for camera in corner_cameras(LOW, HIGH))
        simulate_rig(folder, frames(), tuple(cameras), RATE)
        with replacing(folder / TRUTH / PARTS) as file:
            np.savez_compressed(file, allow_pickle=False, faces=np.array(counts), poses=poses)


def read_parts(rig: Path) -> Parts | None:
    """Read the parts beside the truth of a rig; None where it has none."""
    if not (rig / TRUTH / PARTS).exists():
        return None
    with np.load(rig / TRUTH / PARTS, allow_pickle=False) as archive:
        return Parts(archive["faces"], archive["poses"])


def _things() -> Float64[np.ndarray, "T K 4 4"]:
    """Return the poses of crate, door and box in all frames."""
    (carriers, _), (pushers, _) = _carrier(), _pusher()
    ahead, poses = turn_about_y(FACING_X), np.tile(np.eye(4), (FRAMES, len(THINGS), 1, 1))
    until = np.minimum(np.arange(FRAMES), LEFT)
    poses[:, 0, :3, 3] = pushers[until] + turn_about_y(-FACING_X) @ ARM
    poses[:, 1, :3, 3] = HINGE
    poses[:, 1, :3, :3] = [turn_about_y(OPEN * _eased(number, 3, 27)) for number in range(FRAMES)]
    down = _eased(np.arange(FRAMES), 45, 56)[:, None]
    poses[:, 2, :3, 3] = (1 - down) * (carriers + ahead @ HELD) + down * ON_TABLE
    poses[:, 2, :3, :3] = ahead
    return poses


def _people(number: int) -> tuple[Pose, Pose, Pose]:
    """Return the poses of the carrier, the pusher and the sitter."""
    (places, walked), (pushers, pushed) = _carrier(), _pusher()
    speeds = [float(np.gradient(steps)[number]) * CYCLE * RATE for steps in (walked, pushed)]
    strides = [STRIDE * min(speed, 1.0) for speed in speeds]
    held = _things()[number, 2]
    hands = tuple(held[:3, :3] @ (side * 0.17, 0.0, -0.1) + held[:3, 3] for side in (1, -1))
    ahead = turn_about_y(-FACING_X)
    grips = tuple(pushers[number] + ahead @ (side * 0.12, 0.84, 0.33) for side in (1, -1))
    left = _eased(number, 27, 35)
    turned = -FACING_X * (1 + _eased(number, 29, 42))
    seat = np.array([1.38, SOLE, 1.15])
    down = _eased(number, 4, 24) * (1 - _eased(number, 34, 57))
    knees = tuple(seat + ahead @ (side * 0.12, 0.6, 0.06) for side in (1, -1))
    return (
        Pose(places[number], FACING_X, walked[number], strides[0], hands, (1.0, 1.0), lean=0.15 * _eased(number, 45, 56)),
        Pose(pushers[number], turned, pushed[number] + 0.3, strides[1], grips, (1 - left, 1 - left), lean=0.5 * (1 - left), girth=1.1),
        Pose(seat, -FACING_X, 0.25, 0.0, knees, (down, down), hips=(-0.4 * down, -0.36 * down), lean=0.55 * np.sin(np.pi * down), size=0.98, girth=0.92),
    )


def _carrier() -> tuple[Float64[np.ndarray, "T 3"], Float64[np.ndarray, " T"]]:
    """Return the places of the person with the box, and the step cycles walked: to the table."""
    speeds = 1.1 * (1 - _eased(np.arange(FRAMES), 42, 52))
    return _walk((-0.88, SOLE, -0.12), speeds, np.full(FRAMES, FACING_X))


def _pusher() -> tuple[Float64[np.ndarray, "T 3"], Float64[np.ndarray, " T"]]:
    """Return the same of the person who pushes the crate, leaves it and turns away."""
    times = np.arange(FRAMES)
    pushing = 1.25 * _eased(times, 2, 6) * (1 - _eased(times, 23, LEFT))
    leaving = _eased(times, 31, 38)
    return _walk((1.0, SOLE, -0.62), pushing + leaving, -FACING_X * (1 + _eased(times, 29, 42)))


def _walk(
    start: tuple[float, float, float], speeds: Float64[np.ndarray, " T"], headings: Float64[np.ndarray, " T"]
) -> tuple[Float64[np.ndarray, "T 3"], Float64[np.ndarray, " T"]]:
    steps = speeds / RATE
    ways = np.stack([np.sin(headings), np.zeros(len(headings)), np.cos(headings)], axis=1)
    walked = np.concatenate([[0.0], np.cumsum(steps)[:-1]])
    return start + np.concatenate([np.zeros((1, 3)), np.cumsum(steps[:, None] * ways, axis=0)[:-1]]), walked / CYCLE


def _eased(number, first: float, last: float):
    """Return 0 up to the first frame, 1 from the last one on, and a smooth transition between."""
    share = np.clip((number - first) / (last - first), 0, 1)
    return share * share * (3 - 2 * share)


def _placed(mesh: Mesh, pose: Float64[np.ndarray, "4 4"]) -> Mesh:
    return Mesh.of(mesh.vertices @ pose[:3, :3].T + pose[:3, 3], mesh.faces)
