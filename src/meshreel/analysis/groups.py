"""Where a group is cut: by the measured fit of its frames, not by a fixed grid (paper, section 3.3.2: GoF).

In -> out: the symmetric residual of each frame's fit -> a frame to cut before, or nothing.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from ..errors import InputError


@dataclass(frozen=True, slots=True)
class GroupOptions:
    """When a group is cut in two."""

    limit: float = 2.0  # a frame whose residual is above this many times the target is not followed
    tolerance: float = 2.0  # nor is one above the target and this many times the group's median
    depth: int = 1  # cuts inside cuts; frames that are still not followed are coded one by one
    worth: float = math.inf  # squared targets, mean over a group's frames, that a group more is worth

    def __post_init__(self) -> None:
        if self.limit < 1 or self.tolerance < 1 or self.depth < 0 or not self.worth > 0:
            raise InputError(
                f"group limit {self.limit:g}, tolerance {self.tolerance:g}, depth {self.depth}, worth {self.worth:g}: "
                "give >= 1, >= 1, >= 0, > 0"
            )


def cut_at(residuals: Float64[np.ndarray, " T"], options: GroupOptions) -> int | None:
    """The frame that should begin a second group, or None where one reference follows all frames.

    Residuals are in units of the distance to reach. Of all cuts that one is taken which leaves residuals on both sides
    most alike (least squares on their logarithms): frames that are followed well and those that are not end up apart.
    """
    limit = min(options.limit, max(1.0, options.tolerance * float(np.median(residuals))))
    if len(residuals) < 2 or (residuals.max() <= limit and _excess(residuals).mean() <= options.worth):
        return None
    logs = np.log(np.clip(residuals, 1e-6, 1e6))
    spread = [_scatter(logs[:cut]) + _scatter(logs[cut:]) for cut in range(1, len(logs))]
    return 1 + int(np.argmin(spread))


def leading(residuals: Float64[np.ndarray, " T"], usual: float, options: GroupOptions) -> int:
    """How many of the first frames a template still follows that usually left `usual`; units of the distance to reach.

    Until a frame is lost, or until what a new template would save is worth a new group.
    """
    lost = residuals > options.limit * max(usual, 1.0)
    spent = np.cumsum(np.maximum(residuals**2 - usual**2, 0.0)) > options.worth * len(residuals)
    stop = np.flatnonzero(lost | spent)
    return int(stop[0]) if len(stop) else len(residuals)


def _excess(residuals: Float64[np.ndarray, " T"]) -> Float64[np.ndarray, " T"]:
    """Squared residuals above those of the better half of the frames, which a template of their own would leave too."""
    usual = np.median(np.sort(residuals)[: (len(residuals) + 1) // 2])
    return np.maximum(residuals**2 - usual**2, 0.0)


def _scatter(values: Float64[np.ndarray, " n"]) -> float:
    return float(((values - values.mean()) ** 2).sum())
