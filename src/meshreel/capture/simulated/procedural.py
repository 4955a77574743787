"""Procedural sequence: moving people, whose connectivity changes every frame."""

from __future__ import annotations

import math
import operator
from dataclasses import dataclass

import numpy as np

from ...errors import InputError
from ...types import Mesh, MeshSequence
from .figure import Pose, figure
from .implicit import Body, Grid, polygonize

_TOUCH = 0.02  # m over which two people's surfaces blend where they meet (guess)
_FAR, _NEAR = 1.9, 0.66  # m between the two people, at most and at least (guess)
_CYCLE = 0.9  # m walked in a step cycle (guess)
_STORY = 3.0  # s to walk up, shake hands, part and wave; then the story repeats (guess)


@dataclass(frozen=True, slots=True)
class SoftBodiesOptions:
    """Length, resolution and number of the people."""

    frames: int = 90
    frame_rate: float = 30.0  # 1/s
    spacing: float = 0.022  # m between grid points: 0.022 gives about 10k vertices for two people
    people: int = 2  # 1 to 3
    begin: float = 0.0  # s into the story; 0.95 with 30 frames: apart, in touch, apart
    seed: int = 0  # of the grids

    def __post_init__(self) -> None:
        check_length(self.frames, self.frame_rate)
        check_spacing(self.spacing)
        if not 1 <= self.people <= 3:
            raise InputError(f"people {self.people} is not 1, 2 or 3; choose one of these")
        if not 0 <= self.begin < math.inf:
            raise InputError(f"begin {self.begin} is not a time from 0 on; give seconds, as 0.95")


def check_length(frames: int, frame_rate: float) -> None:
    """Raise InputError for a length or a rate that no procedural sequence can have."""
    if frames < 1:
        raise InputError(f"frames {frames} is below 1; ask for at least one")
    if not 0 < frame_rate < math.inf:
        raise InputError(f"frame rate {frame_rate} is not a positive number; give one, as 30")


def check_spacing(spacing: float) -> None:
    """Raise InputError for a grid that is too fine to make, or too coarse for people."""
    if not 0.008 <= spacing <= 0.1:
        raise InputError(f"spacing {spacing} m is outside 0.008 to 0.1; 0.022 suits two people, 0.03 a room")


@dataclass(frozen=True, slots=True)
class SoftBodies(MeshSequence):
    """MeshSequence of the frames of `soft_bodies`."""

    options: SoftBodiesOptions

    @property
    def frame_rate(self) -> float:
        return self.options.frame_rate

    def __len__(self) -> int:
        return self.options.frames

    def __getitem__(self, index: int) -> Mesh:
        number = range(len(self))[operator.index(index)]
        moment = (self.options.begin + number / self.options.frame_rate) / _STORY % 1.0
        grid = grid_of_frame(number, self.options.spacing, self.options.seed)
        return polygonize(cast(moment, self.options), _TOUCH, grid)


def soft_bodies(options: SoftBodiesOptions | None = None) -> SoftBodies:
    """Return people who meet, shake hands, part and wave; y up, m, a new grid, 10k vertices and 1.5 s for a frame."""
    return SoftBodies(options or SoftBodiesOptions())


def cast(moment: float, options: SoftBodiesOptions) -> tuple[Body, ...]:
    """Return the bodies at a moment (0 to 1) of the story."""
    thinnest = 0.7 * options.spacing
    poses = (_host(moment), _guest(moment), _child(moment))
    return tuple(figure(pose, thinnest) for pose in poses[: options.people])


def grid_of_frame(number: int, spacing: float, seed: int) -> Grid:
    """Return a differently rotated lattice for each frame, so that no two frames share connectivity."""
    random = np.random.default_rng((seed, number))
    a, b, c = random.uniform(-0.15, 0.15, 3)
    skew = np.array([[0.0, -c, b], [c, 0.0, -a], [-b, a, 0.0]])
    turn = np.linalg.solve(np.eye(3) - skew, np.eye(3) + skew)  # Cayley: a rotation of up to 30 degrees
    return Grid(turn, random.uniform(0, 1, 3), spacing)


