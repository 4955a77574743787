"""Rates that codecs need for the same quality, each interpolated on its own curve as BD-rates are: rows -> Markdown."""

from __future__ import annotations

from collections.abc import Sequence
from statistics import median

import pandas as pd

from ..bd_rate import rate_at, reach
from ..experiments.study import Measure
from ..rows import Row
from .looks import in_order
from .tables import markdown, text
from .values import curve, curve_of


def rate_table(rows: Sequence[Row], best: str, measures: Sequence[Measure]) -> list[str]:
    """Return the rate that each curve needs for a common quality, and how many times that of `best` it is."""
    names = in_order(map(curve_of, rows))
    if best not in names or len(names) < 2:
        return []
    table = pd.DataFrame({"codec": [text(name) for name in names]})
    for measure in measures:
        quality = common_quality(rows, best, measure)
        if quality is not None:
            head = f"Mbps at {measure.shown(quality)} ({measure.name}) ↓"
            table[head] = [_cell(rows, name, best, measure, quality) for name in names]
    if len(table.columns) == 1:
        return []
    lines = markdown(table)
    notes = {
        "≤ ": "≤: that of its cheapest point, which is better still.",
        "- (": "-: even its best point, which is shown, is not as good.",
    }
    found = [note for sign, note in notes.items() if sign in "".join(lines)]
    rule = f"×: how many times what {text(best)} needs. The quality is the median of its points'."
    return [*lines, "", f"Rates are interpolated on each codec's own curve, as for BD-rates; {rule}", *found]


def common_quality(rows: Sequence[Row], best: str, measure: Measure) -> float | None:
    """Return the median quality of the points of `best`, that is, of those between its lowest and highest rate."""
    qualities = curve(rows, best, measure).qualities
    return float(f"{median(qualities):.3g}") if len(qualities) > 1 else None


def rate_ratio(rows: Sequence[Row], name: str, best: str, measure: Measure) -> float | None:
    """Return how many times the rate of `best` a curve needs at the common quality; None where it has no rate there."""
    quality = common_quality(rows, best, measure)
    if quality is None:
        return None
    own, other = (rate_at(curve(rows, each, measure), quality) for each in (best, name))
    return None if own.rate is None or other.rate is None or other.at_most else other.rate / own.rate


def _cell(rows: Sequence[Row], name: str, best: str, measure: Measure, quality: float) -> str:
    points = curve(rows, name, measure)
    found, ends = rate_at(points, quality), reach(points)
    if ends is None:
        return ""
    if found.rate is None:
        return f"- (up to {measure.shown(ends[1][0])} at {ends[1][1]:.4g})"
    ratio = rate_ratio(rows, name, best, measure) if name != best else None
    return ("≤ " if found.at_most else "") + f"{found.rate:.4g}" + ("" if ratio is None else f" (×{ratio:.3g})")
