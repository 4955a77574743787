"""Displacement fields: one template of constant topology laid onto the surface of each frame (paper, section 3.3.2).

In: the decoded, subdivided reference deformed to each frame; the frames. Out: its positions on every frame, and how
well they fit. Coordinates are normalised: the sequence's bounding-box diagonal is 1.
Between data and prediction stands a shape: the key frame's fit, turned as the body turns, so that detail and sliding
along the surface stay the same over time and cost no rate. A second fit is drawn towards what the coder represents
cheaply: the first's strongest components, or whatever coherent positions a caller makes of it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int32

from ...errors import InputError
from ...types import Mesh
from .conjugate_gradients import Limits
from .match import MatchOptions, Target, match
from .residual import NOTHING, Residual, residual_of
from .shape import doubtful, strongest_components, turned_laplacian
from .system import Problem, Template, solve

Coherence = Callable[[Float64[np.ndarray, "T V 3"]], Float64[np.ndarray, "T V 3"]]


@dataclass(frozen=True, slots=True)
class FitOptions:
    """How a template is laid onto the frames; one entry per round in `gates` and `smoothing`.

    The last entry of `smoothing` trades rate for accuracy: a smaller one follows finer detail and costs more.
    """

    gates: tuple[float, ...] = (0.024, 0.018, 0.012, 0.012)  # pairs farther apart do not count; of the diagonal
    smoothing: tuple[float, ...] = (4.0, 2.0, 0.7, 0.4)  # row weight of the shape: its Laplacian against the turned one
    agreement: float = 0.3  # least cosine between the normals of a pair
    anchor: float = 0.02  # row weight of the offset from the prediction
    components: int = 15  # of the trajectories, that the second fit is drawn to; 0: no second fit
    pull: float = 0.1  # row weight of the offset from the coherent positions, in the second fit
    restart: bool = True  # the second fit starts from the coherent positions, and the key keeps its first fit
    second_smoothing: float | None = None  # row weight of the coherent shape; None: the last of `smoothing`
    guard: float = 1.0  # factor on the smoothing where faces fold over or collapse
    key: int | None = None  # the frame to begin with; the middle one if None
    iterations: int = 40  # of the conjugate gradients, at most, a round
    tolerance: float = 1e-3  # their relative residual

    def __post_init__(self) -> None:
        if len(self.gates) != len(self.smoothing) or not self.gates or min(self.gates + self.smoothing) <= 0:
            raise InputError(
                f"gates {self.gates}, smoothing {self.smoothing}: give each round a positive value of both"
            )
        if not -1 <= self.agreement < 1:
            raise InputError(f"agreement {self.agreement} is a cosine: give at least -1 and less than 1")
        if min(self.anchor, self.pull) <= 0 or self.guard < 1 or self.components < 0:
            raise InputError(
                f"anchor {self.anchor}, pull {self.pull}, guard {self.guard}, "
                f"components {self.components}: give > 0, > 0, >= 1, >= 0"
            )
        if self.second_smoothing is not None and not self.second_smoothing > 0:
            raise InputError(
                f"second smoothing {self.second_smoothing:g}: give > 0, or None for the last of `smoothing`"
            )
        if self.iterations < 1 or not 0 <= self.tolerance < 1:
            raise InputError(f"{self.iterations} iterations, tolerance {self.tolerance}: give at least 1, and 0 to 1")


@dataclass(frozen=True, slots=True)
class Guides:
    """What a caller knows of the template beyond its connectivity."""

    rest: Float64[np.ndarray, "V 3"] | None = None  # its shape; None: that of the key frame's own fit
    coherence: Coherence | None = None  # fitted positions -> those that the second fit is drawn to; None: `components`


@dataclass(frozen=True, slots=True)
class Fit:
    """The template on every frame."""

    positions: Float64[np.ndarray, "T V 3"]
    residuals: tuple[Residual, ...]

    @staticmethod
    def at(
        faces: Int32[np.ndarray, "F 3"], positions: Float64[np.ndarray, "T V 3"], targets: Sequence[Target | None]
    ) -> Fit:
        """Positions with what they leave over of each frame."""
        meshes = (Mesh.of(fitted, faces) for fitted in positions)
        pairs = zip(meshes, targets, strict=True)
        return Fit(positions, tuple(NOTHING if target is None else residual_of(mesh, target) for mesh, target in pairs))

    @property
    def by_area(self) -> Float64[np.ndarray, " T"]:
        """Symmetric RMS over the area of each frame."""
        return np.array([residual.by_area for residual in self.residuals])

    @property
    def common(self) -> Float64[np.ndarray, " T"]:
        """The same, where the frames have surface."""
        return np.array([residual.common for residual in self.residuals])

    def first(self, count: int) -> Fit:
        """The first so many frames."""
        return Fit(self.positions[:count], self.residuals[:count])


def fit_frames(
    faces: Int32[np.ndarray, "F 3"],
    predictions: Float64[np.ndarray, "T V 3"],
    frames: Sequence[Mesh],
    options: FitOptions,
    guides: Guides = Guides(),
) -> Fit:
    """The template's positions on each frame's surface, and what is left over.

    Where a frame has no surface near, the template follows its prediction smoothly; an empty frame gets the
    prediction and an infinite residual.
    """
    count = len(frames)
    if len(predictions) != count:
        raise InputError(f"{len(predictions)} predictions for {count} frames: give one for each")
    if options.key is not None and not 0 <= options.key < count:
        raise InputError(f"key {options.key} is not one of {count} frames: give 0 to {count - 1}")
    if len(faces) == 0 or count == 0:
        return Fit(predictions.copy(), (NOTHING,) * count)
    targets = [None if mesh.is_empty else Target(mesh) for mesh in frames]
    positions = fit_targets(faces, predictions, targets, options, guides)
    return Fit.at(faces, positions, targets)


def fit_targets(
    faces: Int32[np.ndarray, "F 3"],
    predictions: Float64[np.ndarray, "T V 3"],
    targets: Sequence[Target | None],
    options: FitOptions,
    guides: Guides = Guides(),
) -> Float64[np.ndarray, "T V 3"]:
    """The template's positions on frames that are prepared already (None: an empty one); no residuals."""
    registration = _Registration(Template(faces, predictions.shape[1]), targets, options, _key(targets, options))
    positions = registration.first(predictions, guides.rest)
    if options.components and len(targets) > 1:
        if guides.coherence is None:
            coherent = strongest_components(positions, registration.key, options.components)
        else:
            coherent = guides.coherence(positions)
        positions = registration.second(positions, coherent)
    return positions