def _host(moment: float) -> Pose:
    """Pose of the host, who walks to +x, waves before the meeting and pats the guest's arm during it."""
    gap, step, stride = _walk(moment)
    place = np.array([-gap / 2, 0.0, -0.12])
    shake = _shake(moment)
    hello = _during(moment, 0.02, 0.10, 0.17, 0.27)
    wave = place + [0.12, 1.62, 0.42 + 0.10 * np.sin(2 * np.pi * 7 * moment)]
    right = _mixed((wave, hello), (np.array([-0.10, 1.10 + shake, 0.055]), _meeting(moment)))
    pat = np.array([_NEAR / 2 - 0.14, 1.34 + 0.02 * np.sin(2 * np.pi * 8 * moment), -0.18])
    reach = (_during(moment, 0.36, 0.44, 0.56, 0.64), right[1])
    return Pose(place, np.pi / 2, step, stride, (pat, right[0]), reach, _wobble(step, stride), 1.0, 1.0)


def _guest(moment: float) -> Pose:
    """Pose of the guest, who walks to -x and waves goodbye."""
    gap, step, stride = _walk(moment)
    place = np.array([gap / 2, 0.0, 0.12])
    bye = _during(moment, 0.72, 0.80, 0.90, 0.98)
    wave = place + [-0.12, 1.52, -0.42 + 0.10 * np.sin(2 * np.pi * 7 * moment)]
    right = _mixed((wave, bye), (np.array([0.10, 1.10 + _shake(moment), -0.055]), _meeting(moment)))
    wrists, reach = (None, right[0]), (0.0, right[1])
    return Pose(place, -np.pi / 2, step + 0.5, stride, wrists, reach, _wobble(step, stride), 0.95, 1.12)


def _child(moment: float) -> Pose:
    """Pose of the child, who jumps behind the two and waves with both arms."""
    jump = 0.16 * max(np.sin(2 * np.pi * 3 * moment), 0.0)
    place = np.array([0.1, jump, -0.95])
    sway = 0.08 * np.sin(2 * np.pi * 6 * moment)
    wrists = (place + [0.26 + sway, 1.12, 0.06], place + [-0.26 + sway, 1.12, 0.06])
    return Pose(place, 0.2, 0.0, 0.0, wrists, (1.0, 1.0), math.sin(6 * math.pi * moment), 0.66, 1.05)


def _walk(moment: float) -> tuple[float, float, float]:
    """Return the distance of the two, the step cycles walked and the stride: they approach, stay, and back away."""
    near = _during(moment, 0.0, 0.36, 0.62, 1.0)
    speed = abs(_during(moment + 0.01, 0.0, 0.36, 0.62, 1.0) - near) / 0.01
    walked = near * (_FAR - _NEAR) / 2
    return _FAR - (_FAR - _NEAR) * near, walked / _CYCLE, 0.5 * min(speed / 2.5, 1.0)


def _meeting(moment: float) -> float:
    return _during(moment, 0.26, 0.37, 0.60, 0.70)


def _shake(moment: float) -> float:
    return 0.04 * math.sin(2 * math.pi * 9 * moment) * _during(moment, 0.36, 0.40, 0.54, 0.58)


def _wobble(step: float, stride: float) -> float:
    return math.sin(4 * math.pi * step) * min(stride / 0.3, 1.0)


def _during(moment: float, rise: float, full: float, fade: float, end: float) -> float:
    """Return 0 outside `rise` to `end`, 1 from `full` to `fade`, and a smooth transition between."""
    up = np.clip((moment - rise) / (full - rise), 0, 1)
    down = np.clip((end - moment) / (end - fade), 0, 1)
    return float(up * up * (3 - 2 * up) * down * down * (3 - 2 * down))


def _mixed(*targets: tuple[np.ndarray, float]) -> tuple[np.ndarray, float]:
    """Return the target with the largest weight, and that weight."""
    return max(targets, key=lambda target: target[1])
