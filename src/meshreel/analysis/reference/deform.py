"""Deform points from one pose of the centers to another by center affinity (paper, section 3.3.2, eq. 7).

In: points in one pose of the centers. Out: the same points in another pose; the inverse swaps the poses.

Differs from the paper: where bodies touch, a vertex's nearest center (eq. 7) may belong to the other body. So centers
in front of the surface count as farther, and a vertex whose center has little affinity to the centers of its mesh
neighbours takes another of its nearest centers.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float32, Float64, Int64
from scipy.spatial import cKDTree

from ...geometry.rigid import apply, blend, fit_rigid, from_rigid
from ...geometry.strict import exp
from ...geometry.topology import unique_edges, vertex_normals
from ...types import Mesh

FRONT = 4.0  # factor on the distance by which a center lies in front of the surface: a guess
NEIGHBOURS = 8  # centers per neighbourhood (the paper's K_nbr), including the center itself
FALLOFF = 1.0  # a weight falls to 1/e at this many center spacings beyond the point's nearest center (guess)
GUARD_CHOICES = 6  # nearest centers that a vertex may take in place of an unrelated one; 1: the paper's rule (guess)
GUARD_ROUNDS = 2  # passes over the mesh that replace unrelated centers (guess)


@dataclass(frozen=True, slots=True)
class Neighbours:
    """Neighbourhoods of the centers, each sorted by decreasing affinity and beginning with the center itself."""

    indices: Int64[np.ndarray, "K n"]
    affinities: Float64[np.ndarray, "K n"]  # eq. 6
    affinity: Float32[np.ndarray, "K K"]  # eq. 6, of all pairs


@dataclass(frozen=True, slots=True)
class Binding:
    """Centers that move each point, with their weights; valid for any target pose."""

    nearest: Int64[np.ndarray, " V"]  # k1, eq. 7
    weights: Float64[np.ndarray, "V n"]  # of the neighbours of k1; rows sum to 1


def neighbours(affinity: Float32[np.ndarray, "K K"]) -> Neighbours:
    """Return the K_nbr centers with the largest affinity to each center, itself first, then in decreasing order."""
    count = min(NEIGHBOURS, len(affinity))
    distance = 1 - affinity
    np.fill_diagonal(distance, -1)  # a center comes first even if another one is at the same place
    indices = np.argsort(distance, axis=1, kind="stable")[:, :count].astype(np.int64)
    return Neighbours(indices, np.take_along_axis(affinity, indices, axis=1).astype(np.float64), affinity)


def center_motions(
    source: Float64[np.ndarray, "K 3"], target: Float64[np.ndarray, "K 3"], neighbours: Neighbours
) -> Float64[np.ndarray, "K 8"]:
    """Fit each center's rigid motion between two poses to its neighbourhood, weighted by affinity (weighted Kabsch)."""
    rotations, translations = fit_rigid(source[neighbours.indices], target[neighbours.indices], neighbours.affinities)
    return from_rigid(rotations, translations)


def bind(mesh: Mesh, source: Float64[np.ndarray, "K 3"], neighbours: Neighbours) -> Binding:
    """Choose the centers that move each vertex of a mesh in the source pose, with their weights."""
    choices = min(GUARD_CHOICES, len(source))
    reach, near = cKDTree(source).query(mesh.vertices, k=choices)
    reach, near = reach.reshape(-1, choices), near.reshape(-1, choices).astype(np.int64)
    if choices > 1 and not mesh.is_empty:
        near = _behind_first(mesh, near, reach, source)
    nearest = near[:, 0]  # eq. 7
    if choices > 1 and not mesh.is_empty:
        for _ in range(GUARD_ROUNDS):
            nearest = _guard(mesh, near, nearest, neighbours)
    return Binding(nearest, _weights(mesh.vertices, nearest, source, neighbours))


