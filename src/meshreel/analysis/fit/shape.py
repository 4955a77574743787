"""Shape priors of a fit: the rest shape rotated as the body turns, and the strongest components of all trajectories.

In: a template's rest shape and its positions. Out: Laplacian coordinates rotated per vertex (as-rigid-as-possible),
vertices at faces that differ from the rest shape, trajectories rebuilt from few components.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float64

from ...geometry.strict import eigen, nearest_rotations, products
from ...geometry.topology import face_normals
from ...types import Mesh
from .system import Template

SPREAD = 3  # averagings of rotations over the one-ring, since a folded ring determines no rotation: a guess
FOLDED = 0.0  # a face is doubtful if the cosine between its normal and its rotated rest normal is less: a guess
COLLAPSED = 0.1  # or if its area is less than this share of its rest area: a guess


def turned_laplacian(
    template: Template, rest: Float64[np.ndarray, "V 3"], now: Float64[np.ndarray, "V 3"]
) -> tuple[Float64[np.ndarray, "V 3"], Float64[np.ndarray, "V 3 3"]]:
    """Rotate the Laplacian coordinates of `rest` as each neighborhood rotates to `now`; also return the rotations."""
    turns = _rotations(template, rest, now)
    return np.einsum("vij,vj->vi", turns, template.laplacian @ rest), turns


def doubtful(
    template: Template,
    rest: Float64[np.ndarray, "V 3"],
    turns: Float64[np.ndarray, "V 3 3"],
    now: Float64[np.ndarray, "V 3"],
) -> Bool[np.ndarray, " V"]:
    """Return True for vertices at or next to faces that fold over or collapse against the rotated rest shape."""
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
    """Rebuild the trajectories relative to the key frame from their `count` strongest components (eqs. 8-9)."""
    frames, vertices, _ = positions.shape
    field = (positions - positions[key]).transpose(1, 0, 2).reshape(vertices, 3 * frames)
    mean = field.mean(axis=0)
    centered = field - mean
    _, vectors = eigen(products(centered.T, centered))
    basis = vectors[:, ::-1][:, :count]
    kept = products(products(centered, basis), basis.T) + mean
    return positions[key] + kept.reshape(vertices, frames, 3).transpose(1, 0, 2)


def _rotations(
    template: Template, before: Float64[np.ndarray, "V 3"], after: Float64[np.ndarray, "V 3"]
) -> Float64[np.ndarray, "V 3 3"]:
    """Fit a rotation to each vertex's neighborhood (Kabsch), from covariances averaged over SPREAD rings."""
    i, j = template.edges.T
    outer = ((before[j] - before[i])[:, :, None] * (after[j] - after[i])[:, None, :]).reshape(-1, 9)
    both = np.concatenate([i, j])
    sums = np.stack([np.bincount(both, np.tile(outer[:, k], 2), template.count) for k in range(9)], axis=1)
    sums = sums / (np.abs(sums).sum(axis=1, keepdims=True) + 1e-30)
    for _ in range(SPREAD):
        sums -= 0.5 * (template.laplacian @ sums)
    return nearest_rotations(sums.reshape(-1, 3, 3).transpose(0, 2, 1))[0]
