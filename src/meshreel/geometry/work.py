"""Counts of an encode's work: a measure of cost that does not depend on the machine; and of its progress.

In: calls of `count` and `passed` beside the work. Out: counts by kind since a moment; reports as it is done.
"""

from __future__ import annotations

import threading
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from typing import Literal

Kind = Literal[
    "frames read",
    "frames tracked",
    "frames fitted",  # from a prediction; those of an accepted group are fitted again
    "frames fitted again",
    "surfaces fused",
    "pictures drawn",  # of surface as a colour camera sees it
    "decimations",
    "closest points",
]
Work = dict[Kind, int]  # number of times by kind
Report = Callable[[str, int], object]  # a kind of work or a stage, and the number of times or frames

Reporter = tuple[Report, threading.Lock]  # one call at a time

_here = threading.local()


def count(kind: Kind, number: int = 1) -> None:
    """Count work that this thread does."""
    _counts()[kind] += number
    passed(kind, number)


def passed(stage: str, number: int = 1) -> None:
    """Report that this thread has brought frames through a stage."""
    if (known := reporter()) is not None:
        report, one_call = known
        with one_call:
            report(stage, number)


def reporter() -> Reporter | None:
    """Return the function that gets the work of this thread, with its lock; None where it is not reported."""
    return getattr(_here, "reporter", None)


def reporting(report: Report | None) -> AbstractContextManager[None]:
    """Call `report`, one call at a time, with the work and the stages of this thread in the block."""
    return reporting_by(None if report is None else (report, threading.Lock()))


@contextmanager
def reporting_by(known: Reporter | None) -> Iterator[None]:
    """Let this thread report in the block as another one does."""
    before, _here.reporter = reporter(), known
    try:
        yield
    finally:
        _here.reporter = before


def so_far() -> Work:
    """Return the work of this thread so far."""
    return dict(_counts())


def since(before: Work) -> Work:
    """Return the work of this thread since `so_far` returned `before`."""
    return dict(sorted((_counts() - Counter(before)).items()))


def add(work: Work) -> None:
    """Count work that another thread or process did for this one."""
    _counts().update(work)


def _counts() -> Counter[Kind]:
    if not hasattr(_here, "counts"):
        _here.counts = Counter[Kind]()
    return _here.counts