def move(
    points: Float64[np.ndarray, "V 3"],
    binding: Binding,
    motions: Float64[np.ndarray, "K 8"],
    neighbours: Neighbours,
) -> Float64[np.ndarray, "V 3"]:
    """Move bound points by the blend of their centers' motions."""
    return apply(blended(binding, motions, neighbours), points)


def moved_to(
    mesh: Mesh,
    pose: Float64[np.ndarray, "K 3"],
    targets: Float64[np.ndarray, "T K 3"],
    neighbours: Neighbours,
) -> Float64[np.ndarray, "T V 3"]:
    """Move the vertices of a mesh in a pose of the centers to each of some others (eq. 7)."""
    binding = bind(mesh, pose, neighbours)
    motions = (center_motions(pose, target, neighbours) for target in targets)
    return np.stack([move(mesh.vertices, binding, each, neighbours) for each in motions])


def blended(
    binding: Binding, motions: Float64[np.ndarray, "K 8"], neighbours: Neighbours
) -> Float64[np.ndarray, "V 8"]:
    """Blend the motions of each point's centers into one unit dual quaternion per point."""
    rows = neighbours.indices[binding.nearest]
    return blend(motions[rows], binding.weights)


def _behind_first(
    mesh: Mesh,
    near: Int64[np.ndarray, "V n"],
    reach: Float64[np.ndarray, "V n"],
    source: Float64[np.ndarray, "K 3"],
) -> Int64[np.ndarray, "V n"]:
    """Sort each vertex's nearest centers by distance, with centers in front of the surface counted as farther.

    The centers of a body are inside it, so behind its surface.
    """
    offset = source[near] - mesh.vertices[:, None]
    front = np.maximum(np.einsum("vnd,vd->vn", offset, vertex_normals(mesh)), 0)
    order = np.argsort(np.square(reach) + np.square(FRONT * front), axis=1, kind="stable")
    return np.take_along_axis(near, order, axis=1)


def _guard(
    mesh: Mesh, near: Int64[np.ndarray, "V n"], nearest: Int64[np.ndarray, " V"], neighbours: Neighbours
) -> Int64[np.ndarray, " V"]:
    """Replace k1 of a vertex if its affinity to the mesh neighbours' k1 is under half of the largest possible."""
    edges, _ = unique_edges(mesh.faces)
    to, other = np.concatenate([edges, edges[:, ::-1]]).T
    kin = np.zeros(near.shape)
    for choice in range(near.shape[1]):
        values = neighbours.affinity[near[to, choice], nearest[other]].astype(np.float64)
        kin[:, choice] = np.bincount(to, values, len(near))
    affinities = np.bincount(to, neighbours.affinity[nearest[to], nearest[other]].astype(np.float64), len(near))
    best = np.argmax(kin >= 0.8 * kin.max(axis=1, keepdims=True), axis=1)  # the nearest of the good ones
    stranger = affinities < 0.5 * kin.max(axis=1)
    return np.where(stranger, near[np.arange(len(near)), best], nearest)


def _weights(
    points: Float64[np.ndarray, "V 3"],
    nearest: Int64[np.ndarray, " V"],
    source: Float64[np.ndarray, "K 3"],
    neighbours: Neighbours,
) -> Float64[np.ndarray, "V n"]:
    """Return weights that fall off with the distance to the point (in this pose) and with the affinity to k1."""
    rows = neighbours.indices[nearest]
    square = np.sum(np.square(points[:, None] - source[rows]), axis=2)
    square -= square.min(axis=1, keepdims=True)  # keeps weights from vanishing far from all centers
    width = FALLOFF * _spacing(source, neighbours)
    weights = neighbours.affinities[nearest] * exp(-square / max(width**2, np.finfo(float).tiny))
    return weights / weights.sum(axis=1, keepdims=True)


def _spacing(source: Float64[np.ndarray, "K 3"], neighbours: Neighbours) -> float:
    if neighbours.indices.shape[1] < 2:
        return 1.0
    away = np.linalg.norm(source[neighbours.indices[:, 1:]] - source[:, None], axis=2)
    return float(np.median(away.min(axis=1)))
