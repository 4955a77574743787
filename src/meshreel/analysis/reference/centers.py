"""Compute reference centers: one pose for a group in which no bodies touch (paper, section 3.3.1, eqs. 5-6).

In: tracked centers. Out: the largest distances between them over all frames, the pose that keeps these distances best
(SMACOF from a classical start), and the affinity of each pair.

Differs from the paper: distances determine a pose only up to reflection, so a real frame's pose decides the reflection.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float32, Float64

from ...geometry.rigid import fit_rigid
from ...geometry.strict import determinants, eigen, exp, norm, products
from ...types import Centers

LANCZOS = 30  # steps towards three eigenvectors, from which SMACOF starts: a guess
MAX_ROUNDS = 80  # largest number of SMACOF rounds (guess)
TOLERANCE = 2e-4  # stop when a round lowers the stress by less than this share (guess)
REACH = 2.0  # affinity is 1/2 at this many median distances to the nearest center (eq. 6's sigma; guess)
SEED = 0  # seed of the eigenvector iteration's start


@dataclass(frozen=True, slots=True)
class ReferenceCenters:
    """Pose that keeps the largest distances best, with its stress."""

    positions: Float64[np.ndarray, "K 3"]  # aligned to a real frame's pose
    stress: float  # eq. 5; 0 is perfect
    rounds: int  # SMACOF rounds done


def largest_distances(centers: Centers) -> Float32[np.ndarray, "K K"]:
    """Return the largest distance of each pair of centers over all frames (eq. 5's d), in units of the centers.

    Takes the memory of two K x K arrays in float32, whatever the number of frames.
    """
    largest = np.zeros((centers.positions.shape[1],) * 2, np.float32)
    for pose in centers.positions:
        np.maximum(largest, _squared_distances(pose), out=largest)
    np.sqrt(largest, out=largest)
    np.fill_diagonal(largest, 0)
    return largest


def reference_centers(distances: Float32[np.ndarray, "K K"], pose: Float64[np.ndarray, "K 3"]) -> ReferenceCenters:
    """Find the pose of least stress (eq. 5), rotated, shifted and mirrored to agree best with a frame's `pose`."""
    if len(distances) < 4 or not distances.any():  # up to three points, or all in one place
        return ReferenceCenters(pose.copy(), _stress(distances, pose), 0)
    positions, rounds = _smacof(distances, _classical(distances))
    positions = _orient(positions, pose, distances)
    return ReferenceCenters(positions, _stress(distances, positions), rounds)


def affinity(distances: Float32[np.ndarray, "K K"]) -> Float32[np.ndarray, "K K"]:
    """Return the affinity of each pair of centers, 1 for a center with itself (eq. 6).

    Sigma follows from the spacing of the centers, so that it depends neither on the unit nor on the number of bodies.
    """
    sigma = math.sqrt(math.log(2)) / max(REACH * center_spacing(distances), float(np.finfo(np.float32).tiny))
    return exp(-np.square(np.float32(sigma) * distances)).astype(np.float32)  # eq. 6


def center_spacing(distances: Float32[np.ndarray, "K K"]) -> float:
    """Return the median distance from a center to the nearest other one."""
    if len(distances) < 2:
        return 0.0
    return float(np.median(np.partition(distances, 1, axis=1)[:, 1]))


def _classical(distances: Float32[np.ndarray, "K K"]) -> Float64[np.ndarray, "K 3"]:
    """Scale classically (Torgerson): project on the three strongest axes of the doubly centered squared distances."""
    gram = -0.5 * np.square(distances.astype(np.float64))
    gram -= gram.mean(axis=0, keepdims=True)
    gram -= gram.mean(axis=1, keepdims=True)
    start = np.random.default_rng(SEED).standard_normal(len(gram))
    values, vectors = _strongest(gram, start, min(LANCZOS, len(gram)))
    return vectors * np.sqrt(np.maximum(values, 0))


def _strongest(
    matrix: Float64[np.ndarray, "K K"], start: Float64[np.ndarray, " K"], steps: int
) -> tuple[Float64[np.ndarray, " 3"], Float64[np.ndarray, "K 3"]]:
    """Return the three largest eigenvalues of a symmetric matrix and their vectors, by Lanczos steps."""
    basis, inside = np.zeros((steps, len(start))), np.zeros((steps, steps))
    vector = start
    for step in range(steps):
        basis[step] = vector / max(norm(vector), np.finfo(float).tiny)
        image = products(matrix, basis[step][:, None])[:, 0]
        inside[step, : step + 1] = inside[: step + 1, step] = products(basis[: step + 1], image[:, None])[:, 0]
        vector = image
        for _ in range(2):  # twice, because of rounding
            projections = products(basis[: step + 1], vector[:, None])
            vector = vector - products(basis[: step + 1].T, projections)[:, 0]
    values, vectors = eigen(inside)
    return values[-3:], products(basis.T, vectors[:, -3:])


def _smacof(
    distances: Float32[np.ndarray, "K K"], start: Float64[np.ndarray, "K 3"]
) -> tuple[Float64[np.ndarray, "K 3"], int]:
    """Minimise stress by majorisation with doubled steps; return the positions and the number of rounds.

    A doubled step that raises the stress is replaced by the plain one. A round computes one distance matrix, or two.
    Everything is float32, which suffices because positions are near the origin.
    """
    x = (start - start.mean(axis=0)).astype(np.float32)
    guttman, stress = _guttman(distances, x)
    rounds = 0
    while rounds < MAX_ROUNDS:
        rounds += 1
        bold = 2 * guttman - x
        bold_guttman, bold_stress = _guttman(distances, bold)
        if bold_stress > stress:  # the plain step never raises the stress
            bold = guttman
            bold_guttman, bold_stress = _guttman(distances, bold)
        done = bold_stress > stress * (1 - TOLERANCE)
        x, guttman, stress = bold, bold_guttman, bold_stress
        if done:
            break
    return guttman.astype(np.float64), rounds


def _guttman(
    distances: Float32[np.ndarray, "K K"], x: Float32[np.ndarray, "K 3"]
) -> tuple[Float32[np.ndarray, "K 3"], float]:
    """Return the Guttman transform of x and the raw stress of x."""
    current = np.sqrt(_squared_distances(x))
    np.maximum(current, np.float32(1e-12), out=current)
    ratio = distances / current
    current -= distances
    stress = float(np.square(current).sum())
    moved = (ratio.sum(axis=1)[:, None] * x - products(ratio, x).astype(np.float32)) / np.float32(len(x))
    return moved, stress


def _orient(
    positions: Float64[np.ndarray, "K 3"], pose: Float64[np.ndarray, "K 3"], distances: Float32[np.ndarray, "K K"]
) -> Float64[np.ndarray, "K 3"]:
    """Align positions to a real pose, mirrored if most small neighbourhoods are inside out.

    A limb may not be in the frame's place, so a global fit may prefer the mirror image; neighbourhoods do not.
    """
    count = min(12, len(pose))
    near = np.argsort(distances, axis=1, kind="stable")[:, :count]
    a, b = (
        positions[near] - positions[near].mean(axis=1, keepdims=True),
        pose[near] - pose[near].mean(axis=1, keepdims=True),
    )
    votes = np.sign(determinants(products(np.swapaxes(b, 1, 2), a)))
    if votes.sum() < 0:
        positions = positions * np.array([1.0, 1.0, -1.0])
    rotation, translation = fit_rigid(positions[None], pose[None], np.ones((1, len(pose))))
    return products(positions, rotation[0].T) + translation[0]


def _stress(distances: Float32[np.ndarray, "K K"], positions: Float64[np.ndarray, "K 3"]) -> float:
    """Return Kruskal's stress (eq. 5); both of its sums count every pair twice, which cancels."""
    current = np.sqrt(_squared_distances(positions))
    np.fill_diagonal(current, 0)
    size = norm(distances)
    return norm(distances - current) / size if size > 0 else 0.0


def _squared_distances(
    pose: Float64[np.ndarray, "K 3"] | Float32[np.ndarray, "K 3"],
) -> Float32[np.ndarray, "K K"]:
    p = (pose - pose.mean(axis=0)).astype(np.float32)
    square = np.einsum("kd,kd->k", p, p)
    result = sum(p[:, k, None] * (-2 * p[:, k]) for k in range(3))
    result += square
    result += square[:, None]
    return np.maximum(result, 0, out=result)
