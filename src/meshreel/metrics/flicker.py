"""Flicker: change of a moving surface's normals between two frames beyond its motion.

Points and normals of a body in successive frames -> angles. Motion is removed piece by piece: the points of a frame are
registered to those of the next, first all together, then in blocks of half the size each time, point to plane. Real
deformation within a block, as of cloth, remains: compare with the flicker of the input, not with 0.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float64, Int64
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from ..geometry.closest_points import Surface
from ..types import Mesh
from .normals import angles, interpolate, welded_normals

SIZES = (4.8, 0.6, 0.3, 0.15)  # m, of the blocks, coarse to fine; the first is a whole body (guess)
ROUNDS = 4  # of registration, for each size (guess)
REACH = 0.3  # of a block's size, largest distance of a point from its match during registration (guess)
FARTHEST = 0.3  # m, upper limit of this distance
MATCHED = 0.02  # m: points that end farther from the next frame's surface are left out (guess)
SAMPLES = 4000  # largest number of a body's points that are registered (guess)
DAMPING = 1e-3  # share of a block's points, prevents sliding along a plane (guess)


@dataclass(frozen=True, slots=True)
class Patch:
    """Points of a surface with their unit normals."""

    points: Float64[np.ndarray, "N 3"]  # m
    normals: Float64[np.ndarray, "N 3"]

    @staticmethod
    def join(patches: Iterable[Patch]) -> Patch:
        points, normals = zip(*((each.points, each.normals) for each in patches), strict=True)
        return Patch(np.concatenate(points), np.concatenate(normals))

    def at(self, which: Bool[np.ndarray, " N"] | Int64[np.ndarray, " M"]) -> Patch:
        return Patch(self.points[which], self.normals[which])


def angles_after_motion(before: Patch, after: Patch, surface: Mesh) -> Float64[np.ndarray, " M"]:
    """Return the angles between points' normals and the next frame's at their moved positions, degrees.

    `surface` is the next frame's whole surface, `after` the body's points on it: points without one of these within
    `MATCHED` are left out.
    """
    if not (len(before.points) and len(after.points)):
        return np.zeros(0)
    tree = cKDTree(after.points)
    count = len(before.points)
    moved = before.at(np.unique(np.linspace(0, count - 1, min(count, SAMPLES)).astype(np.int64)))
    first = moved.points
    for size in SIZES:
        blocks = np.unique(np.floor(first / size).astype(np.int64), axis=0, return_inverse=True)[1].reshape(-1)
        for _ in range(ROUNDS):
            away, at = tree.query(moved.points, distance_upper_bound=min(REACH * size, FARTHEST))
            near = np.isfinite(away)
            moved = _laid(moved, after.at(np.where(near, at, 0)), near, blocks, size)
    moved = moved.at(tree.query(moved.points)[0] <= MATCHED)
    hits = Surface(surface).closest(moved.points)
    return angles(moved.normals, interpolate(welded_normals(surface), surface.faces[hits.faces], hits.barycentric))


def _laid(
    moved: Patch, onto: Patch, near: Bool[np.ndarray, " N"], blocks: Int64[np.ndarray, " N"], size: float
) -> Patch:
    """Move each block rigidly by one linear step that brings its points near a match into the match's plane."""
    count = blocks.max() + 1
    sizes = np.maximum(np.bincount(blocks, minlength=count), 1)
    middles = np.stack([np.bincount(blocks, axis, count) for axis in moved.points.T], axis=1) / sizes[:, None]
    local = (moved.points - middles[blocks]) / size
    rows = np.concatenate([np.cross(local, onto.normals), onto.normals], axis=1) * near[:, None]
    off = np.einsum("nd,nd->n", onto.points - moved.points, onto.normals)
    squares = np.zeros((count, 6, 6))
    sums = np.zeros((count, 6))
    np.add.at(squares, blocks, rows[:, :, None] * rows[:, None, :])
    np.add.at(sums, blocks, rows * off[:, None])
    squares += (DAMPING * sizes)[:, None, None] * np.eye(6)
    steps = np.linalg.solve(squares, sums[..., None])[..., 0]
    turns = Rotation.from_rotvec(steps[:, :3] / size).as_matrix()[blocks]
    points = np.einsum("nij,nj->ni", turns, moved.points - middles[blocks]) + middles[blocks] + steps[blocks, 3:]
    return Patch(points, np.einsum("nij,nj->ni", turns, moved.normals))
