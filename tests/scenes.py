"""Tiny scenes with known parts: a corner of a room, open on two sides, and what moves in it."""

from collections.abc import Sequence

import numpy as np
from skimage.measure import marching_cubes

from meshreel.analysis.scene.standing import scene_standing
from meshreel.geometry.topology import concatenate, weld
from meshreel.types import Mesh

from .metrics.shapes import moved, noisy, plane, sphere

SIDE = 2.4  # m, of the floor and the walls
PARTS = 40  # of a side
CELL = SIDE / PARTS
NOISE = 0.1 * CELL  # m, of a coordinate
RADIUS = 0.3  # m, of the ball


def room() -> Mesh:
    """The floor z = 0 and two walls, which face inwards; one surface."""
    floor = plane(SIDE, PARTS)
    walls = [Mesh.of(floor.vertices[:, axes], floor.faces) for axes in ([2, 0, 1], [1, 2, 0])]
    return weld(concatenate([floor, *walls]))


def ball(x: float, y: float = 1.2, radius: float = RADIUS) -> Mesh:
    """A ball that lies on the floor, almost."""
    return moved(sphere(radius, 3), (x, y, radius + 0.5 * CELL))


def figure(turn: float) -> Mesh:
    """Somebody who stands and swings the arms: a trunk that never moves, and arms that do, one surface; `turn` in
    radians.
    """
    step = 0.8 * CELL
    low, high = np.array([-0.8, -0.8, 0.0]), np.array([0.8, 0.8, 1.6])
    axes = [np.arange(a, b, step) for a, b in zip(low, high, strict=True)]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    arm = 0.5 * np.array([np.cos(turn), np.sin(turn), 0.0])
    shoulder = np.array([0, 0, 0.6])
    distance = np.minimum(
        _capsule(points, np.array([0, 0, 0.25]), np.array([0, 0, 0.7]), 0.17),
        _capsule(points, shoulder - arm, shoulder + arm, 0.08),
    )
    vertices, faces, _, _ = marching_cubes(distance, 0.0, spacing=(step,) * 3)
    return Mesh.of(vertices + low + [1.2, 1.2, 0], faces)


def with_room(bodies: Sequence[Mesh], sigma: float = NOISE) -> list[Mesh]:
    """Frames: the room's faces first, those of the body behind them; noise is another in every frame."""
    return [noisy(concatenate([room(), body]), sigma, seed) for seed, body in enumerate(bodies)]


def is_scene(frames: Sequence[Mesh]) -> bool:
    return scene_standing(frames) is not None


def of_body(frame: Mesh) -> np.ndarray:
    """Which faces of such a frame are the body's."""
    return np.arange(len(frame.faces)) >= len(room().faces)


def overlap(found: np.ndarray, wanted: np.ndarray) -> float:
    """Intersection over union."""
    return float((found & wanted).sum() / max((found | wanted).sum(), 1))


def _capsule(points: np.ndarray, start: np.ndarray, end: np.ndarray, radius: float) -> np.ndarray:
    way = end - start
    along = np.clip((points - start) @ way / (way @ way), 0, 1)
    return np.linalg.norm(points - start - along[..., None] * way, axis=-1) - radius
