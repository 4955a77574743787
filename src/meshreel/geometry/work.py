"""Counts of an encode's work: a measure of cost that does not depend on the machine.

In: calls of `count` beside the work. Out: counts by kind since a moment.
"""

from __future__ import annotations

import threading
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Literal

Kind = Literal[
    "frames read",
    "frames tracked",
    "frames fitted",  # from a prediction; those of an accepted group are fitted again
    "frames fitted again",
    "surfaces fused",
    "decimations",
    "closest points",
]
Work = dict[str, int]  # number of times by kind

_here = threading.local()


def count(kind: Kind, number: int = 1) -> None:
    """Count work that this thread does."""
    _counts()[kind] += number
    if (report := getattr(_here, "report", None)) is not None:
        report(kind, number)


@contextmanager
def reporting(report: Callable[[Kind, int], object]) -> Iterator[None]:
    """Call `report` with the work that this thread counts in the block."""
    before, _here.report = getattr(_here, "report", None), report
    try:
        yield
    finally:
        _here.report = before


def so_far() -> Work:
    """Return the work of this thread so far."""
    return dict(_counts())


def since(before: Work) -> Work:
    """Return the work of this thread since `so_far` returned `before`."""
    return dict(sorted((_counts() - Counter(before)).items()))


def add(work: Work) -> None:
    """Count work that another thread or process did for this one."""
    _counts().update(work)


def _counts() -> Counter[str]:
    if not hasattr(_here, "counts"):
        _here.counts = Counter[str]()
    return _here.counts
