"""Search for the quality whose encode meets a rate or a PSNR; each trial is a whole encode.

In: a sequence and a goal. Out: a file that meets it. The rate is nearly exponential in the quality and the PSNR nearly
linear, so that a few secant steps are enough.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from ..errors import InputError
from ..io.files import Place, located
from .file.summary import Summary
from .run.interval_files import opened_output
from .sequence import Encoder
from .settings.options import EncoderOptions

TRIALS = 8  # whole encodes, at most (guess)
USUAL_TRIALS = 3  # that progress expects (guess)
FIRST_QUALITY = 50.0  # middle of the scale (guess)
DIGITS = 4  # significant digits of a tried quality: a file records all of them (guess)


@dataclass(frozen=True, slots=True)
class Goal:
    """Goal of a search: exactly one of a PSNR and a rate."""

    psnr: float | None = None  # d2_psnr_paper, mean over the frames, dB; reached within 0.3 dB
    mbps: float | None = None  # of the whole file, Mbit/s; reached within 5 %

    def __post_init__(self) -> None:
        given = [value for value in (self.psnr, self.mbps) if value is not None]
        if len(given) != 1:
            raise InputError(f"targets {self.psnr} dB and {self.mbps} Mbps: give one of them")
        if not 0 < given[0] < math.inf:
            raise InputError(f"target {given[0]:g} {'dB' if self.mbps is None else 'Mbps'}: give a number above 0")

    @property
    def tolerance(self) -> float:
        """Largest difference between measured and wanted value; a little below the promised 0.3 dB or 5 %."""
        return 0.25 if self.mbps is None else math.log(1.04)

    @property
    def slope(self) -> float:
        """Typical rise of the measured value per point of quality, used until two values are known."""
        return 0.16 if self.mbps is None else math.log(2) / 22

    @property
    def wanted(self) -> float:
        """The wanted value on a scale that is nearly linear in the quality: dB, or the logarithm of the rate."""
        return math.log(self.mbps) if self.mbps is not None else float(self.psnr or 0.0)

    def measured(self, summary: Summary, frame_rate: float) -> float:
        """Return the value of a file on the scale of `wanted`."""
        if self.mbps is None:
            return summary.psnr
        return math.log(summary.size * 8 * frame_rate / summary.frame_count / 1e6)

    def exceeded_by_background(self, summary: Summary, frame_rate: float) -> str:
        """Return an error text where a scene's background, whose size no quality changes, exceeds the rate; else ""."""
        if self.mbps is None or summary.scene is None:
            return ""
        seconds = summary.frame_count / frame_rate
        rate = summary.scene.background * 8 / seconds / 1e6
        if rate <= math.exp(self.wanted + self.tolerance):
            return ""
        text = f"the background alone takes {summary.scene.background} bytes, {rate:.4g} Mbps over {seconds:.4g} s"
        return f"{text}, and the target is {self.mbps:g} Mbps; give more, more frames, or fewer copies of it"

    def text_of(self, value: float) -> str:
        """Format a measured value with its unit."""
        return f"{value:.2f} dB" if self.mbps is None else f"{math.exp(value):.4g} Mbps"


def encode_to(
    encoder: Encoder,
    path: str | Place,
    goal: Goal,
    options_at: Callable[[float], EncoderOptions],
    resume: bool | None = None,
) -> tuple[Summary, float]:
    """Write a file that meets the goal; return its summary and the quality that met it.

    `options_at` makes the options of a quality from 0 to 100. Raises InputError, and leaves no file, where no quality
    meets the goal: at once where a scene's background alone is more than the rate. A search that was stopped begins
    again: `resume` may not be True, and is otherwise that of `encode`.
    """
    search, path = Search(goal), located(path)
    if resume:
        text = f"{path}: a search for a target begins again, it cannot continue"
        raise InputError(f"{text}; leave --resume (resume=True) out, or give the quality in place of the target")
    stages = encoder.stages(USUAL_TRIALS - 1)
    with opened_output(path, encoder.sequence.files, resume, lasting=False) as (file, files):
        for _ in range(TRIALS):
            quality = search.next()
            if quality is None:
                break
            files.restart()
            file.seek(0)
            file.truncate()
            summary = encoder.encode_into(file, options_at(quality), files, stages)
            value = goal.measured(summary, encoder.sequence.frame_rate)
            if abs(value - goal.wanted) <= goal.tolerance:
                stages.finish()
                return summary, quality
            if over := goal.exceeded_by_background(summary, encoder.sequence.frame_rate):
                raise InputError(f"{path}: {over}")
            search.learn(quality, value)
            stages.again()
        raise InputError(f"{path}: no quality gives {goal.text_of(goal.wanted)}; {search.found()}")


class Search:
    """A secant search over qualities for a value that rises with them, inside what is known to bracket it."""

    def __init__(self, goal: Goal) -> None:
        self._goal = goal
        self._known: dict[float, float] = {}

    def next(self) -> float | None:
        """Return the quality to try next; None where none is left."""
        if not self._known:
            return FIRST_QUALITY
        wanted = self._goal.wanted
        below = max((q for q, value in self._known.items() if value < wanted), default=None)
        above = min((q for q, value in self._known.items() if value >= wanted), default=None)
        if below is not None and above is not None:
            low, high = sorted((below, above))
            share = (wanted - self._known[below]) / max(self._known[above] - self._known[below], 1e-9)
            return _short(low + (high - low) * min(max(share, 0.1), 0.9)) if high - low > 0.1 else None
        last = above if below is None else below
        assert last is not None
        ahead = _short(min(max(last + (wanted - self._known[last]) / self._slope(), 0.0), 100.0))
        return None if ahead in self._known else ahead

    def learn(self, quality: float, value: float) -> None:
        """Add the value that a quality led to."""
        self._known[quality] = value

    def found(self) -> str:
        """Return the tried qualities and their values for a message."""
        tried = sorted(self._known.items())
        return ", ".join(f"quality {quality:.4g} gives {self._goal.text_of(value)}" for quality, value in tried)

    def _slope(self) -> float:
        """Return the rise per point between the two outermost known qualities, or the typical one."""
        (q0, v0), (q1, v1) = min(self._known.items()), max(self._known.items())
        return max((v1 - v0) / (q1 - q0), 0.3 * self._goal.slope) if q1 > q0 else self._goal.slope


def _short(quality: float) -> float:
    return float(f"{quality:.{DIGITS}g}")
