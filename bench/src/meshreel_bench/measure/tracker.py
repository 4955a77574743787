"""Accuracy of volume tracking (paper, section 3.1) where the motion is known: frames that keep their connectivity.

*published*: the forward pass of Dvorak et al. (2022) as they describe it, from our first frame's centers and with the
same samples of the volume.
"""

from __future__ import annotations

import time
from collections.abc import Sequence

import numpy as np
from jaxtyping import Float64
from scipy.spatial import cKDTree
from scipy.spatial.distance import cdist

from meshreel.analysis.reference import track as ours
from meshreel.analysis.survey import survey_sequence
from meshreel.errors import InputError
from meshreel.geometry.inside import interior_samples
from meshreel.geometry.rigid import fit_rigid
from meshreel.geometry.topology import vertex_normals
from meshreel.types import Mesh, MeshSequence

from ..names import OURS, PUBLISHED

BOUND = (24, 8)  # vertices that take a center along, and fewer, to see how sure that is: guesses
STILL = 5e-5  # of the diagonal: moves below it end the rounds; 0.1 mm on a person, a guess
Track = Float64[np.ndarray, "T K 3"]


def tracker_values(sequence: MeshSequence, method: str) -> dict[str, float | None]:
    """Return distances of centers from the true motion, and CPU s a frame. InputError where faces change."""
    if method not in (OURS, PUBLISHED):
        raise InputError(f"no tracker is called {method!r}; give {OURS} or {PUBLISHED}")
    survey, options = survey_sequence(sequence), ours.TrackOptions()
    frames = [Mesh.of((mesh.vertices - survey.low) / survey.diagonal, mesh.faces) for mesh in sequence]
    if any(not np.array_equal(frame.faces, frames[0].faces) for frame in frames):
        raise InputError("true motion is known of frames that share their faces only")
    first, start = ours.track_centers(frames[:1], options).positions[0], time.process_time()
    track = ours.track_centers(frames, options).positions if method == OURS else published_track(frames, first, options)
    seconds = time.process_time() - start
    truth, other = (carried(frames, track[0], count) for count in BOUND)
    errors, spread = (np.linalg.norm(a - truth, axis=2)[1:] * survey.diagonal * 1000 for a in (track, other))
    rms = lambda values: float(np.sqrt(np.mean(values**2)))  # noqa: E731
    return {
        "center_rms_mm": rms(errors),
        "center_rms_last_mm": rms(errors[-1]),
        "center_95_mm": float(np.percentile(errors, 95)),
        "truth_rms_mm": rms(spread),  # how differently two ways to carry centers along move them
        "track_s": seconds / len(frames),
    }


def carried(frames: Sequence[Mesh], centers: Float64[np.ndarray, "K 3"], count: int) -> Track:
    """Return points of the first frame's volume moved with the surface, each as rigidly as the vertices around it.

    These are the nearest that face away from it, so that those of a hand do not move the hip that it touches.
    """
    first, track = frames[0], [centers]
    normals = vertex_normals(first)
    ways, found = cKDTree(first.vertices).query(centers, min(8 * count, len(first.vertices)))
    away = np.einsum("kjd,kjd->kj", normals[found], first.vertices[found] - centers[:, None]) > 0
    order = np.argsort(~away, axis=1, kind="stable")[:, :count]
    near, ways = (np.take_along_axis(each, order, axis=1) for each in (found, ways))
    before, weights = first.vertices[near], 1 / np.maximum(ways, 1e-9) ** 2
    for frame in frames[1:]:
        turns, shifts = fit_rigid(before, frame.vertices[near], weights)
        track.append(np.einsum("kab,kb->ka", turns, centers) + shifts)
    return np.stack(track)


def published_track(frames: Sequence[Mesh], first: Float64[np.ndarray, "K 3"], options: ours.TrackOptions) -> Track:
    """Return centers that balance an even spread and rigidity, round by round, by affinities of all pairs so far."""
    draw = lambda t: interior_samples(frames[t], options.samples, np.random.default_rng((ours.SEED, t))).points  # noqa: E731
    track, points = [first], draw(0)
    distance, difference = cdist(first, first, "sqeuclidean"), np.zeros((len(first), len(first)))
    for t in range(1, len(frames)):
        before, following = track[-1], draw(t)
        affinity = np.exp2(-distance / ours.REACH**2 - difference / ours.AGREEMENT**2)
        affinity[affinity < ours.LEAST_AFFINITY] = 0
        np.fill_diagonal(affinity, 0)
        now = 2 * before - track[-2] if len(track) > 1 else before.copy()
        for _ in range(ours.ROUNDS):
            owners = cKDTree(now).query(following)[1]
            counts = np.bincount(owners, minlength=len(now))
            sums = np.stack([np.bincount(owners, following[:, a], len(now)) for a in range(3)], axis=1)
            even = sums / np.maximum(counts, 1)[:, None]  # the mean of the points that are nearest to each center
            turns, shifts = _rigid(affinity, before, now)
            rigid = np.einsum("kab,kb->ka", turns, before) + shifts
            moved = np.where(counts[:, None] > 0, (even + rigid) / 2, rigid)
            now, largest = moved, np.abs(moved - now).max()
            if largest < STILL:
                break
        distance = np.maximum(distance, cdist(now, now, "sqeuclidean"))
        difference = np.maximum(difference, _differences(points, before, *_rigid(affinity, before, now)))
        track.append(now)
        points = following
    return np.stack(track)


def _rigid(affinity: np.ndarray, before: np.ndarray, now: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the rotation and the shift that fit the neighbours of each center best."""
    weights = affinity / np.maximum(affinity.sum(axis=1, keepdims=True), 1e-300)
    p, q = weights @ before, weights @ now
    products = weights @ (before[:, :, None] * now[:, None]).reshape(-1, 9)
    u, _, vt = np.linalg.svd(products.reshape(-1, 3, 3) - p[:, :, None] * q[:, None])
    u[:, :, 2] *= np.sign(np.linalg.det(u) * np.linalg.det(vt))[:, None]
    turns = np.swapaxes(u @ vt, 1, 2)  # Kabsch
    return turns, q - np.einsum("kab,kb->ka", turns, p)


def _differences(points: np.ndarray, centers: np.ndarray, turns: np.ndarray, shifts: np.ndarray) -> np.ndarray:
    """Return the mean squared difference between the motions of i and j on the points that i owns, for all pairs."""
    owners, count = cKDTree(centers).query(points)[1], len(centers)
    extended = np.column_stack([points, np.ones(len(points))])
    each = (extended[:, :, None] * extended[:, None]).reshape(-1, 16)
    sums = np.stack([np.bincount(owners, column, count) for column in each.T], axis=1).reshape(-1, 4, 4)
    moments = sums / np.maximum(sums[:, 3:, 3:], 1)
    motions = np.concatenate([turns, shifts[:, :, None]], axis=2)  # K x 3 x 4
    moved = motions @ moments
    own = np.einsum("kab,kab->k", moved, motions)[:, None]
    others = moments.reshape(count, 16) @ (np.swapaxes(motions, 1, 2) @ motions).reshape(count, 16).T
    return np.maximum(own + others - 2 * moved.reshape(count, 12) @ motions.reshape(count, 12).T, 0)
