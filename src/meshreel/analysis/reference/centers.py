"""Reference centers, one pose for a group in which no bodies touch (paper, section 3.3.1), and deformation by centers.

In: tracked centers. Out: the largest distances between them over all frames, the pose that keeps these best (eq. 5:
SMACOF from a classical start), the affinity of each pair (eq. 6); points in another pose (section 3.3.2, eq. 7).

Differs from the paper: distances determine a pose only up to reflection, so a real frame's pose decides. Where bodies
touch, a vertex's nearest center may belong to the other body: centers in front of the surface count as farther, and a
vertex whose center has little affinity to those of its mesh neighbours takes another of its nearest centers.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float32, Float64, Int64
from scipy.spatial import cKDTree

from ...geometry.rigid import apply, blend, fit_rigid, from_rigid
from ...geometry.strict import determinants, eigen, exp, norm, products
from ...geometry.topology import unique_edges, vertex_normals
from ...types import Centers, Mesh

Pose = Float64[np.ndarray, "K 3"]  # positions of the centers
Pairs = Float32[np.ndarray, "K K"]  # a value for each pair of centers
LANCZOS = 30  # steps towards three eigenvectors, from which SMACOF starts: a guess
MAX_ROUNDS = 80  # largest number of SMACOF rounds (guess)
TOLERANCE = 2e-4  # stop when a round lowers the stress by less than this share (guess)
REACH = 2.0  # affinity is 1/2 at this many median distances to the nearest center (eq. 6's sigma; guess)
SEED = 0  # seed of the eigenvector iteration's start
Points = Float64[np.ndarray, "V 3"]
FRONT = 4.0  # factor on the distance by which a center lies in front of the surface: a guess
HOOD = 8  # centers per neighbourhood (the paper's K_nbr), including the center itself
FALLOFF = 1.0  # a weight falls to 1/e at this many center spacings beyond the point's nearest center (guess)
GUARD_CHOICES = 6  # nearest centers that a vertex may take in place of an unrelated one; 1: the paper's rule (guess)
GUARD_ROUNDS = 2  # passes over the mesh that replace unrelated centers (guess)


def largest_distances(centers: Centers) -> Pairs:
    """Return the largest distance of each pair of centers over all frames (eq. 5's d), in units of the centers.

    Takes the memory of two K x K arrays in float32, whatever the number of frames.
    """
    largest = np.zeros((centers.positions.shape[1],) * 2, np.float32)
    for pose in centers.positions:
        np.maximum(largest, _squared_distances(pose), out=largest)
    np.sqrt(largest, out=largest)
    np.fill_diagonal(largest, 0)
    return largest


def reference_centers(distances: Pairs, pose: Pose) -> Pose:
    """Find the pose of least stress (eq. 5), rotated, shifted and mirrored to agree best with a frame's `pose`."""
    if len(distances) < 4 or not distances.any():  # up to three points, or all in one place
        return pose.copy()
    positions = _smacof(distances, _classical(distances))
    # Mirrored if most small neighbourhoods are inside out: a limb may not be in the frame's place, so a global fit may
    # prefer the mirror image.
    near = np.argsort(distances, axis=1, kind="stable")[:, : min(12, len(pose))]
    a, b = (each[near] - each[near].mean(axis=1, keepdims=True) for each in (positions, pose))
    votes = np.sign(determinants(products(np.swapaxes(b, 1, 2), a)))
    if votes.sum() < 0:
        positions = positions * np.array([1.0, 1.0, -1.0])
    rotation, translation = fit_rigid(positions[None], pose[None], np.ones((1, len(pose))))
    return products(positions, rotation[0].T) + translation[0]


def affinity(distances: Pairs) -> Pairs:
    """Return the affinity of each pair of centers, 1 for a center with itself (eq. 6).

    Sigma follows from the spacing of the centers, so that it depends neither on the unit nor on the number of bodies.
    """
    sigma = math.sqrt(math.log(2)) / max(REACH * center_spacing(distances), float(np.finfo(np.float32).tiny))
    return exp(-np.square(np.float32(sigma) * distances)).astype(np.float32)  # eq. 6


def center_spacing(distances: Pairs) -> float:
    """Return the median distance from a center to the nearest other one."""
    if len(distances) < 2:
        return 0.0
    return float(np.median(np.partition(distances, 1, axis=1)[:, 1]))


def _classical(distances: Pairs) -> Pose:
    """Scale classically (Torgerson): project on the three strongest axes of the doubly centered squared distances."""
    gram = -0.5 * np.square(distances.astype(np.float64))
    gram -= gram.mean(axis=0, keepdims=True)
    gram -= gram.mean(axis=1, keepdims=True)
    steps = min(LANCZOS, len(gram))  # towards the three largest eigenvalues
    basis, inside = np.zeros((steps, len(gram))), np.zeros((steps, steps))
    vector = np.random.default_rng(SEED).standard_normal(len(gram))
    for step in range(steps):
        basis[step] = vector / max(norm(vector), np.finfo(float).tiny)
        image = products(gram, basis[step][:, None])[:, 0]
        inside[step, : step + 1] = inside[: step + 1, step] = products(basis[: step + 1], image[:, None])[:, 0]
        vector = image
        for _ in range(2):  # twice, because of rounding
            projections = products(basis[: step + 1], vector[:, None])
            vector = vector - products(basis[: step + 1].T, projections)[:, 0]
    values, vectors = eigen(inside)
    return products(basis.T, vectors[:, -3:]) * np.sqrt(np.maximum(values[-3:], 0))


def _smacof(distances: Pairs, start: Pose) -> Pose:
    """Minimise stress by majorisation with doubled steps.

    A doubled step that raises the stress is replaced by the plain one. A round computes one distance matrix, or two.
    Everything is float32, which suffices because positions are near the origin.
    """
    x = (start - start.mean(axis=0)).astype(np.float32)
    guttman, stress = _guttman(distances, x)
    for _ in range(MAX_ROUNDS):
        bold = 2 * guttman - x
        bold_guttman, bold_stress = _guttman(distances, bold)
        if bold_stress > stress:  # the plain step never raises the stress
            bold = guttman
            bold_guttman, bold_stress = _guttman(distances, bold)
        done = bold_stress > stress * (1 - TOLERANCE)
        x, guttman, stress = bold, bold_guttman, bold_stress
        if done:
            break
    return guttman.astype(np.float64)


def _guttman(distances: Pairs, x: Float32[np.ndarray, "K 3"]) -> tuple[Float32[np.ndarray, "K 3"], float]:
    """Return the Guttman transform of x and the raw stress of x."""
    current = np.sqrt(_squared_distances(x))
    np.maximum(current, np.float32(1e-12), out=current)
    ratio = distances / current
    current -= distances
    stress = float(np.square(current).sum())
    moved = (ratio.sum(axis=1)[:, None] * x - products(ratio, x).astype(np.float32)) / np.float32(len(x))
    return moved, stress


def _squared_distances(pose: Pose | Float32[np.ndarray, "K 3"]) -> Pairs:
    p = (pose - pose.mean(axis=0)).astype(np.float32)
    square = np.einsum("kd,kd->k", p, p)
    result = sum(p[:, k, None] * (-2 * p[:, k]) for k in range(3))
    result += square
    result += square[:, None]
    return np.maximum(result, 0, out=result)


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
    count = min(HOOD, len(affinity))
    distance = 1 - affinity
    np.fill_diagonal(distance, -1)  # a center comes first even if another one is at the same place
    indices = np.argsort(distance, axis=1, kind="stable")[:, :count].astype(np.int64)
    return Neighbours(indices, np.take_along_axis(affinity, indices, axis=1).astype(np.float64), affinity)


def center_motions(source: Pose, target: Pose, neighbours: Neighbours) -> Float64[np.ndarray, "K 8"]:
    """Fit each center's rigid motion between two poses to its neighbourhood, weighted by affinity (weighted Kabsch)."""
    near = neighbours.indices
    return from_rigid(*fit_rigid(source[near], target[near], neighbours.affinities))


def bind(mesh: Mesh, source: Pose, neighbours: Neighbours) -> Binding:
    """Choose the centers that move each vertex of a mesh in the source pose, with their weights."""
    choices = min(GUARD_CHOICES, len(source))
    reach, near = cKDTree(source).query(mesh.vertices, k=choices)
    reach, near = reach.reshape(-1, choices), near.reshape(-1, choices).astype(np.int64)
    offset = source[near] - mesh.vertices[:, None]
    front = np.maximum(np.einsum("vnd,vd->vn", offset, vertex_normals(mesh)), 0)  # outside a body, centers are farther
    order = np.argsort(np.square(reach) + np.square(FRONT * front), axis=1, kind="stable")
    near = np.take_along_axis(near, order, axis=1)
    nearest = near[:, 0]  # eq. 7
    for _ in range(GUARD_ROUNDS):
        nearest = _guard(mesh, near, nearest, neighbours)
    rows, spacing = neighbours.indices[nearest], 1.0
    square = np.sum(np.square(mesh.vertices[:, None] - source[rows]), axis=2)
    square -= square.min(axis=1, keepdims=True)  # keeps weights from vanishing far from all centers
    if neighbours.indices.shape[1] > 1:
        away = np.linalg.norm(source[neighbours.indices[:, 1:]] - source[:, None], axis=2)
        spacing = float(np.median(away.min(axis=1)))
    falloff = exp(-square / max((FALLOFF * spacing) ** 2, np.finfo(float).tiny))
    weights = neighbours.affinities[nearest] * falloff  # with the distance in this pose, and the affinity to k1
    return Binding(nearest, weights / weights.sum(axis=1, keepdims=True))


def move(points: Points, binding: Binding, motions: Float64[np.ndarray, "K 8"], neighbours: Neighbours) -> Points:
    """Move bound points by the blend of their centers' motions, one unit dual quaternion per point."""
    return apply(blend(motions[neighbours.indices[binding.nearest]], binding.weights), points)


def moved_to(
    mesh: Mesh, pose: Pose, targets: Float64[np.ndarray, "T K 3"], neighbours: Neighbours
) -> Float64[np.ndarray, "T V 3"]:
    """Move the vertices of a mesh in a pose of the centers to each of some others (eq. 7)."""
    binding = bind(mesh, pose, neighbours)
    motions = (center_motions(pose, target, neighbours) for target in targets)
    return np.stack([move(mesh.vertices, binding, each, neighbours) for each in motions])


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
