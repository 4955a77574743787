"""A furnished room and two people of capsules, for tutorial and experiments: the demo's own scene is `stage`.

y is up, in metres; the room is open at the front and the right.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from jaxtyping import Float64, Int64

from ...geometry.topology import concatenate, weld
from ...types import Mesh
from ..rig.cameras import DepthCamera
from .figure import Pose, figure
from .implicit import polygonize
from .procedural import check_length, check_spacing, grid_of_frame
from .simulated_rig import SceneFrame, corner_cameras
from .solid_colors import CHILD, WALKER, Colors, Points, person_colors, room_colors

SIZE = (3.0, 1.7, 2.6)  # m, of the room; its origin is the middle of the floor (guess)
_FACE = 0.1  # m, about the side length of the room's faces (guess)
# m, box of the cameras: inside the walls, outside the open sides (guess).
BOX = np.array([[-1.4, 0.0, -1.2], [1.7, 2.3, 1.6]])
_CIRCLE, _SPEED = 0.8, 0.8  # m and m/s, of the walk around the middle (guess)
_CYCLE, _STRIDE = 0.9, 0.42  # m walked in a step cycle, m of a step (guess)
_SOLE = 0.01  # m by which feet would sink into the floor (guess)
_TURN = 0.6  # rad/s, of the child (guess)
_TOUCH = 0.01  # m; each person is meshed alone (guess)

Parts = Int64[np.ndarray, " F"]
Vector = Float64[np.ndarray, " 3"] | tuple[float, float, float]
Box = tuple[tuple[float, float, float], tuple[float, float, float]]  # lowest and highest corner, m
FURNITURE: tuple[Box, ...] = (
    ((-1.45, 0.0, -1.25), (-0.95, 1.0, -0.85)),  # a cupboard in the corner of the walls
    ((0.55, 0.0, -1.25), (1.35, 0.42, -0.85)),  # a bench at the back wall,
    ((0.55, 0.42, -1.25), (1.35, 0.8, -1.1)),  # and its back
    ((1.0, 0.66, 0.5), (1.45, 0.72, 1.2)),  # a table
    ((1.02, 0.0, 0.52), (1.1, 0.66, 0.6)),  # on four legs
    ((1.35, 0.0, 0.52), (1.43, 0.66, 0.6)),
    ((1.02, 0.0, 1.1), (1.1, 0.66, 1.18)),
    ((1.35, 0.0, 1.1), (1.43, 0.66, 1.18)),
)


@dataclass(frozen=True, slots=True)
class RoomOptions:
    """Length and resolution of the scene."""

    frames: int = 20
    frame_rate: float = 30.0  # 1/s
    spacing: float = 0.03  # m between grid points of the people's surface
    seed: int = 0  # of the grids

    def __post_init__(self) -> None:
        check_length(self.frames, self.frame_rate)
        check_spacing(self.spacing)


@dataclass(frozen=True, slots=True)
class Room:
    """Clean frames of `furnished_room`."""

    options: RoomOptions
    still: Mesh  # room and furniture

    def __len__(self) -> int:
        return self.options.frames

    def __iter__(self) -> Iterator[SceneFrame]:
        return (self[number] for number in range(len(self)))

    def __getitem__(self, index: int) -> SceneFrame:
        number = range(len(self))[operator.index(index)]
        people = self.people(number)
        parts = np.repeat(np.arange(1 + len(people)), [len(mesh.faces) for mesh in (self.still, *people)])
        return replace(SceneFrame.of([self.still], people), paint=partial(self._colors, number, parts))

    def people(self, number: int) -> list[Mesh]:
        """Return the closed meshes of a frame's people: one walks around the middle, a child jumps there."""
        grid = grid_of_frame(number, self.options.spacing, self.options.seed)
        return [polygonize((figure(pose, self._thinnest),), _TOUCH, grid) for pose in self._poses(number)]

    @property
    def _thinnest(self) -> float:
        return 0.7 * self.options.spacing

    def _poses(self, number: int) -> tuple[Pose, Pose]:
        seconds = number / self.options.frame_rate
        return _walker(seconds), _child(seconds)

    def _colors(self, number: int, parts: Parts, points: Points, faces: Int64[np.ndarray, " N"]) -> Colors:
        """Return the colours of places on faces of a frame, of which `parts` are the room's (0) and each person's."""
        colors, part = room_colors(points), parts[faces]
        for person, (pose, outfit) in enumerate(zip(self._poses(number), (WALKER, CHILD), strict=True), 1):
            some = part == person
            colors[some] = person_colors(pose, self._thinnest, outfit, points[some])
        return colors


