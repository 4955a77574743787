"""A fit made compressible where few components are kept: surfaces stay, trajectories move into those components.

In -> out: a fit of a group and its base mesh -> a fit whose energy beyond the first m components is smaller. A template
may slide along a surface without leaving it; alternating between the truncated KLT (section 3.3.3) and a short surface
fit from it (section 3.3.2) uses that freedom.

Differs from the paper, which fits first and truncates then (docs/decisions/compact-fit.md).
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
    return FitOptions(gates=(0.02,), smoothing=(0.5,), anchor=0.05)


@dataclass(frozen=True, slots=True)
class CompactOptions:
    """How a fit is made compressible."""

    rounds: int = 3  # of truncation and fit; each costs about a quarter of the first fit
    fit: FitOptions = field(default_factory=_short_fit)  # one round, started from the truncated trajectories

    def __post_init__(self) -> None:
        if self.rounds < 0:
            raise InputError(f"{self.rounds} rounds of compacting: give 0 or more")


def compact(fit: Fit, base: Mesh, frames: Sequence[Mesh], components: int, options: CompactOptions) -> Fit:
    """The fit with less energy beyond its first `components`; the same where that is all of them."""
    if components >= 3 * len(frames):
        return fit
    for _ in range(options.rounds):
        low = _truncated(displacements(fit, base), components)
        predictions = np.ascontiguousarray(base.vertices + np.moveaxis(low, 1, 0))
        fit = fit_frames(base.faces, predictions, frames, options.fit)
    return fit


def displacements(fit: Fit, base: Mesh) -> Float64[np.ndarray, "V T 3"]:
    """The displacement field of a fit: its positions less those of the base."""
    return np.ascontiguousarray(np.moveaxis(fit.positions, 0, 1) - base.vertices[:, None])


def _truncated(field: Float64[np.ndarray, "V T 3"], count: int) -> Float64[np.ndarray, "V T 3"]:
    basis = klt.fit(field)
    first = klt.Basis(basis.mean, np.ascontiguousarray(basis.vectors[:, :count]), basis.energies[:count])
    return klt.inverse(klt.forward(field, first), first)
