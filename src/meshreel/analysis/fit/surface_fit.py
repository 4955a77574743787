"""Fit one template of constant connectivity to the surface of each frame (displacement fields; paper, section 3.3.2).

In: the decoded, subdivided reference deformed to each frame; the frames. Out: its positions on every frame, and their
residuals, in bounding-box diagonals. A shape prior, the key frame's fit rotated with the body, keeps detail and
sliding along the surface constant over time, so that they cost no rate. A second fit is pulled to positions that the
coder represents cheaply: the first fit's strongest components (decision 10), or coherent positions from the caller.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float64, Int32
from scipy.spatial import cKDTree

from ... import _core
from ...geometry import work
from ...geometry.closest_points import Surface
from ...geometry.strict import eigen, products
from ...types import Mesh
from .frame import FrameSurface

FOLLOWED = 6e-4  # RMS noise from which the second fit trusts the coherent positions more than the frames (decision 16)
NOISY_ROUNDS = slice(1, 3)  # of the first fit: motion is smooth under noise, and tighter rounds fit it (decision 16)
GATE = 6.0  # RMS distances of the noise that a pair may be apart at least: three standard deviations (guess)
MANY = 5000  # smallest number of a template's vertices for which strides apply (guess)
Faces = Int32[np.ndarray, "F 3"]
Points = Float64[np.ndarray, "V 3"]  # positions of the template in one frame
Positions = Float64[np.ndarray, "T V 3"]  # in every frame
AGREEMENT = 0.3  # smallest cosine between the normals of a pair (guess)
ANCHOR = 0.02  # row weight of the offset from the prediction (guess)


@dataclass(frozen=True, slots=True)
class FitOptions:
    """Options of the fit of a template to frames; one entry per round in `gates` and `smoothing`; values are guesses.

    The last entry of `smoothing` trades rate for accuracy: a smaller one follows finer detail and costs more.
    """

    gates: tuple[float, ...] = (0.024, 0.018, 0.012, 0.012)  # largest distances of pairs, in diagonals
    smoothing: tuple[float, ...] = (4.0, 2.0, 0.7, 0.4)  # row weights of the difference from the rotated Laplacian
    strides: tuple[int, ...] | None = None  # one of this many points is matched, per round of a clean fit; None: all
    components: int = 15  # of the trajectories, in the second fit (decision 10); 0: no second fit
    pull: float = 0.1  # row weight of the offset from the coherent positions in the second fit
    restart: bool = True  # the second fit starts from the coherent positions, and the key keeps its first fit
    second_smoothing: float | None = None  # row weight of the coherent shape; None: the last of `smoothing`
    iterations: int = 40  # largest number of conjugate-gradient iterations per round
    tolerance: float = 1e-3  # relative residual at which they stop; larger before the last round

    def rounds(self, noise: float) -> tuple[Rounds, Rounds]:
        """Return the rounds of both fits to frames at this RMS distance from the truth: noise makes them stiffer."""
        gates, smoothing, strides, stiffer = self.gates, self.smoothing, self.strides or (1,) * len(self.gates), 1.0
        last = smoothing[-1] if self.second_smoothing is None else self.second_smoothing
        if noise > 0:
            chosen = NOISY_ROUNDS if len(gates) >= NOISY_ROUNDS.stop else slice(None)
            gates, smoothing = tuple(max(gate, GATE * noise) for gate in gates[chosen]), smoothing[chosen]
            strides, stiffer = (1,) * len(gates), math.hypot(1.0, noise / FOLLOWED)
        again = (stiffer * last,) * len(gates[-2:])
        return (
            Rounds(gates, smoothing, strides, ANCHOR, turn=True),
            Rounds(gates[-2:], again, strides[-2:], stiffer * self.pull, turn=False),
        )


@dataclass(frozen=True, slots=True)
class Rounds:
    """Rounds of the fit of one frame, as in FitOptions."""

    gates: tuple[float, ...]
    smoothing: tuple[float, ...]
    strides: tuple[int, ...]
    anchor: float  # row weight of the offset from the prediction
    turn: bool  # True: the shape turns with each vertex's neighbourhood


@dataclass(frozen=True, slots=True)
class Fit:
    """Positions of a template on every frame, with their residuals."""

    positions: Positions
    residuals: Float64[np.ndarray, " T"]  # symmetric RMS distance


def fit_frames(
    faces: Faces, predictions: Positions, frames: Sequence[Mesh], options: FitOptions, key: int | None = None
) -> Fit:
    """Fit a template to each frame, starting from its predicted positions; `key` is as in `fit_surfaces`.

    Each frame has a surface; where none is nearby, the template follows its prediction smoothly.
    """
    surfaces = [FrameSurface(mesh) for mesh in frames]
    positions = fit_surfaces(faces, predictions, surfaces, options, key)
    pairs = zip(positions, surfaces, strict=True)
    return Fit(positions, np.array([_residual(Mesh.of(fitted, faces), surface) for fitted, surface in pairs]))


def snap_to_vertices(faces: Faces, predictions: Positions, frames: Sequence[Mesh]) -> Fit:
    """Move each predicted vertex to the nearest vertex of its frame, as the paper's released code does.

    Neighbours may fall on one vertex. Each frame has a surface.
    """
    positions, residuals = predictions.copy(), np.zeros(len(frames))
    for number, frame in enumerate(frames):
        used = frame.vertices[np.unique(frame.faces)]
        positions[number] = used[cKDTree(used).query(predictions[number])[1]]
        residuals[number] = _residual(Mesh(positions[number], faces), FrameSurface(frame))
    return Fit(positions, residuals)


def _residual(fitted: Mesh, frame: FrameSurface) -> float:
    """Return the RMS distance of vertices from the other surface, the larger of both directions."""
    to_fit, to_frame = Surface(fitted).distances(frame.mesh.vertices), frame.surface.distances(fitted.vertices)
    return float(np.sqrt(max(np.mean(to_fit**2), np.mean(to_frame**2))))


def fit_surfaces(
    faces: Faces, predictions: Positions, surfaces: Sequence[FrameSurface], options: FitOptions, key: int | None
) -> Positions:
    """Fit a template to prepared frames, first to the frame `key`, by default the middle one."""
    positions, fitting = predictions.copy(), Fitting(faces, predictions.shape[1], options)
    key = len(surfaces) // 2 if key is None else key
    for number in [key] + [t for t in range(len(surfaces)) if t != key]:
        rest = (predictions if number == key else positions)[key]  # until the key is fitted, its prediction
        positions[number] = fitting.first(surfaces[number], rest, predictions[number])
    if options.components and len(surfaces) > 1:
        coherent = strongest_components(positions, key, options.components)
        for number, surface in enumerate(surfaces):
            if not (number == key and options.restart):
                positions[number] = fitting.second(surface, coherent[number], positions[number])
    return positions


def strongest_components(positions: Positions, key: int, count: int) -> Positions:
    """Rebuild the trajectories relative to the key frame from their `count` strongest components (eqs. 8-9)."""
    frames, vertices, _ = positions.shape
    field = (positions - positions[key]).transpose(1, 0, 2).reshape(vertices, 3 * frames)
    mean = field.mean(axis=0)
    centered = field - mean
    _, vectors = eigen(products(centered.T, centered))
    basis = vectors[:, ::-1][:, :count]
    rebuilt = products(products(centered, basis), basis.T) + mean
    return positions[key] + rebuilt.reshape(vertices, frames, 3).transpose(1, 0, 2)


class Fitting:
    """A template of V vertices prepared for fits to frames, one frame at a time."""

    def __init__(self, faces: Faces, vertices: int, options: FitOptions, noise: float = 0.0) -> None:
        """`noise` is the RMS distance of the frames from the truth; 0: a clean capture."""
        self._template, self._options = _core.FitTemplate(faces, vertices), options
        chosen = options if vertices >= MANY else replace(options, strides=None)  # few: match all
        self._first, self._second = chosen.rounds(noise)

    def first(self, surface: FrameSurface, rest: Points, prediction: Points) -> Points:
        """Fit a frame from its prediction, keeping the shape `rest` where the frame has no surface nearby."""
        work.count("frames fitted")
        return self._fitted(surface, rest, prediction, prediction, self._first)

    def second(self, surface: FrameSurface, coherent: Points, first: Points) -> Points:
        """Fit a frame again, near coherent positions made from the first fit."""
        work.count("frames fitted again")
        return self._fitted(surface, coherent, coherent, coherent if self._options.restart else first, self._second)

    def _fitted(self, surface: FrameSurface, rest: Points, place: Points, start: Points, rounds: Rounds) -> Points:
        """Fit a frame in the core."""
        gates, smoothing = np.array(rounds.gates), np.array(rounds.smoothing)
        strides, options = np.array(rounds.strides, np.int32), self._options
        limits = (AGREEMENT, rounds.anchor, options.tolerance, options.iterations, rounds.turn)
        return self._template.fit(surface.target, rest, place, start, gates, smoothing, strides, *limits)
