"""Plan groups: cut frames only where another template saves more than it costs (decision 24).

In -> out: the residuals that each template leaves on each frame -> groups of successive frames, each with its template
or with none. Residuals are in units of the distance to reach; a cost is a sum of their squares. Preset `paper`, with
one reference for all frames, cuts a group by the fit of its frames (section 3.3.2: GoF; decision 15).
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from itertools import groupby

import numpy as np
from jaxtyping import Float64

Residuals = Float64[np.ndarray, "C T"]  # of each template on each frame
NOBODY = -1  # in place of a template: its frames are coded one by one
CODED = 0.7  # squared targets that coding adds to a residual (measured on bodies at quality 50)
USUAL = 2.0  # squared targets, largest residual of a good template (guess)
CLOSE = 2.0  # factor on the price of templates in the plan that is coded for comparison (guess)
LOST = 1e6  # targets, in place of an infinite residual
SMALL = 0.1  # squared targets that do not justify another key (guess)
REACHED = 1.0  # squared targets of a frame that is coded alone
POP = 1.5  # dB, largest step of the quality at a cut without a price (guess)
LIMIT = 2.0  # a frame is lost if its residual is larger than this many times the target (guess)
TOLERANCE = 2.0  # or larger than the target and than this many times the group's median (guess)


@dataclass(frozen=True, slots=True)
class PlanOptions:
    """Prices of a plan, and conditions for trying another template."""

    limit: float = 2.0  # a frame is lost if its residual is larger than this many times the target
    worth: float = 14.0  # price of a template: the sum of squared residuals that it must save (decision 24)
    alone: float = 1.2  # price of a frame without a template, in prices of a template (guess)
    keys: int = 5  # largest number of frames tried as keys for one plan
    settled: float = 1.0  # excess beyond which another key is tried, in prices of a template
    misses: int = 2  # successive keys without gain after which no other is tried (guess)
    gain: float = 0.25  # smallest gain of a key, in prices of a template (guess)


@dataclass(frozen=True, slots=True)
class PlannedGroup:
    """Successive frames with one template."""

    template: int  # its number, or `NOBODY`
    first: int
    stop: int

    @property
    def is_alone(self) -> bool:
        """True if its frames are coded one by one."""
        return self.template == NOBODY


@dataclass(frozen=True, slots=True)
class Plan:
    """Groups that cover some frames, with their cost."""

    groups: tuple[PlannedGroup, ...]
    cost: float
    squares: Float64[np.ndarray, " T"]  # squared residual of each frame, or the price of a frame without a template

    @property
    def excess(self) -> Float64[np.ndarray, " T"]:
        """Squared residuals beyond those of the better half of the frames, which any template would leave."""
        usual = np.median(np.sort(self.squares)[: (len(self.squares) + 1) // 2])
        return np.maximum(self.squares - min(usual, USUAL), 0.0)


def best_plan(residuals: Residuals, onward: Sequence[bool], options: PlanOptions) -> Plan:
    """Return the plan of least cost (dynamic programming); residuals of frames that a template does not follow are inf.

    The cost is the sum of the squared residuals, the prices of the groups' templates, and the prices of steps of the
    quality at cuts. A template that is `onward`, known from earlier frames, costs nothing, but only the first group can
    have it.
    """
    (count, frames), price = residuals.shape, options.worth
    squares = np.vstack([residuals**2, np.full(frames, options.alone * price)])
    starts = np.array([0.0 if is_onward else price for is_onward in onward] + [0.0])
    changes = np.array([np.inf if is_onward else price for is_onward in onward] + [0.0])
    errors = 10 * np.log10(np.vstack([np.minimum(residuals, LOST) ** 2 + CODED, np.full(frames, REACHED)]))  # dB
    best, before = starts + squares[:, 0], np.zeros((frames, count + 1), int)
    for t in range(1, frames):
        steps = np.abs(errors[:, t][None] - errors[:, t - 1][:, None])
        pops = price * np.maximum(steps / POP - 1, 0.0)
        ways = best[:, None] + changes[None] + pops
        np.fill_diagonal(ways, best)
        before[t] = np.argmin(ways, axis=0)
        best = ways[before[t], np.arange(count + 1)] + squares[:, t]
    last = int(np.argmin(best))
    path = [last]
    for t in range(frames - 1, 0, -1):
        path.append(int(before[t, path[-1]]))
    path.reverse()
    groups, at = list[PlannedGroup](), 0
    for template, same in groupby(path):
        stop = at + len(list(same))
        groups.append(PlannedGroup(NOBODY if template == count else template, at, stop))
        at = stop
    return Plan(tuple(groups), float(best[last]), squares[path, np.arange(frames)])


def rival(plan: Plan, residuals: Residuals, onward: Sequence[bool], options: PlanOptions) -> Plan | None:
    """Return a different plan that is best at a higher or lower price of templates; None if there is none."""
    for price in (options.worth * CLOSE, options.worth / CLOSE):
        other = best_plan(residuals, onward, replace(options, worth=price))
        if other.groups != plan.groups:
            return other
    return None


def next_key(plan: Plan, tried: Collection[int]) -> int | None:
    """Return the frame to try next as a key: the middle of the costliest run; None if all were tried."""
    excess = plan.excess
    bad = excess >= max(0.999 * float(excess.mean()), SMALL)
    runs, at = list[range](), 0
    for is_bad, same in groupby(bad):
        stop = at + len(list(same))
        if is_bad and not set(range(at, stop)) <= set(tried):
            runs.append(range(at, stop))
        at = stop
    if not runs:
        return None
    worst = max(runs, key=lambda run: float(excess[run.start : run.stop].sum()))
    middle, center = (worst.start + worst.stop - 1) / 2, (len(excess) - 1) / 2
    untried = (frame for frame in worst if frame not in tried)
    return min(untried, key=lambda frame: (abs(frame - middle), abs(frame - center), -frame))


def cut_at(residuals: Float64[np.ndarray, " T"]) -> int | None:
    """Return the frame that should begin a second group, or None if one reference follows all frames.

    Residuals are in units of the distance to reach. The cut leaves the residuals on each side most alike (least squares
    on their logarithms), which separates frames that are followed well from those that are not.
    """
    limit = min(LIMIT, max(1.0, TOLERANCE * float(np.median(residuals))))
    if len(residuals) < 2 or residuals.max() <= limit:
        return None
    logs = np.log(np.clip(residuals, 1e-6, 1e6))
    sides = ((logs[:cut], logs[cut:]) for cut in range(1, len(logs)))
    spread = [sum(((side - side.mean()) ** 2).sum() for side in both) for both in sides]
    return 1 + int(np.argmin(spread))
