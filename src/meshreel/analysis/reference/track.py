"""Track the volume of bodies by centers, through frames of any connectivity (paper, section 3.1).

In: frames. Out: center trajectories. Frame 0: Lloyd's relaxation. Later frames: extrapolation, then descent on an
energy of even spread and rigidity. Neighbours were never far from each other and never moved differently.

Differs from its sources: one energy has both terms, so that convergence can be measured and steps accelerated.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int32, Int64
from scipy.spatial import cKDTree

from ... import _core
from ...errors import InputError
from ...geometry import work
from ...geometry.inside import Samples, interior_samples
from ...geometry.strict import exp
from ...types import Centers, Mesh
from .centers import Pose

Points = Float64[np.ndarray, "N 3"]  # samples of the volume
Owners = Int32[np.ndarray, " N"]  # the center that owns each sample
Matrices = Float64[np.ndarray, "K 3 3"]  # of each center
LEAST_AFFINITY = 1e-3  # weaker neighbours are dropped: a guess
FEWEST_NEIGHBOURS = 4  # always kept, since fewer do not determine a rotation
FEWEST_CENTERS = 4  # of a body, for the same reason
REACH = 0.058  # diagonals: distance that halves an affinity (guess)
AGREEMENT = 0.003  # diagonals: difference of motion (RMS, per frame) that halves an affinity (guess)
NEIGHBOURS = 16  # largest number of neighbours of a center (guess)
SPREAD = 1.0  # weight of the even spread (Lloyd) (guess)
RIGIDITY = 3.0  # weight of the rigid term (guess)
TOLERANCE = 1e-5  # stop when a round can lower the energy by no more than this share (guess)
ROUNDS = 300  # largest number of rounds per frame (guess)
SEED = 0  # of the samples of the volume


@dataclass(frozen=True, slots=True)
class TrackOptions:
    """Options of volume tracking; lengths in units of the sequence's bounding-box diagonal; both are guesses."""

    centers: int = 2000  # K, over all bodies
    samples: int = 45_000  # points that represent the volume of a frame

    def __post_init__(self) -> None:
        if self.centers < 1:
            raise InputError(f"centers is {self.centers}; give at least 1")


def track_centers(frames: Sequence[Mesh], options: TrackOptions) -> Centers:
    """Track about `options.centers` volume centers through normalised frames, none of which may be empty.

    Bodies are the connected components of the first frame, without specks; each gets centers in proportion to its
    volume, at least four, at most one per sample.
    """
    samples = _samples(frames, 0, options)
    first, bodies, owners = _spread_over_bodies(samples, options)
    graph = _Affinities(first, bodies)
    track = [first]
    for t in range(1, len(frames)):
        work.count("frames tracked")
        following = _samples(frames, t, options)
        now, rotations, next_owners = _follow(track, following, graph)
        graph.learn(track[-1], now, rotations, samples.points, owners)
        track.append(now)
        samples, owners = following, next_owners
    return Centers(np.stack(track), bodies)


def _samples(frames: Sequence[Mesh], t: int, options: TrackOptions) -> Samples:
    return interior_samples(frames[t], options.samples, np.random.default_rng((SEED, t)))


def _spread_over_bodies(samples: Samples, options: TrackOptions) -> tuple[Pose, Int32[np.ndarray, " K"], Owners]:
    """Return the centers of the first frame, the body of each center, and the center that owns each sample."""
    generator = np.random.default_rng((SEED, 0, 1))
    owners = np.zeros(len(samples.points), np.int32)
    places: list[Pose] = []
    sizes = np.bincount(samples.bodies)
    counts = np.maximum(np.floor(options.centers * sizes / sizes.sum()).astype(np.int64), FEWEST_CENTERS)
    counts[0] = max(counts[0] + options.centers - counts.sum(), FEWEST_CENTERS)  # the largest takes the remainder
    counts = np.minimum(counts, sizes)
    for body, count in enumerate(counts):
        mine = np.flatnonzero(samples.bodies == body)
        points = np.ascontiguousarray(samples.points[mine])
        centers = points[np.sort(generator.choice(len(points), count, replace=False))]
        owned = np.zeros(len(points), np.int32)
        _core.spread_centers(points, centers, owned, TOLERANCE, ROUNDS)
        owners[mine] = owned + sum(len(c) for c in places)
        places.append(centers)
    return np.concatenate(places), np.repeat(np.arange(len(counts)), counts).astype(np.int32), owners


