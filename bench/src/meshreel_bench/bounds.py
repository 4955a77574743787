"""A target with several parts that one and the same point has to reach: rate, distance, normals, pictures.

In -> out: rows of a codec and bounds -> what the point that reaches them all has, or the nearest and what it lacks.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from .curves import value
from .rows import Row

STEPS = {"Mbps": 0.03, "dB": 0.5, "degrees": 0.25, "SSIM": 0.01}  # misses that weigh the same


@dataclass(frozen=True, slots=True)
class Bound:
    """One part of a target."""

    key: str  # what `curves.value` finds in a row
    limit: float
    unit: str  # of STEPS
    least: bool = True  # False: at most

    def __str__(self) -> str:
        return f"{'>=' if self.least else '<='} {_number(self.limit, self.unit)}"

    def miss(self, row: Row) -> float:
        """How far the row is from it, in the unit's step; 0 where it is reached, infinite where it was not measured."""
        found = value(row, self.key)
        if found is None:
            return float("inf")
        return max(0.0, (self.limit - found if self.least else found - self.limit) / STEPS[self.unit])

    def told(self, row: Row) -> str:
        """The row's value, and whether it is short."""
        found = value(row, self.key)
        text = f"no {self.key}" if found is None else _number(found, self.unit)
        return text if self.miss(row) == 0 else f"{text} (short)"


def bounds_text(bounds: Sequence[Bound]) -> str:
    """The target in words."""
    return ", ".join(map(str, bounds))


def judge(rows: Sequence[Row], bounds: Sequence[Bound]) -> tuple[str, bool]:
    """What the cheapest row that keeps all bounds measures, and True; or the nearest row, and False."""
    good = [row for row in rows if all(bound.miss(row) == 0 for bound in bounds)]
    row = (
        min(good, key=lambda r: r["mbps"]) if good else min(rows, key=lambda r: sum(bound.miss(r) for bound in bounds))
    )
    measured = ", ".join(bound.told(row) for bound in bounds)
    return f"{measured} at quality {row['options']['quality']:g}", bool(good)


def _number(number: float, unit: str) -> str:
    return f"{number:.{3 if unit in ('Mbps', 'SSIM') else 2}f} {unit}"
