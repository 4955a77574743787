"""Displacement fields: one template of constant topology laid onto the surface of each frame (paper, section 3.3.2).

In: the decoded, subdivided reference deformed to each frame; the frames. Out: its positions on every frame, and how well they fit.
Coordinates are normalised: the sequence's bounding-box diagonal is 1.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int32
from scipy import sparse

from ..errors import InputError
from ..types import Mesh
from .fit_match import MatchOptions, Target, match
from .fit_residual import NOTHING, Residual, measure
from .fit_system import Template, solve


@dataclass(frozen=True, slots=True)
class FitOptions:
    """How a template is laid onto the frames; one entry per round in `gates` and `smoothing`."""

    gates: tuple[float, ...] = (
        0.024,
        0.018,
        0.012,
        0.012,
    )  # pairs farther apart do not count; fraction of the diagonal
    smoothing: tuple[float, ...] = (2.0, 1.0, 0.7, 0.5)  # row weight of the Laplacian of the offset from the prediction
    agreement: float = 0.3  # least cosine between the normals of a pair
    normal_weight: float = 0.0  # row weight of template edges lying in the frame's tangent plane
    anchor: float = 0.02  # row weight of the offset itself
    carry: float = 1.0  # how much of the inner neighbor's offset a frame starts from
    key: int | None = None  # the frame to begin with; the middle one if None
    iterations: int = 40  # of the conjugate gradients, at most, a round
    tolerance: float = 1e-3  # their relative residual

    def __post_init__(self) -> None:
        if len(self.gates) != len(self.smoothing) or not self.gates or min(self.gates) <= 0 or min(self.smoothing) <= 0:
            raise InputError(
                f"gates {self.gates} and smoothing {self.smoothing}: give each round one positive value of both"
            )
        if not -1 <= self.agreement < 1:
            raise InputError(f"agreement {self.agreement} is a cosine: give at least -1 and less than 1")
        if self.normal_weight < 0 or self.anchor <= 0 or not 0 <= self.carry <= 1:
            raise InputError(
                f"weights normal {self.normal_weight}, anchor {self.anchor}, carry {self.carry}: "
                "give >= 0, > 0 and 0 to 1"
            )
        if self.iterations < 1 or not 0 <= self.tolerance < 1:
            raise InputError(
                f"{self.iterations} iterations to {self.tolerance}: give at least 1, and a tolerance in [0, 1)"
            )


@dataclass(frozen=True, slots=True)
class Fit:
    """The template on every frame."""

    positions: Float64[np.ndarray, "T V 3"]
    residuals: tuple[Residual, ...]


def fit_frames(
    faces: Int32[np.ndarray, "F 3"],
    predictions: Float64[np.ndarray, "T V 3"],
    frames: Sequence[Mesh],
    options: FitOptions,
) -> Fit:
    """The template's positions on each frame's surface, from the key frame outwards, and what is left over.

    Where a frame has no surface near, the template follows its prediction smoothly; an empty frame gets the prediction and
    an infinite residual.
    """
    if len(predictions) != len(frames):
        raise InputError(f"{len(predictions)} predictions for {len(frames)} frames: give one for each")
    template = Template(faces, predictions.shape[1])
    positions = predictions.copy()
    residuals = [NOTHING] * len(frames)
    for at, inner in _outward(len(frames), options.key):
        if len(faces) == 0 or frames[at].is_empty:
            continue
        start = predictions[at]
        if inner is not None and options.carry > 0:
            start = start + options.carry * _transported(template, predictions, positions, (inner, at))
        target = Target(frames[at])
        positions[at] = _fit_frame(template, start, target, options)
        residuals[at] = measure(Mesh.of(positions[at], faces), target)
    return Fit(positions, tuple(residuals))


def _outward(count: int, key: int | None) -> list[tuple[int, int | None]]:
    """Frames in the order of fitting, each with its neighbor nearer to the key."""
    middle = count // 2 if key is None else key
    if count and not 0 <= middle < count:
        raise InputError(f"key {key} is not one of {count} frames")
    order: list[tuple[int, int | None]] = [(middle, None)] if count else []
    order += [(t, t - 1) for t in range(middle + 1, count)] + [(t, t + 1) for t in range(middle - 1, -1, -1)]
    return order


def _fit_frame(
    template: Template, start: Float64[np.ndarray, "V 3"], target: Target, options: FitOptions
) -> Float64[np.ndarray, "V 3"]:
    bending = sparse.csr_array(template.laplacian.T @ template.laplacian)
    eye = sparse.eye_array(template.count)
    offset = np.zeros_like(start)
    for gate, smoothing in zip(options.gates, options.smoothing, strict=True):
        pairs = MatchOptions(gate, options.agreement, options.normal_weight)
        rows, _ = match(template, start + offset, target, pairs)
        matrix, right = template.normal_equations(rows, start)
        smooth = sparse.csr_array(smoothing**2 * bending + options.anchor**2 * eye)
        offset = solve(matrix, smooth, right, offset, (options.iterations, options.tolerance))
    return start + offset


def _transported(
    template: Template,
    predictions: Float64[np.ndarray, "T V 3"],
    positions: Float64[np.ndarray, "T V 3"],
    step: tuple[int, int],
) -> Float64[np.ndarray, "V 3"]:
    """The offset fitted at the first frame of `step`, turned as the prediction turns to the second."""
    before, after = step
    turns = _rotations(template, predictions[before], predictions[after])
    return np.einsum("vij,vj->vi", turns, positions[before] - predictions[before])


def _rotations(
    template: Template, before: Float64[np.ndarray, "V 3"], after: Float64[np.ndarray, "V 3"]
) -> Float64[np.ndarray, "V 3 3"]:
    """The rotation of each vertex's one-ring (Kabsch)."""
    i, j = template.edges.T
    outer = ((before[j] - before[i])[:, :, None] * (after[j] - after[i])[:, None, :]).reshape(-1, 9)
    both = np.concatenate([i, j])
    sums = [np.bincount(both, np.tile(outer[:, k], 2), template.count) for k in range(9)]
    u, _, vt = np.linalg.svd(np.stack(sums, axis=1).reshape(-1, 3, 3))
    sign = np.ones((template.count, 3))
    sign[:, 2] = np.linalg.det(u @ vt)
    return np.einsum("vki,vk,vjk->vij", vt, sign, u)
