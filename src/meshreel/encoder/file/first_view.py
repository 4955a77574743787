"""Guess of the first view: from where the cameras of a rig saw the people, else from where bodies face, else aside.

In: bodies of some frames, the cameras and the room, if they are known. Out: a view in normalised coordinates, from
which all of the bodies fit a square picture in all of these frames.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import product
from typing import Any

import numpy as np
from jaxtyping import Float64

from ...analysis.front import Body, bodies_of, frames_looked_at, front_of
from ...analysis.survey import Survey, piece_of_faces
from ...format.view import USUAL, View
from ...geometry.cameras import Camera, Rays, looking_at
from ...geometry.threads import ahead
from ...geometry.topology import clean, part_of
from ...types import UPRIGHT, Mesh, Up
from ..run.schedule import Job
from ..scene.parts import cameras_of

Point = Float64[np.ndarray, "3"]

ASIDE = np.array([0.6, 0.8])  # direction, seen from above, of a three-quarter view of what has no front (guess)
EYES = 0.93  # of the height of what stands: people's eyes
ONE_SIDE = 0.5  # of the directions' lengths, seen from above: what their mean has where cameras are on one side (guess)
SEEN = 0.5  # share of the corners of the bodies' boxes that a camera must see, to count (guess)
STEEPEST = 0.87  # sine of the steepest look down or up, 60 degrees (guess)
MARGIN = 1.1  # times the size of a picture that just holds all bodies: room for the player's controls (guess)
# Before a wall: the share of the way to it, the least share of the distance wanted, and the most degrees (guesses).
FREE, CLOSEST, WIDEST = 0.9, 0.5, 90.0
TURNS = (
    0,
    15,
    -15,
    30,
    -30,
    45,
    -45,
    60,
    -60,
)  # degrees from the way wanted: a wall may hide bodies there (guess)
HEIGHTS = (0.2, 0.5, 0.8)  # shares of a body's height that must be seen (guess)
ACROSS = 9  # places across a picture at which it is asked whether a wall is before it (guess)
A_DEGREE = 0.006  # share of bodies and picture that a turn must show more, for each degree (guess)
BEFORE = 0.98  # of the way to a body: what is hit nearer hides it (guess)
DIGITS = 4  # of normalised places: 0.2 mm of a person


@dataclass(frozen=True, slots=True)
class Surroundings:
    """Cameras and room around the bodies, in the world's coordinates."""

    up: Up
    cameras: tuple[Camera, ...] = ()
    room: Mesh = field(default_factory=Mesh.empty)


def first_view(
    job: Job, survey: Survey, seen: Mapping[int, Sequence[Body]] | None = None, room: Mesh | None = None
) -> dict[str, Any]:
    """Return the metadata of the first view; without bodies that were `seen`, frames of the whole sequence are read."""
    sequence = job.sequence

    def read(number: int) -> list[Body]:
        mesh, count = clean(sequence[number]), len(survey.pieces[number])
        pieces = piece_of_faces(mesh) if count else np.zeros(len(mesh.faces), np.int64)
        return bodies_of((part_of(mesh, pieces == piece) for piece in range(max(count, 1))), sequence.up)

    if seen is None:
        numbers = frames_looked_at(len(sequence), sequence.frame_rate)
        seen = dict(zip(numbers, ahead(read, numbers), strict=True))
    cameras = cameras_of(sequence.depth or sequence.colors, len(sequence))
    view = guessed_view(seen, sequence.frame_rate, Surroundings(sequence.up, cameras, room or Mesh.empty()), survey)
    return {} if view is None else view.item


def guessed_view(
    frames: Mapping[int, Sequence[Body]], frame_rate: float, around: Surroundings, survey: Survey
) -> View | None:
    """Return the view of the bodies in some frames, by their numbers; None where there are none."""
    bodies = [body for some in frames.values() for body in some]
    if not bodies:
        return None
    corners = np.array([corner for body in bodies for corner in product(*zip(body.low, body.high, strict=True))])
    target = (corners.min(axis=0) + corners.max(axis=0)) / 2
    floor, turn = float(corners[:, 1].min()), np.array(UPRIGHT[around.up], np.float64)
    eyes = floor + EYES * max(body.height for body in bodies)
    way = _to_cameras(around.cameras, corners, target, turn)
    if way is None:
        front = front_of(frames, frame_rate, ASIDE)
        x, z = ASIDE if front is None else front
        level = np.array([x, 0.0, z])
        rise = (eyes - target[1]) / (_distance(corners - target, level, USUAL) or 1.0)
        way = level + np.array([0.0, rise, 0.0])
    way = _no_steeper(way / math.hypot(*way))
    room = Rays(around.room.at(around.room.vertices @ turn.T))
    points = np.array([point for body in bodies for point in _heights(body)])
    stands = [_stand(corners, _turned(way, angle), target, eyes, room) for angle in TURNS]
    shares = [_shown(room, points, stand) - A_DEGREE * abs(angle) for stand, angle in zip(stands, TURNS, strict=True)]
    best = stands[shares.index(max(shares))]
    places = np.stack([best.eye, target]) @ turn
    position, target = np.round((places - survey.center) / survey.unit, DIGITS).tolist()
    view = View(tuple(position), tuple(target), round(best.fov, 1))
    return view if view.is_valid else None