def _follow(track: list[Pose], samples: Samples, graph: _Affinities) -> tuple[Pose, Matrices, Owners]:
    """Return the centers in the next frame, the rotation of each on the way there, and the owner of each sample."""
    centers = 2 * track[-1] - track[-2] if len(track) > 1 else track[-1].copy()
    rotations = np.zeros((len(centers), 9))
    owners = np.zeros(len(samples.points), np.int32)
    offsets, indices, weights = graph.lists()
    _core.follow_centers(
        samples.points, track[-1], offsets, indices, weights, centers, rotations, owners,
        SPREAD, RIGIDITY, TOLERANCE, ROUNDS
    )  # fmt: skip
    return centers, rotations.reshape(-1, 3, 3), owners


class _Affinities:
    """Affinities of pairs of centers that are near in the first frame; distance and different motion weaken them."""

    def __init__(self, centers: Pose, bodies: Int32[np.ndarray, " K"]) -> None:
        rows, columns = [np.zeros(0, np.int64)], [np.zeros(0, np.int64)]
        for body in range(int(bodies.max()) + 1):
            mine = np.flatnonzero(bodies == body)
            nearest = min(2 * NEIGHBOURS + 1, len(mine))
            _, neighbours = cKDTree(centers[mine]).query(centers[mine], k=np.arange(1, nearest + 1))
            rows.append(np.repeat(mine, nearest))
            columns.append(mine[neighbours].reshape(-1))
        i, j = np.concatenate(rows), np.concatenate(columns)
        self._i, self._j = i[i != j], j[i != j].astype(np.int32)
        self._offsets = _offsets(self._i, len(centers))
        offsets = centers[self._i] - centers[self._j]
        self._distance = np.einsum("ij,ij->i", offsets, offsets)  # largest so far, squared
        self._difference = np.zeros(len(self._i))  # of motion, largest so far, squared

    def learn(self, before: Pose, now: Pose, rotations: Matrices, points: Points, owners: Owners) -> None:
        """Weaken affinities by one step: by the distances after it, and by how differently two centers' motions move
        the samples that one of them owned before it.
        """
        means, covariances = _moments(points, owners, before)
        shifts = now - np.einsum("kij,kj->ki", rotations, before)
        difference = np.empty(len(self._i))
        _core.motion_differences(
            self._offsets, self._j, rotations.reshape(-1, 9), shifts, means, covariances.reshape(-1, 9), difference
        )
        self._difference = np.maximum(self._difference, difference)
        offsets = now[self._i] - now[self._j]
        self._distance = np.maximum(self._distance, np.einsum("ij,ij->i", offsets, offsets))

    def lists(self) -> tuple[Int32[np.ndarray, " K1"], Int32[np.ndarray, " P"], Float64[np.ndarray, " P"]]:
        """Return neighbour lists (offsets, indices, affinities) with the strongest neighbours of each center."""
        halvings = self._distance / REACH**2 + self._difference / AGREEMENT**2
        affinity = np.maximum(exp(-math.log(2) * halvings), 1e-6)
        order = np.lexsort((halvings, self._i))
        rank = np.empty(len(order), np.int64)
        rank[order] = np.arange(len(order)) - self._offsets[self._i[order]]
        listed = (rank < FEWEST_NEIGHBOURS) | ((rank < NEIGHBOURS) & (affinity >= LEAST_AFFINITY))
        return _offsets(self._i[listed], len(self._offsets) - 1), self._j[listed], affinity[listed]


def _offsets(rows: Int64[np.ndarray, " P"], count: int) -> Int32[np.ndarray, " K1"]:
    return np.concatenate([[0], np.cumsum(np.bincount(rows, minlength=count))]).astype(np.int32)


def _moments(points: Points, owners: Owners, centers: Pose) -> tuple[Pose, Matrices]:
    """Return mean and covariance of the samples that each center owns; of the center itself if it owns none."""
    count = len(centers)
    size = np.maximum(np.bincount(owners, minlength=count), 1)
    local = points - centers[owners]
    mean = np.stack([np.bincount(owners, local[:, a], count) for a in range(3)], axis=1) / size[:, None]
    second = np.empty((count, 3, 3))
    for a in range(3):
        for b in range(a, 3):
            second[:, a, b] = second[:, b, a] = np.bincount(owners, local[:, a] * local[:, b], count) / size
    return centers + mean, second - mean[:, :, None] * mean[:, None, :]
