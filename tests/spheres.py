"""Spheres whose motion is known exactly."""

import numpy as np

from meshreel.geometry.topology import subdivide_midpoint
from meshreel.types import Mesh, MeshList


def deforming_sphere(frames: int, levels: int = 3) -> MeshList:
    """Return a unit sphere that stretches along y by 1 + 0.3 sin: 8 x 4^levels faces, fixed connectivity."""
    ball = _sphere(levels)
    stretch = 1 + 0.3 * np.sin(2 * np.pi * np.arange(frames) / max(frames, 1))
    return MeshList(tuple(Mesh.of(ball.vertices * [1.0, s, 1.0], ball.faces) for s in stretch))


def sliding_sphere(frames: int, step: float = 0.05, levels: int = 3) -> MeshList:
    """Return a unit sphere that moves along x by `step` (m) per frame: a rigid motion with a known answer."""
    ball = _sphere(levels)
    return MeshList(tuple(Mesh.of(ball.vertices + [t * step, 0.0, 0.0], ball.faces) for t in range(frames)))


def _sphere(levels: int) -> Mesh:
    tips = np.concatenate([np.eye(3), -np.eye(3)])
    faces = [(0, 1, 2), (1, 3, 2), (3, 4, 2), (4, 0, 2), (1, 0, 5), (3, 1, 5), (4, 3, 5), (0, 4, 5)]
    mesh = Mesh.of(tips, faces)
    for _ in range(levels):
        mesh = subdivide_midpoint(mesh)
        mesh = Mesh.of(mesh.vertices / np.linalg.norm(mesh.vertices, axis=1, keepdims=True), mesh.faces)
    return mesh
