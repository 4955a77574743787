"""A furnished room over many frames: visitors come and go, furniture is moved, light changes, the sensor drifts.

A frame is made from its number alone when it is read, so that a longer take begins as a shorter one does.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from meshreel.capture.simulated.demo_room import box, furnished_room
from meshreel.capture.simulated.figure import Pose, figure
from meshreel.capture.simulated.implicit import polygonize
from meshreel.capture.simulated.procedural import grid_of_frame
from meshreel.capture.simulated.solid_colors import CHILD, WALKER, Colors, person_colors, room_colors
from meshreel.geometry.topology import concatenate
from meshreel.types import Mesh, MeshSequence

LONGEST = 1800  # frames
EYE, NOISE = np.array([2.0, 2.0, 2.0]), 0.004  # m, place of the sensor, and deviation of a coordinate
DRIFT = 0.005 / LONGEST  # of the range, a frame
VISIT, STAY = 120, 90  # frames from a visit to the next, and of a visit: fifteen in the longest take
SPACING = 0.03  # m, of the grid of visitors' surface
MOVED, MOVING = 600, 30  # frames from a move of a thing to its next, and of a move
# A stool and a crate: half their widths and their heights, two places, m, and the frame of the first move.
THINGS = ((0.2, 0.45, (-0.7, 0.5), (-0.2, 0.8), 140), (0.15, 0.3, (-0.1, -1.0), (-0.6, -0.4), 260))


@dataclass(frozen=True, slots=True, repr=False)
class LongRoom(MeshSequence):
    """The frames, with colours of their vertices."""

    frames: int = LONGEST
    frame_rate: float = 30.0  # 1/s

    def __len__(self) -> int:
        return self.frames

    def __getitem__(self, index: int) -> Mesh:
        number, still = range(self.frames)[index], furnished_room().still
        pieces = [_painted(still, room_colors(still.vertices))]
        for half, height, first, second, frame in THINGS:
            mesh, (moves, at) = box(((-half, 0.0, -half), (half, height, half))), divmod(number, MOVED)
            share = abs(moves % 2 - float(np.clip((at - frame) / MOVING, 0, 1)))
            x, z = (1 - share) * np.array(first) + share * np.array(second)
            pieces.append(_painted(mesh.at(mesh.vertices + [x, 0, z]), room_colors(mesh.vertices)))
        whole = concatenate(pieces + ([_visitor(number)] if number % VISIT < STAY else []))
        assert whole.colors is not None, "each piece is painted"
        noise = NOISE * np.random.default_rng(number).standard_normal(whole.vertices.shape)
        light = (0.85 + 0.15 * math.cos(math.tau * number / 900)) * (0.8 if number // 450 % 2 else 1.0)  # and a lamp
        return _painted(whole.at(EYE + (1 + DRIFT * number) * (whole.vertices + noise - EYE)), light * whole.colors)


def _visitor(number: int) -> Mesh:
    """Return the person who comes in from the right, turns, and leaves; each is of another size."""
    visit, at = number // VISIT, number % VISIT / STAY
    place, heading = np.array([2.0 - 1.6 * math.sin(math.pi * at), 0.01, -0.2]), -math.pi / 2 * math.cos(math.pi * at)
    pose = Pose(place, heading, 3.5 * at, 0.42 * abs(math.cos(math.pi * at)), size=0.85 + 0.03 * (visit * 7 % 10))
    mesh = polygonize((figure(pose, 0.7 * SPACING),), 0.01, grid_of_frame(number, SPACING, 0))
    return _painted(mesh, person_colors(pose, 0.7 * SPACING, (WALKER, CHILD)[visit % 2], mesh.vertices))


def _painted(mesh: Mesh, colors: Colors) -> Mesh:
    return replace(mesh, colors=np.clip(np.rint(colors), 0, 255).astype(np.uint8))