@dataclass(frozen=True, slots=True)
class _Stand:
    """Place from which a square picture shows the bodies."""

    target: Point
    way: Point  # from the target to the eye, of length 1
    distance: float
    fov: float  # degrees

    @property
    def eye(self) -> Point:
        return self.target + self.distance * self.way


def _stand(corners: np.ndarray, way: Point, target: Point, eyes: float, room: Rays) -> _Stand:
    """Return the place along a way from which a picture holds all corners: before a wall, if one is near.

    A wall is looked for at the height of the `eyes`.
    """
    points = corners - target
    distance, fov = _distance(points, way, USUAL), USUAL
    wall = FREE * float(room.cast(np.array([[target[0], eyes, target[2]]]), way[None]).distances[0])
    if CLOSEST * distance < wall < distance:
        distance, fov = wall, min(_angle(points, way, wall), WIDEST)
    return _Stand(target, way, distance, fov)


def _turned(way: Point, angle: float) -> Point:
    """Return a direction turned about the vertical by degrees."""
    c, s = math.cos(math.radians(angle)), math.sin(math.radians(angle))
    return np.array([c * way[0] + s * way[2], way[1], c * way[2] - s * way[0]])


def _shown(room: Rays, points: Float64[np.ndarray, "N 3"], stand: _Stand) -> float:
    """Return the share of points, times that of the picture around the target, before which no surface is."""
    half = stand.distance * math.tan(math.radians(stand.fov) / 2)
    right, down = looking_at(stand.way, np.zeros(3))[:3, :2].T
    grid = half * np.linspace(-1, 1, ACROSS)
    around = stand.target + (grid[:, None, None] * right + grid[None, :, None] * down).reshape(-1, 3)
    return _visible(room, points, stand.eye) * _visible(room, around, stand.eye)


def _visible(room: Rays, points: Float64[np.ndarray, "N 3"], eye: Point) -> float:
    """Return the share of points that no surface of the room hides from a place."""
    hits = room.cast(eye[None], points - eye)
    return float((hits.distances > BEFORE).mean())


def _heights(body: Body) -> list[Point]:
    """Return points of the axis of a body's box."""
    middle = (body.low + body.high) / 2
    return [np.array([middle[0], body.low[1] + share * body.height, middle[2]]) for share in HEIGHTS]


def _to_cameras(cameras: Sequence[Camera], corners: np.ndarray, target: Point, turn: np.ndarray) -> Point | None:
    """Return the way to the middle of the cameras that see the bodies; None where they stand on all sides."""
    seeing = [camera for camera in cameras if len(camera.seen(corners @ turn)[1]) >= SEEN * len(corners)]
    ways = np.array([turn @ camera.eye - target for camera in seeing]).reshape(-1, 3)
    lengths = np.sqrt((ways**2).sum(axis=1))
    if not len(ways) or not lengths.all():
        return None
    level, way = ways[:, [0, 2]] / lengths[:, None], ways.mean(axis=0)
    usual = float(np.sqrt((level**2).sum(axis=1)).mean())
    are_above = usual**2 < 1 - STEEPEST**2
    return way if way.any() and (are_above or math.hypot(*level.mean(axis=0)) >= ONE_SIDE * usual) else None


def _no_steeper(way: Point) -> Point:
    """Return a direction of length 1 that is no steeper than `STEEPEST`; from straight above, it turns towards +z."""
    if abs(way[1]) <= STEEPEST:
        return way
    level = math.sqrt(1 - STEEPEST**2)
    x, z = (way[0], way[2]) if math.hypot(way[0], way[2]) > 1e-6 else (0.0, 1.0)
    return np.array([x, 0.0, z]) * level / math.hypot(x, z) + np.array([0.0, math.copysign(STEEPEST, way[1]), 0.0])


def _aside(points: np.ndarray, way: Point) -> tuple[Float64[np.ndarray, " N"], Float64[np.ndarray, " N"]]:
    """Return how far points are from the target: towards the viewer, and to the side or up, the larger of both."""
    right, down = looking_at(way, np.zeros(3))[:3, :2].T
    offsets = [np.abs((points * axis).sum(axis=1)) for axis in (right, down)]
    return (points * way).sum(axis=1), MARGIN * np.maximum(*offsets)


def _distance(points: np.ndarray, way: Point, fov: float) -> float:
    """Return the distance along a way from which a square picture holds points."""
    nearer, aside = _aside(points, way)
    return float((nearer + aside / math.tan(math.radians(fov) / 2)).max())


def _angle(points: np.ndarray, way: Point, distance: float) -> float:
    """Return the degrees at which a square picture from a distance holds points, at least the usual ones."""
    nearer, aside = _aside(points, way)
    before = np.maximum(distance - nearer, 1e-3 * distance)
    return max(math.degrees(2 * math.atan(float((aside / before).max()))), USUAL)
