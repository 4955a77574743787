"""Progress of an encode: frames counted through the stages, reported to a callback."""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction
from threading import Lock
from typing import Any

Progress = Callable[[str, int, int], None]  # stage, frames done in it, frames of the sequence
STEPS = {"frames tracked": "track", "frames fitted": "fit"}  # stages that work tells of, frame by frame


class Stages:
    """Counts frames through the stages and reports the counts to a progress callback."""

    def __init__(self, progress: Progress | None, total: int) -> None:
        self._progress = progress
        self._total = total
        self._done: dict[str, Fraction] = {}
        self._one_thread = Lock()

    def reach(self, stage: str, share: float) -> None:
        """Count frames of `stage` up to this share of all frames."""
        self.add(stage, max(round(share * self._total) - self._done.get(stage, 0), 0))

    def add(self, stage: str, count: int | Fraction) -> None:
        """Count `count` further frames of `stage`."""
        with self._one_thread:
            self._done[stage] = self._done.get(stage, Fraction()) + count
            if self._progress is not None:
                self._progress(stage, int(self._done[stage]), self._total)


class IntervalStages(Stages):
    """Counts the frames of one interval as frames of the sequence; a frame that is done again does not count again."""

    def __init__(self, stages: Stages, count: int, group_size: int, weight: Fraction = Fraction(1)) -> None:
        """`weight` is how much of a frame of the sequence each of the `count` frames is: bodies of a scene share it."""
        self._stages, self._count, self._group_size, self._weight = stages, count, group_size, weight
        self._reached: dict[str, int] = {}
        self._since_group = dict[str, int]()

    def reach(self, stage: str, share: float) -> None:
        """Count frames of `stage` up to this share of the interval."""
        self.reach_frame(stage, round(share * self._count))

    def add(self, stage: str, count: int | Fraction) -> None:
        """Count `count` further frames of the interval."""
        self.reach_frame(stage, self._reached.get(stage, 0) + int(count))

    def reach_frame(self, stage: str, done: int) -> None:
        """Count frames of `stage` up to `done`; fewer than before change nothing."""
        before, now = self._reached.get(stage, 0), min(done, self._count)
        if now > before:
            self._reached[stage] = now
            self._stages.add(stage, (now - before) * self._weight)
        if stage == "code":
            self._since_group = {}
            for earlier in STEPS.values():  # a key is not tracked, and some frames are not fitted
                self.reach_frame(earlier, now)

    def add_work(self, kind: Any, number: int) -> None:
        """Count work on the next group, whose frames may be worked on more than once."""
        if (stage := STEPS.get(kind)) is not None:
            self._since_group[stage] = min(self._since_group.get(stage, 0) + number, self._group_size)
            done = self._reached.get("code", 0) + self._since_group[stage]
            for passed in ("track", "fit") if stage == "fit" else (stage,):  # what is fitted was tracked, or is a key
                self.reach_frame(passed, done)
