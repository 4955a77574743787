"""What the template should look like where the data do not say: the shape of the key frame, turned as the body turns.

Laplacian coordinates of the rest shape, rotated per vertex (as-rigid-as-possible), the faces that no longer look like
the rest shape, and the strongest components of all trajectories.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float64

from ...geometry.topology import face_normals
from ...types import Mesh
from .system import Template

SPREAD = 3  # times that rotations are averaged over the one-ring: a folded ring has none of its own
FOLDED = 0.0  # cosine between a face's normal and its turned rest normal below which it is doubtful
COLLAPSED = 0.1  # share of its rest area


def turned_laplacian(
    template: Template, rest: Float64[np.ndarray, "V 3"], now: Float64[np.ndarray, "V 3"]
) -> tuple[Float64[np.ndarray, "V 3"], Float64[np.ndarray, "V 3 3"]]:
    """The Laplacian coordinates of `rest`, turned as each neighborhood turns to `now`; and these rotations."""
    turns = _rotations(template, rest, now)
    return np.einsum("vij,vj->vi", turns, template.laplacian @ rest), turns


def doubtful(
    template: Template,
    rest: Float64[np.ndarray, "V 3"],
    turns: Float64[np.ndarray, "V 3 3"],
    now: Float64[np.ndarray, "V 3"],
) -> Bool[np.ndarray, " V"]:
    """The vertices at and next to faces that fold over or collapse against the turned rest shape."""
    faces = template.faces
    before, area = face_normals(Mesh(rest, faces.astype(np.int32)))
    after, left = face_normals(Mesh(now, faces.astype(np.int32)))
    cosine = np.einsum("fij,fj,fi->f", turns[faces[:, 0]], before, after)
    bad = (cosine < FOLDED) | (left < COLLAPSED * area)
    for _ in range(2):
        mark = np.zeros(template.count, dtype=bool)
        mark[faces[bad].reshape(-1)] = True
        bad = mark[faces].any(axis=1)
    return mark


def strongest_components(positions: Float64[np.ndarray, "T V 3"], key: int, count: int) -> Float64[np.ndarray, "T V 3"]:
    """The trajectories relative to the key frame, rebuilt from their `count` strongest components (eqs. 8-9)."""
    frames, vertices, _ = positions.shape
    field = (positions - positions[key]).transpose(1, 0, 2).reshape(vertices, 3 * frames)
    mean = field.mean(axis=0)
    _, vectors = np.linalg.eigh((field - mean).T @ (field - mean))
    basis = vectors[:, ::-1][:, :count]
    kept = (field - mean) @ basis @ basis.T + mean
    return positions[key] + kept.reshape(vertices, frames, 3).transpose(1, 0, 2)


def _rotations(
    template: Template, before: Float64[np.ndarray, "V 3"], after: Float64[np.ndarray, "V 3"]
) -> Float64[np.ndarray, "V 3 3"]:
    """The rotation of each vertex's neighborhood (Kabsch), from covariances averaged over SPREAD rings."""
    i, j = template.edges.T
    outer = ((before[j] - before[i])[:, :, None] * (after[j] - after[i])[:, None, :]).reshape(-1, 9)
    both = np.concatenate([i, j])
    sums = np.stack([np.bincount(both, np.tile(outer[:, k], 2), template.count) for k in range(9)], axis=1)
    sums = sums / (np.abs(sums).sum(axis=1, keepdims=True) + 1e-30)
    for _ in range(SPREAD):
        sums -= 0.5 * (template.laplacian @ sums)
    u, _, vt = np.linalg.svd(sums.reshape(-1, 3, 3))
    sign = np.ones((template.count, 3))
    sign[:, 2] = np.linalg.det(u @ vt)
    return np.einsum("vki,vk,vjk->vij", vt, sign, u)
