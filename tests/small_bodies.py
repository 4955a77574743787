"""Small bodies that bend, turn and move: 66 or 258 vertices, of one topology, half of them with noise."""

import numpy as np

from meshreel.types import Mesh
from tests.metrics.shapes import sphere


def body(seed: int, frames: int = 3) -> list[Mesh]:
    """The frames of one of many bodies."""
    random = np.random.default_rng(seed)
    ball = sphere(levels=2 + seed % 2)
    waves, way, sigma = random.normal(size=(3, 3)), 0.2 * random.normal(size=3), 0.01 * (seed // 2 % 2)
    found = []
    for t in range(frames):
        points = ball.vertices * [1.0, 0.7, 0.5]
        points = points + 0.15 * np.sin(2 * np.einsum("vi,ij->vj", points, waves) + 0.4 * t) + t * way
        x, y, z = points.T
        turned = np.stack([x - 0.1 * t * y, y + 0.1 * t * x, z], axis=1)
        found.append(Mesh.of(turned + sigma * random.normal(size=turned.shape), ball.faces))
    return found
