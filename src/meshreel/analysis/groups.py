"""Where a group is cut: by the measured fit of its frames, not by a fixed grid (paper, section 3.3.2: GoF).

In -> out: the symmetric residual of each frame's fit -> a frame to cut before, or nothing.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from ..errors import InputError


@dataclass(frozen=True, slots=True)
class GroupOptions:
    """When a group is cut in two."""

    tolerance: float = 1.6  # a frame whose residual is this many times the group's median is not followed
    floor: float = 0.0004  # residuals below this never cut; fraction of the diagonal

    def __post_init__(self) -> None:
        if self.tolerance < 1:
            raise InputError(f"group tolerance must be at least 1, got {self.tolerance:g}")
        if self.floor < 0:
            raise InputError(f"group floor must not be negative, got {self.floor:g}")


def cut_at(residuals: Float64[np.ndarray, " T"], options: GroupOptions) -> int | None:
    """The frame that should begin a second group, or None where one reference follows all frames.

    Of all cuts that one is taken which leaves residuals on both sides most alike (least squares on their logarithms);
    frames that are followed well and those that are not end up apart.
    """
    limit = max(options.floor, options.tolerance * float(np.median(residuals)))
    if len(residuals) < 2 or residuals.max() <= limit:
        return None
    logs = np.log(np.maximum(residuals, 1e-12))
    spread = [_scatter(logs[:cut]) + _scatter(logs[cut:]) for cut in range(1, len(logs))]
    return 1 + int(np.argmin(spread))


def _scatter(values: Float64[np.ndarray, " n"]) -> float:
    return float(((values - values.mean()) ** 2).sum())