def _key(targets: Sequence[Target | None], options: FitOptions) -> int:
    """The frame asked for, or the middle one; the nearest to it that is not empty."""
    middle = len(targets) // 2 if options.key is None else options.key
    there = [t for t, target in enumerate(targets) if target is not None]
    return min(there, key=lambda t: (abs(t - middle), t), default=middle)


@dataclass(frozen=True, slots=True)
class _Registration:
    """A template and the frames that it is laid onto, in two fits."""

    template: Template
    targets: Sequence[Target | None]
    options: FitOptions
    key: int

    def first(
        self, predictions: Float64[np.ndarray, "T V 3"], given: Float64[np.ndarray, "V 3"] | None
    ) -> Float64[np.ndarray, "T V 3"]:
        """Every frame from its prediction, the key frame first: its fit is the others' shape if none is given."""
        options, template = self.options, self.template
        positions = predictions.copy()
        rest = predictions[self.key] if given is None else given
        for at in [self.key] + [t for t in range(len(self.targets)) if t != self.key]:
            target = self.targets[at]
            if target is None:
                continue
            x = predictions[at]
            for gate, smoothing in zip(options.gates, options.smoothing, strict=True):
                shape, turns = turned_laplacian(template, rest, x)
                stiffness = np.full(template.count, smoothing)
                if options.guard > 1 and smoothing == options.smoothing[-1]:  # before, the data must have their say
                    stiffness[doubtful(template, rest, turns, x)] *= options.guard
                x = self._round(x, target, gate, Problem(shape, stiffness, predictions[at], options.anchor))
            positions[at] = x
            rest = positions[self.key] if given is None else given
        return positions

    def second(
        self, first: Float64[np.ndarray, "T V 3"], coherent: Float64[np.ndarray, "T V 3"]
    ) -> Float64[np.ndarray, "T V 3"]:
        """The frames fitted again, near the coherent positions that were made of the first fit."""
        options, template = self.options, self.template
        positions = first.copy()
        smoothing = options.smoothing[-1] if options.second_smoothing is None else options.second_smoothing
        for at, target in enumerate(self.targets):
            if target is None or (at == self.key and options.restart):
                continue
            x = coherent[at] if options.restart else first[at]
            stiffness = np.full(template.count, smoothing)
            if options.guard > 1:
                _, turns = turned_laplacian(template, first[self.key], x)
                stiffness[doubtful(template, first[self.key], turns, x)] *= options.guard
            shape = template.laplacian @ coherent[at]
            for gate in options.gates[-2:]:
                x = self._round(x, target, gate, Problem(shape, stiffness, coherent[at], options.pull))
            positions[at] = x
        return positions

    def _round(
        self, x: Float64[np.ndarray, "V 3"], target: Target, gate: float, problem: Problem
    ) -> Float64[np.ndarray, "V 3"]:
        options = self.options
        rows = match(self.template, x, target, MatchOptions(gate, options.agreement))
        return x + solve(self.template, rows, x, problem, Limits(options.iterations, options.tolerance))
