"""The experiments by name; each declares its points, and what is promised and told of their rows."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Protocol, runtime_checkable

from ...errors import InputError
from ...metrics.report import ComparisonOptions
from ..promises import Promise
from ..rows import Point, Row
from . import (
    ablation_basis,
    ablation_centers,
    ablation_gof,
    ablation_stages,
    figure6,
    layers,
    scenes,
    table1,
    table2,
    targets,
)


@runtime_checkable
class Experiment(Protocol):
    """What an experiment says of itself: a module of this package, or a `Study`.

    Besides, it may have METRICS, pairs of a row's key and its label, and `floors`, what the noisy input reaches.
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


# In the order of the report.
EXPERIMENTS: dict[str, Experiment] = {
    "figure6": figure6.STUDY,
    "table1": table1.STUDY,
    "table2": table2.STUDY,
    "ablation_centers": ablation_centers.STUDY,
    "ablation_gof": ablation_gof.STUDY,
    "ablation_basis": ablation_basis.STUDY,
    "ablation_stages": ablation_stages.STUDY,
    "scenes": scenes,
    "layers": layers,
    "targets": targets,
}


def experiment(name: str) -> Experiment:
    """The experiment called `name`. Raises InputError for an unknown one."""
    if name not in EXPERIMENTS:
        raise InputError(f"no experiment is called {name!r}; known: {', '.join(sorted(EXPERIMENTS))}")
    return EXPERIMENTS[name]
