"""Progress of an encode: frames counted through its stages, the share of the whole that is done, and the time left.

In: reports of work, from any thread. Out: a `Progress` for each, to a callback. A frame takes in a stage what frames
have taken there so far; before any has, what is usual, or more where stages before took more than is usual for them.
"""

from __future__ import annotations

import time
from collections import defaultdict
from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from threading import Lock

from ...geometry.work import reporting

KINDS = {"frames tracked": "track", "frames fitted": "fit", "frames fitted again": "refine"}  # of work
# Of the parts of an encode, the stages in their order, s a frame; measured on two cores with dancer, the rig of
# `meshreel demo` and living_room at 2 cm.
COSTS = {
    "look": {"look": 0.4},
    "survey": {"survey": 0.1},
    "segment": {"views": 0.04, "observe": 0.13, "segment": 0.1, "compare": 0.4},
    "background": {"background": 0.4, "noise": 0.1},
    "room": {"room": 0.7, "pictures": 0.5, "bodies": 0.15},
    "best": {"track": 0.38, "fit": 0.2, "refine": 0.12, "patch": 0.1, "measure": 0.2, "code": 0.03, "judge": 0.05},
    "paper": {"track": 0.35, "reference": 0.7, "fit": 0.4, "refine": 0.1, "measure": 0.2, "code": 0.1},
    "color": {"slide": 0.28, "color": 0.17},
}
VIEWS = 120  # places from which segmentation looks
MOST = {"look": 16, "compare": 16, "background": 20, "noise": 12, "room": 16}  # frames of stages that need no more
_BEFORE = ("track", "reference", "fit", "slide", "refine", "patch", "measure", "code")  # in the order of a frame
_AFTER = ("judge", "color")  # of groups that are coded
_OFTEN = ("bodies", *_BEFORE, *_AFTER)  # they follow each other again and again
_ONCE = ("look", *COSTS["segment"], *COSTS["background"])  # not again by a search for a target
GROWTH = 1.1  # times the least time left so far that it may be (a decision)
MARGIN = 1.0  # by which the time left is told larger at first, as it may not grow (guess)
EARLIEST = 0.05  # share that is done before the time left is told (guess)
FIRM = 1  # weight of the usual time of a frame, in frames that were timed (guess)
SECONDS = 5.0  # that tell as much of the speed as what is usual (guess)
BODIES = 1.5  # of a scene, before they are known (guess)


@dataclass(frozen=True, slots=True)
class Progress:
    """Progress of an encode: a stage, and the share and time of the whole."""

    stage: str  # that frames have just passed
    done: int  # frames that have passed it
    total: int  # frames that pass it; of "views" places, from which a scene is seen
    share: float  # of the whole encode, 0 to 1; never falls
    left: float | None  # s, estimated; never grows by more than a tenth; None at first


Report = Callable[[Progress], object]


