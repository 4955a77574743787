"""Sequences of unusual size, unit or number of pieces, and where what moves in them truly is."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from meshreel.geometry.topology import concatenate, subdivide_midpoint
from meshreel.types import Mesh

from .metrics.shapes import moved, noisy, plane, sphere
from .scenes import ball, with_room

FRAMES = 6
LEAVES, LEAF, FLUTTER = 5000, 0.06, 0.05  # and m: side of a leaf, and how far it flutters
TOWN, HOUSES, SPEED = 2000.0, 150, 15.0  # m, and m a frame of the lorry
HEAD = np.array([0.075, 0.115, 0.1])  # m, half axes
JAW = 0.015  # m, by which it opens


@dataclass(frozen=True, slots=True)
class Scale:
    """Frames, and the vertices of what moves in each, clean; all in the frames' unit."""

    frames: list[Mesh]
    moving: list[Float64[np.ndarray, "V 3"]]
    off: (
        float  # by which what moves may be off in a frame, RMS: a quarter of its way, or of its height above the ground
    )

    def times(self, factor: float) -> "Scale":
        """The same in another unit."""
        meshes = [moved(mesh, scale=factor) for mesh in self.frames]
        return Scale(meshes, [factor * vertices for vertices in self.moving], factor * self.off)


def room() -> Scale:
    """A corner of a room, 2.4 m wide, in which a ball rolls."""
    balls = [ball(0.5 + 0.25 * t) for t in range(FRAMES)]
    return Scale(with_room(balls), [mesh.vertices for mesh in balls], 0.1)


def head() -> Scale:
    """A head alone, open at its neck, that stands still except for its jaw, which opens and closes."""
    whole = sphere(1.0, 5)
    kept = (whole.vertices[whole.faces][:, :, 1] > -0.75).any(axis=1)
    _, vertices = np.unique(faces := whole.faces[kept], return_inverse=True)
    rest = whole.vertices[np.unique(faces)]
    share = np.clip(2.5 * (-rest[:, 1] - 0.1), 0, 1) * np.clip(2 * rest[:, 2], 0, 1)  # low and in front
    opens = np.abs(np.sin(np.arange(FRAMES) * np.pi / 4))
    frames = [
        Mesh.of(rest * HEAD - np.outer(JAW * share * open_, [0, 1, 0]), vertices.reshape(-1, 3)) for open_ in opens
    ]
    moving = [mesh.vertices[share > 0.5] for mesh in frames]
    return Scale([noisy(mesh, 0.0003, seed) for seed, mesh in enumerate(frames)], moving, JAW / 4)


def town() -> Scale:
    """A town of 2 km with houses, through which a lorry drives."""
    random = np.random.default_rng(0)
    places, sizes = random.uniform(60, TOWN - 60, (HOUSES, 2)), random.uniform(8, 30, (HOUSES, 3))
    houses = [_box(size, (*place, size[2] / 2)) for place, size in zip(places, sizes, strict=True)]
    still = concatenate([plane(TOWN, 120), *houses])
    lorries = [_box((12, 3, 4), (900 + SPEED * t, 1000, 2.5)) for t in range(FRAMES)]
    frames = [noisy(concatenate([still, lorry]), 0.05, seed) for seed, lorry in enumerate(lorries)]
    return Scale(frames, [lorry.vertices for lorry in lorries], 1.0)


def tree() -> Scale:
    """A tree of some thousand leaves, all of which flutter, none in step with another."""
    random = np.random.default_rng(0)
    ways, reach = random.normal(size=(LEAVES, 3)), random.uniform(0.3, 1, LEAVES)
    middles = 1.5 * (ways / np.linalg.norm(ways, axis=1)[:, None]) * np.cbrt(reach)[:, None] + [0, 2.5, 0]
    sides = random.normal(size=(LEAVES, 2, 3))
    sides *= LEAF / np.linalg.norm(sides, axis=2, keepdims=True)
    corners = middles[:, None] + np.stack([0 * sides[:, 0], sides[:, 0], sides.sum(axis=1), sides[:, 1]], axis=1)
    first = 4 * np.arange(LEAVES)[:, None]
    faces = np.concatenate([first + [0, 1, 2], first + [0, 2, 3]])
    phases, flutters = random.uniform(0, 2 * np.pi, LEAVES), random.normal(size=(LEAVES, 3))
    flutters *= FLUTTER / np.linalg.norm(flutters, axis=1)[:, None]
    offsets = [np.sin(phases + 0.8 * t)[:, None] * flutters for t in range(FRAMES)]
    leaves = [(corners + offset[:, None]).reshape(-1, 3) for offset in offsets]
    trunk = moved(sphere(1.0, 4), (0, 0, 0))
    trunk = Mesh.of(trunk.vertices * [0.15, 1.2, 0.15] + [0, 1.2, 0], trunk.faces)
    return Scale([concatenate([trunk, Mesh.of(vertices, faces)]) for vertices in leaves], leaves, FLUTTER / 4)


def _box(size: object, middle: object) -> Mesh:
    """A closed box with faces of a few metres."""
    corners = np.array(np.meshgrid([-0.5, 0.5], [-0.5, 0.5], [-0.5, 0.5], indexing="ij")).reshape(3, -1).T
    quads = np.array([[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]])
    mesh = Mesh.of(corners * size + np.asarray(middle), np.concatenate([quads[:, :3], quads[:, [0, 2, 3]]]))
    return subdivide_midpoint(mesh, 2)


SCALES: dict[str, Callable[[], Scale]] = {
    "a room in m": room,
    "a room in cm": lambda: room().times(100),
    "a room in mm": lambda: room().times(1000),
    "a scan of 12 cm": lambda: room().times(0.03),
    "a scan of 4 cm": lambda: room().times(0.01),
    "a head in m": head,
    "a head in mm": lambda: head().times(1000),
    "a town": town,
    "a tree": tree,
}
