"""A small scene with a background: a room, open at its front, in which two balls move; noise in every frame."""

import numpy as np

from meshreel.geometry.topology import concatenate, weld
from meshreel.types import Mesh, MeshList
from tests.metrics.shapes import sphere

STEP = 0.08  # m, between vertices
NOISE = 0.002  # m, of each vertex in each frame, along each axis
RADIUS = 0.22  # m, of the balls


def scene(frames: int = 8, frame_rate: float = 10.0, moving: bool = True, noise: float = NOISE) -> MeshList:
    """The frames; where nothing is `moving` the balls stay as they are in the first."""
    random = np.random.default_rng(1)
    found = []
    for number in range(frames):
        mesh = concatenate([_room(), *balls(number if moving else 0)])
        found.append(Mesh(mesh.vertices + noise * random.normal(size=mesh.vertices.shape), mesh.faces))
    return MeshList(tuple(found), frame_rate)


def balls(number: int) -> list[Mesh]:
    """The two balls in a frame: one crosses the room, one rises; neither is near a wall."""
    way = 0.12 * number
    ball = sphere(RADIUS, levels=2)
    return [Mesh(ball.vertices + at, ball.faces) for at in ([-0.7, 0.5, 0.7 - way], [0.7, 0.35 + way, -0.5])]


def _room() -> Mesh:
    """Floor, back and one side: 2 x 1.6 x 2 m."""
    floor = _plate([-1, 0, -1], [0, 0, 2], [2, 0, 0])
    back = _plate([-1, 0, -1], [2, 0, 0], [0, 1.6, 0])
    side = _plate([-1, 0, -1], [0, 1.6, 0], [0, 0, 2])
    return weld(concatenate([floor, back, side]))


def _plate(corner: list[float], right: list[float], up: list[float]) -> Mesh:
    """A rectangle of triangles; its front is where right x up points."""
    counts = [round(float(np.linalg.norm(side)) / STEP) for side in (right, up)]
    across, along = np.meshgrid(np.linspace(0, 1, counts[0] + 1), np.linspace(0, 1, counts[1] + 1))
    points = np.array(corner) + across.reshape(-1, 1) * right + along.reshape(-1, 1) * up
    first = (np.arange(counts[1])[:, None] * (counts[0] + 1) + np.arange(counts[0])).reshape(-1)
    above = first + counts[0] + 1
    lower, upper = np.stack([first, first + 1, above], axis=1), np.stack([first + 1, above + 1, above], axis=1)
    return Mesh.of(points, np.concatenate([lower, upper]))


ROOM_FACES = len(_room().faces)  # the first ones of each frame; the others are the balls'
