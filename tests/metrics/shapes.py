"""Meshes with known geometry, and closest points by brute force."""

import numpy as np

from meshreel.geometry.topology import subdivide_midpoint
from meshreel.types import Mesh


def sphere(radius: float = 1.0, levels: int = 4) -> Mesh:
    """An octahedron subdivided and pushed onto the sphere."""
    v = np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]], dtype=float)
    f = [[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]]
    mesh = subdivide_midpoint(Mesh.of(v, f), levels)
    return Mesh.of(radius * mesh.vertices / np.linalg.norm(mesh.vertices, axis=1)[:, None], mesh.faces)


def plane(side: float = 1.0, cells: int = 10, height: float = 0.0) -> Mesh:
    """A square grid in z = height, facing +z."""
    x, y = np.meshgrid(np.linspace(0, side, cells + 1), np.linspace(0, side, cells + 1))
    v = np.stack([x.ravel(), y.ravel(), np.full(x.size, height)], axis=1)
    i = (np.arange(cells)[:, None] * (cells + 1) + np.arange(cells)).ravel()
    j = i + cells + 1
    return Mesh.of(v, np.concatenate([np.stack([i, i + 1, j + 1], 1), np.stack([i, j + 1, j], 1)]))


def noisy(mesh: Mesh, sigma: float, seed: int = 0) -> Mesh:
    """The mesh with Gaussian noise on its vertices."""
    offsets = np.random.default_rng(seed).normal(0, sigma, mesh.vertices.shape)
    return Mesh.of(mesh.vertices + offsets, mesh.faces)


def moved(mesh: Mesh, offset: object = (0, 0, 0), scale: float = 1.0) -> Mesh:
    """The mesh scaled about 0, then shifted."""
    return Mesh.of(mesh.vertices * scale + np.asarray(offset, dtype=float), mesh.faces)


def brute_force_distances(points: np.ndarray, mesh: Mesh) -> np.ndarray:
    """Distance of each point to the mesh, by all pairs: the plane where the foot is inside, else the three edges."""
    a, b, c = (mesh.vertices[mesh.faces[:, k]][None] for k in range(3))
    p = points[:, None]
    best = np.minimum(np.minimum(_to_segment(p, a, b), _to_segment(p, b, c)), _to_segment(p, c, a))
    normal = np.cross(b - a, c - a)
    normal = normal / np.linalg.norm(normal, axis=-1, keepdims=True)
    inside = np.ones(best.shape, dtype=bool)
    for start, end in ((a, b), (b, c), (c, a)):
        inside &= (np.cross(normal, end - start) * (p - start)).sum(-1) >= 0
    height = np.abs(((p - a) * normal).sum(-1))
    return np.where(inside, height, best).min(axis=1)


def _to_segment(p: np.ndarray, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    along = ((p - a) * (b - a)).sum(-1) / ((b - a) ** 2).sum(-1)
    return np.linalg.norm(p - a - np.clip(along, 0, 1)[..., None] * (b - a), axis=-1)
