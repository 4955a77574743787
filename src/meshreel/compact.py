"""A fit made compressible: surfaces stay where they are, trajectories move into the components that will be kept.

In -> out: a fit of a group and its base mesh -> a fit whose energy beyond the first components is smaller. A template
may slide along a surface without leaving it; alternating between the truncated KLT (section 3.3.3) and a short surface
fit from it (section 3.3.2) uses that freedom for the rate.

Differs from the paper: it fits first and truncates then (docs/decisions/0010-compact-fit.md).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float64

from .analysis.fit import Fit, FitOptions, fit_frames
from .coding import klt
from .errors import InputError
from .types import Mesh


def _short_fit() -> FitOptions:
    return FitOptions(gates=(0.02,), smoothing=(0.5,), anchor=0.05, carry=0.0)


@dataclass(frozen=True, slots=True)
class CompactOptions:
    """How a fit is made compressible."""

    rounds: int = 2  # of truncation and fit; each costs about a fifth of the first fit
    threshold: float = 0.8  # a component is kept where its rms is above this many quantiser steps
    fit: FitOptions = field(default_factory=_short_fit)  # one round, started from the truncated trajectories

    def __post_init__(self) -> None:
        if self.rounds < 0 or self.threshold < 0:
            raise InputError(f"{self.rounds} rounds, threshold {self.threshold:g}: neither may be negative")


def compact(
    fit: Fit, base: Mesh, frames: Sequence[Mesh], limits: tuple[int | None, float], options: CompactOptions
) -> Fit:
    """The fit with less energy beyond the kept components; limits = (their number or None, the quantiser step)."""
    for _ in range(options.rounds):
        low = _truncated(displacements(fit, base), limits, options.threshold)
        if low is None:
            return fit
        predictions = base.vertices + np.moveaxis(low, 1, 0)
        fit = fit_frames(base.faces, np.ascontiguousarray(predictions), frames, options.fit)
    return fit


def displacements(fit: Fit, base: Mesh) -> Float64[np.ndarray, "V T 3"]:
    """The displacement field of a fit: its positions less those of the base."""
    return np.ascontiguousarray(np.moveaxis(fit.positions, 0, 1) - base.vertices[:, None])


def _truncated(
    field: Float64[np.ndarray, "V T 3"], limits: tuple[int | None, float], threshold: float
) -> Float64[np.ndarray, "V T 3"] | None:
    """The field in its first components; None where all are kept anyway."""
    count, step = limits
    basis = klt.fit(field)
    if count is None:
        count = int((basis.energies > (threshold * step) ** 2).sum())
    if count >= len(basis.energies):
        return None
    first = klt.Basis(basis.mean, np.ascontiguousarray(basis.vectors[:, :count]), basis.energies[:count])
    return klt.inverse(klt.forward(field, first), first)
