"""Rigid motions: weighted least-squares fits, and unit dual quaternions that blend them (paper, section 3.3.2).

All functions are batched. A dual quaternion is a row of 8: real part (w, x, y, z), then dual part (w, x, y, z).
"""

from __future__ import annotations

import numpy as np

from ..shapes import Float64
from . import strict

Motions = Float64[np.ndarray, "N 8"]
Rotations = Float64[np.ndarray, "N 3 3"]
Points = Float64[np.ndarray, "N 3"]

DEGENERATE = 1e-10  # share of the largest singular value below which one does not constrain the rotation (guess)


def fit_rigid(
    source: Float64[np.ndarray, "N n 3"], target: Float64[np.ndarray, "N n 3"], weights: Float64[np.ndarray, "N n"]
) -> tuple[Rotations, Points]:
    """Fit rotations R and translations t that minimise sum w |R source + t - target|^2 in each of N rows (Kabsch).

    Points on a line, or a single point, leave part of the rotation open: the smallest rotation is chosen.
    """
    share = weights / np.maximum(weights.sum(axis=1, keepdims=True), np.finfo(float).tiny)
    middle_s = np.einsum("ni,nid->nd", share, source)
    middle_t = np.einsum("ni,nid->nd", share, target)
    s, t = source - middle_s[:, None], target - middle_t[:, None]
    covariances = strict.products(np.swapaxes(share[..., None] * t, 1, 2), s)
    rotations, size = strict.nearest_rotations(covariances)
    open_axis = size[:, 1] <= DEGENERATE * size[:, 0]  # rank 1 or 0: pull the open part towards no rotation
    if open_axis.any():
        pull = np.maximum(size[open_axis, 0], np.finfo(float).tiny)[:, None, None] * 1e-6 * np.eye(3)
        rotations[open_axis] = strict.nearest_rotations(covariances[open_axis] + pull)[0]
    return rotations, middle_t - np.einsum("nij,nj->ni", rotations, middle_s)


def from_rigid(rotations: Rotations, translations: Points) -> Motions:
    """Return the unit dual quaternions of the motions x -> R x + t."""
    real = quaternions(rotations)
    pure = np.concatenate([np.zeros((len(real), 1)), translations], axis=1)
    return np.concatenate([real, multiply(pure, real) / 2], axis=1)


def blend(motions: Float64[np.ndarray, "N n 8"], weights: Float64[np.ndarray, "N n"]) -> Motions:
    """Blend each row's n motions into their weighted mean, a unit dual quaternion.

    q and -q are one rotation: each motion is first flipped to the hemisphere of its row's first motion.
    """
    real = motions[..., :4]
    sign = np.where(np.einsum("nik,nk->ni", real, real[:, 0]) < 0, -1.0, 1.0)
    sums = strict.products((weights * sign)[:, None, :], motions)[:, 0]
    length = np.linalg.norm(sums[:, :4], axis=1, keepdims=True)  # the nearest unit: |real| = 1 and real . dual = 0
    real, dual = sums[:, :4] / length, sums[:, 4:] / length
    return np.concatenate([real, dual - np.sum(real * dual, axis=1, keepdims=True) * real], axis=1)


def apply(motions: Motions, points: Points) -> Points:
    """Move each point by its unit dual quaternion."""
    real, dual = motions[:, :4], motions[:, 4:]
    translation = 2 * (real[:, :1] * dual[:, 1:] - dual[:, :1] * real[:, 1:] + np.cross(real[:, 1:], dual[:, 1:]))
    return rotate(motions, points) + translation


def rotate(motions: Motions, vectors: Points) -> Points:
    """Rotate each vector, such as a normal, by its unit dual quaternion without translating it."""
    w, axis = motions[:, :1], motions[:, 1:4]
    return vectors + 2 * np.cross(axis, np.cross(axis, vectors) + w * vectors)


def multiply(a: Float64[np.ndarray, "N 4"], b: Float64[np.ndarray, "N 4"]) -> Float64[np.ndarray, "N 4"]:
    """Multiply quaternions (w, x, y, z) row by row (Hamilton product)."""
    scalar = a[:, 0] * b[:, 0] - np.sum(a[:, 1:] * b[:, 1:], axis=1)
    vector = a[:, :1] * b[:, 1:] + b[:, :1] * a[:, 1:] + np.cross(a[:, 1:], b[:, 1:])
    return np.concatenate([scalar[:, None], vector], axis=1)


def quaternions(rotations: Rotations) -> Float64[np.ndarray, "N 4"]:
    """Return unit quaternions of rotations, from the largest of w, x, y, z, to avoid a division by a small one."""
    r = rotations
    trace = np.trace(r, axis1=1, axis2=2)
    d0, d1, d2 = r[:, 0, 0], r[:, 1, 1], r[:, 2, 2]
    xw, yw, zw = r[:, 2, 1] - r[:, 1, 2], r[:, 0, 2] - r[:, 2, 0], r[:, 1, 0] - r[:, 0, 1]
    xy, xz, yz = r[:, 1, 0] + r[:, 0, 1], r[:, 0, 2] + r[:, 2, 0], r[:, 2, 1] + r[:, 1, 2]
    columns = [  # 4 q q^T: each is q times one of its own components
        [1 + trace, xw, yw, zw],
        [xw, 1 + d0 - d1 - d2, xy, xz],
        [yw, xy, 1 - d0 + d1 - d2, yz],
        [zw, xz, yz, 1 - d0 - d1 + d2],
    ]
    rows = np.ascontiguousarray(np.moveaxis(np.array(columns), 2, 0))
    best = rows.diagonal(axis1=1, axis2=2).argmax(axis=1)
    q = rows[np.arange(len(r)), best]
    return q / np.linalg.norm(q, axis=1, keepdims=True)
