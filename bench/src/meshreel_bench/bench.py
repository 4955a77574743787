"""What a run of points is about: its sequences, what it compares, and for how long."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path

from meshreel.io.sequence import SequenceOptions
from meshreel.metrics.comparison import ComparisonOptions

from .rows import FIRST

PICTURES = ".pictures"  # how the folder's name ends, beside the rows


@dataclass(frozen=True, slots=True)
class Bench:
    """Where a run finds its sequences, and what it compares."""

    data: Path  # the folder of the sequences
    experiment: str = FIRST  # rows of other experiments in the same file are left alone
    comparison: ComparisonOptions = field(default_factory=ComparisonOptions)
    cache: Path | None = None  # sequences that take long to make are kept here
    limit_s: float | None = None  # wall time of a point, which then has a process of its own; None: measured in this
    retry: bool = False  # points that failed before are measured again
    alike: tuple[str, ...] = ()  # experiments that measure in the same way: their rows count, too
    own: SequenceOptions = field(default_factory=SequenceOptions)  # how files become a sequence that is no benchmark's

    @property
    def pictures(self) -> Path | None:
        """The folder of the pictures of what is decoded; none where nothing is kept."""
        return self.cache and self.cache.with_suffix(PICTURES)

    def absolute(self) -> Bench:
        """The same wherever a process goes."""
        return replace(self, data=self.data.absolute(), cache=self.cache and self.cache.absolute())