def furnished_room(options: RoomOptions | None = None) -> Room:
    """Return the frames of the room and its people; the same options give the same frames."""
    x, y, z = SIZE[0] / 2, SIZE[1], SIZE[2] / 2
    panels = [
        panel((-x, 0, z), (2 * x, 0, 0), (0, 0, -2 * z)),  # the floor
        panel((-x, 0, -z), (2 * x, 0, 0), (0, y, 0)),  # the wall at the back
        panel((-x, 0, z), (0, 0, -2 * z), (0, y, 0)),  # and that on the left
    ]
    return Room(options or RoomOptions(), concatenate([joined(panels), *map(box, FURNITURE)]))


def room_cameras(width: int = 320) -> tuple[DepthCamera, ...]:
    """Return depth cameras in the corners that look down at the middle; pictures of `width` x 0.9 `width` pixels."""
    return corner_cameras(BOX[0], BOX[1], width)


def _walker(seconds: float) -> Pose:
    """Pose of the walker, who circles the middle with swinging arms."""
    walked = _SPEED * seconds
    angle = walked / _CIRCLE + 2.4  # begins at the left
    place = np.array([_CIRCLE * math.cos(angle), _SOLE, -_CIRCLE * math.sin(angle)])
    wobble = math.sin(4 * math.pi * walked / _CYCLE)
    # A heading h looks along (sin h, 0, cos h), and the way goes along (-sin angle, 0, -cos angle).
    return Pose(place, angle + math.pi, walked / _CYCLE, _STRIDE, softness=wobble)


def _child(seconds: float) -> Pose:
    """Pose of the child, who jumps on the spot, turns, and waves with both arms."""
    place = np.array([0.0, _SOLE + 0.14 * max(math.sin(2 * math.pi * seconds), 0.0), 0.0])
    heading, sway = _TURN * seconds, 0.05 * math.sin(4 * math.pi * seconds)
    out = np.array([math.cos(heading), 0.0, -math.sin(heading)])  # to its left
    wrists = tuple(place + side * (0.2 + sway) * out + [0.0, 1.2, 0.0] for side in (1.0, -1.0))
    return Pose(place, heading, wrists=(wrists[0], wrists[1]), reach=(1.0, 1.0), size=0.68, girth=1.05)


def box(corners: Box) -> Mesh:
    """Return a closed box whose faces point outward."""
    low, high = (np.array(corner) for corner in corners)
    a, b, c = np.diag(high - low)
    lower = [panel(low, b, a), panel(low, c, b), panel(low, a, c)]
    upper = [panel(high, -a, -b), panel(high, -b, -c), panel(high, -c, -a)]
    return joined(lower + upper)


def joined(panels: list[Mesh]) -> Mesh:
    """Join panels into one mesh; where two meet, they share vertices."""
    mesh = concatenate(panels)
    return weld(Mesh.of(mesh.vertices.round(9), mesh.faces))  # both panels compute a shared vertex by different sums


def panel(corner: Vector, right: Vector, up: Vector) -> Mesh:
    """Return a rectangle of small faces whose normal is right x up."""
    counts = [max(1, round(float(np.linalg.norm(side)) / _FACE)) for side in (right, up)]
    i, j = np.meshgrid(*(np.arange(count + 1) for count in counts), indexing="ij")
    shares = (i.reshape(-1, 1) / counts[0], j.reshape(-1, 1) / counts[1])
    vertices = np.asarray(corner) + shares[0] * np.asarray(right) + shares[1] * np.asarray(up)
    first = (i * (counts[1] + 1) + j)[:-1, :-1].reshape(-1)
    a, b, c, d = first, first + counts[1] + 1, first + counts[1] + 2, first + 1
    return Mesh.of(vertices, np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)]))