class Stages:
    """Counts frames through the stages of an encode, or of several in search for a target."""

    def __init__(
        self, report: Report | None, total: int, more: float = 0.0, clock: Callable[[], float] = time.monotonic
    ) -> None:
        """`more` is how many further encodes of the frames are expected; the clock serves the estimate alone."""
        self._report, self._total, self._more, self._clock, self._last = report, total, more, clock, clock()
        self._usual, self._totals = dict[str, float](), dict[str, int]()  # s a frame, and frames, of expected stages
        self._done, self._timed = defaultdict[str, Fraction](Fraction), defaultdict[str, Fraction](Fraction)
        self._seconds, self.bodies = defaultdict[str, float](float), BODIES  # each takes as long as frames of one
        self._before, self._share, self._least = 0.0, 0.0, float("inf")
        self._one_thread = Lock()

    def expect(self, *parts: str) -> None:
        """Expect the stages of these parts of `COSTS`, in this order."""
        stages = {stage: seconds for part in parts for stage, seconds in COSTS[part].items()}
        self._usual = {stage: stages[stage] for stage in stages if not self._before or stage not in _ONCE}
        self._totals = {stage: min(MOST.get(stage, self._total), self._total) for stage in stages} | {"views": VIEWS}
        self.bodies = self.bodies if "room" in parts else 1.0

    def passed(self, stage: str, count: int | Fraction) -> None:
        """Count further frames that have passed a stage that is expected; stages that end before it have ended."""
        if stage not in self._usual and not (stage in COSTS["color"] and self._usual):
            return
        with self._one_thread:
            if stage not in self._usual:  # frames turn out to have colours
                self._usual |= COSTS["color"]
                self._totals |= dict.fromkeys(COSTS["color"], self._total)
            for earlier in self._usual:
                if earlier == stage or earlier in _OFTEN:
                    break
                self._done[earlier] = Fraction(self._totals[earlier])
            count = min(count, self._totals[stage] - self._done[stage])
            now, before = self._clock(), self._last
            self._last, self._seconds[stage] = now, self._seconds[stage] + now - before
            self._done[stage], self._timed[stage] = self._done[stage] + count, self._timed[stage] + count
            if self._report is not None:
                left = self._left()
                told = Progress(stage, int(self._done[stage]), self._totals[stage], self._share, left)
                with reporting(None):  # what the callback does is no work of this encode
                    self._report(told)

    def skip(self, count: Fraction) -> None:
        """Count frames that are known from an earlier run, and take no time."""
        with self._one_thread:
            for stage in (*_BEFORE, *_AFTER):
                self._done[stage] += count

    def again(self) -> None:
        """Begin another encode of the frames, after which half a further one is expected at least."""
        with self._one_thread:
            self._before, self._more = sum(self._seconds.values()), max(self._more - 1, 0.5)
            self._done.clear()

    def finish(self) -> None:
        """Report that the encode is done."""
        if self._report is not None:
            self._report(Progress("done", self._total, self._total, 1.0, 0.0))

    def _left(self) -> float | None:
        """Return the time left, s, and note the share that is done."""
        paces = self._paces()
        whole = {stage: pace * self._totals[stage] for stage, pace in paces.items()}
        spent = sum(pace * float(self._done[stage]) for stage, pace in paces.items())
        left = sum(whole.values()) - spent + self._more * sum(whole[each] for each in whole if each not in _ONCE)
        shown = min(left * (1 + MARGIN * (1 - self._share) ** 4), GROWTH * self._least)
        spent += self._before
        self._share = max(self._share, spent / max(spent + min(left, shown), 1e-9))
        if self._share < EARLIEST:
            return None
        self._least = min(self._least, shown)
        return shown

    def _paces(self) -> dict[str, float]:
        """Return the seconds that a frame takes in each stage."""
        usual = {stage: each * (self.bodies if stage in _OFTEN else 1) for stage, each in self._usual.items()}
        expected = sum(float(self._timed[stage]) * each for stage, each in usual.items())
        speed = max(1.0, (sum(self._seconds.values()) + SECONDS) / (expected + SECONDS))
        return {
            stage: (self._seconds[stage] + FIRM * speed * each) / (float(self._timed[stage]) + FIRM)
            for stage, each in usual.items()
        }


class IntervalStages:
    """Counts the frames of one interval as frames of the sequence; a frame that is done again does not count again."""

    def __init__(
        self, tell: Callable[[str, Fraction], object], count: int, group_size: int, weight: Fraction = Fraction(1)
    ) -> None:
        """Each of the `count` frames is `weight` of one of the sequence: bodies of a scene share it."""
        self._tell, self._count, self._group_size, self._weight = tell, count, group_size, weight
        self.reached, self._of_group = defaultdict[str, int](int), defaultdict[str, int](int)

    def passed(self, kind: str, number: int) -> None:
        """Count work on the next group, whose frames may be worked on more than once, or on groups that are coded."""
        stage = KINDS.get(kind, kind)
        if stage in ("code", *_AFTER):
            self.reach(stage, self.reached[stage] + number)
        elif stage in _BEFORE:
            self._of_group[stage] = min(self._of_group[stage] + number, self._group_size)
            self.reach(stage, self.reached["code"] + self._of_group[stage])

    def reach(self, stage: str, done: int) -> None:
        """Count frames of `stage` up to `done`, and of those before it; fewer than before change nothing."""
        for each in (stage,) if stage in _AFTER else _BEFORE[: _BEFORE.index(stage) + 1]:
            reached, now = self.reached[each], min(done, self._count)
            if now > reached:
                self.reached[each] = now
                self._tell(each, (now - reached) * self._weight)
        if stage == "code":
            self._of_group.clear()

    def end(self) -> None:
        """Count the interval as done."""
        for stage in ("code", *_AFTER):
            self.reach(stage, self._count)
