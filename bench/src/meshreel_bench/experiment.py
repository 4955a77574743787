"""What a run and a report need of an experiment."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Protocol, runtime_checkable

from meshreel.metrics.comparison import ComparisonOptions

from .promises import Promise
from .rows import Point, Row


@runtime_checkable
class Experiment(Protocol):
    """What an experiment says of itself: a module of `experiments`, or a `Study`.

    Besides, it may have METRICS, pairs of a row's key and its label, and `floors`, lines in the
    plots by metric, that FLOOR_NAME names.
    """

    @property
    def COMPARISON(self) -> ComparisonOptions:
        """What is measured."""
        ...

    def points(self, small: bool, /) -> Iterator[Point]:
        """All points, or a few of a few frames."""
        ...

    def references(self, sequence: str, /) -> dict[str, list[tuple[float, float]]]:
        """Curves that were not measured here: Mbps and D2, by name."""
        ...

    def promises(self, rows: Sequence[Row], /) -> list[Promise]:
        """The targets, with what the rows say."""
        ...

    def comparisons(self, rows: Sequence[Row], /) -> Iterator[str]:
        """Lines of Markdown on the rows of one sequence."""
        ...

    def shown(self, rows: Sequence[Row], /) -> list[Row]:
        """The rows of one sequence that its table has."""
        ...

    def sections(self, rows: Sequence[Row], /) -> Iterator[str]:
        """Lines of Markdown on all rows."""
        ...
