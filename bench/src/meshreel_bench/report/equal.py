"""A table of the rates that codecs need for the same quality, each interpolated on its own curve as BD-rates are.

In -> out: rows of one sequence -> lines of Markdown. Which qualities these are follows from the rows (`common`).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from meshreel.metrics.bd_rate import Curve, rate_at, reach

from ..curves import Measure, curve, curve_of
from ..rows import Row
from .looks import in_order
from .tables import Cell, Told, ranked_table, text

Range = tuple[float, float]
_FINEST = 100  # parts of a range, below which no rounder quality is looked for


def rate_table(rows: Sequence[Row], best: str, measures: Sequence[Measure]) -> list[str]:
    """The rate that each codec needs for common qualities, and how many times that of `best` it is; then the rule.

    No lines where there are not two codecs to be compared.
    """
    names = in_order(map(curve_of, rows))
    heads, columns, steep = list[str](), list[list[Cell]](), list[str]()
    for measure in measures:
        curves = {name: curve([r for r in rows if curve_of(r) == name], name, measure) for name in names}
        ranges = {name: (found[0][0], found[1][0]) for name in names if (found := reach(curves[name])) is not None}
        chosen = common(list(ranges.values()), ranges.get(best), measure.least) if len(ranges) > 1 else []
        for quality in chosen:
            heads.append(f"Mbps at {measure.sign * quality:g}{measure.unit} ({measure.name})")
            own = rate_at(curves[best], quality).rate if best in ranges else None
            columns.append([_cell(curves[name], quality, measure, None if name == best else own) for name in names])
        steep += [_steep(curves[name], measure) for name in ranges if _is_steep(ranges[name], measure, chosen)]
    if not columns:
        return []
    cells = [[text(name), *found] for name, *found in zip(names, *columns, strict=True)]
    lines = ranked_table(["codec", *heads], cells, [0, *[-1] * len(heads)])
    return [*lines, "", *_note(text(best) if best in names else None, "".join(lines)), *steep]


def common(ranges: Sequence[Range], within: Range | None = None, apart: float = 0.0) -> list[float]:
    """One or two qualities for which most of some curves, given by what each reaches, have a rate; all in `within`.

    First the roundest of those for which the most have one, then the roundest that is higher, by `apart` at least, for
    which half of them do, and two at least. Of several ranges that as many reach, and of several as round, it is the
    highest.
    """
    low, high = within or (min(start for start, _ in ranges), max(end for _, end in ranges))

    def count(quality: float) -> int:
        return sum(start <= quality <= end for start, end in ranges)

    starts = [quality for quality in (low, *(start for start, _ in ranges)) if low <= quality <= high]
    start = max(starts, key=lambda quality: (count(quality), quality))
    first = _roundest(start, min([high, *(b for a, b in ranges if a <= start <= b)]))

    def is_second(quality: float) -> bool:
        return quality > first and quality >= first + apart and count(quality) >= max(2, len(ranges) / 2)

    ends = [end for end in (high, *(end for _, end in ranges)) if end <= high and is_second(end)]
    return [first, _roundest(first, max(ends), is_second)] if ends else [first]


def _roundest(low: float, high: float, is_good: Callable[[float], bool] = lambda _: True) -> float:
    """Of the good numbers in a range the highest multiple of the largest 1, 2 or 5 times a power of ten; or its end."""
    power = math.floor(math.log10(max(abs(low), abs(high)) or 1.0))
    while 10.0**power * _FINEST >= high - low > 0:
        for digit in (5, 2, 1):
            found = [quality for quality in _multiples(digit, power, low, high) if is_good(quality)]
            if found:
                return max(found)
        power -= 1
    return high


def _multiples(digit: int, power: int, low: float, high: float) -> list[float]:
    """Those of digit x 10^power in a range, exact as decimal numbers are."""
    step = digit * 10.0**power
    numbers = (digit * k for k in range(math.floor(low / step), math.ceil(high / step) + 1))
    found = [number * 10.0**power if power >= 0 else number / 10**-power for number in numbers]
    return [quality for quality in found if low <= quality <= high]


def _cell(points: Curve, quality: float, measure: Measure, other: float | None) -> Cell:
    """The rate for a quality, and how many times another one it is; or the best point, where it is not as good."""
    found, ends = rate_at(points, quality), reach(points)
    if ends is None:
        return None
    if found.rate is None:
        return f"- (up to {measure.shown(ends[1][0])} at {ends[1][1]:.4g})"
    return Told(found.rate, "≤ " if found.at_most else "", "" if other is None else f" (×{found.rate / other:.3g})")


def _is_steep(ends: Range, measure: Measure, chosen: Sequence[float]) -> bool:
    """Whether a rate has been interpolated on a curve along which quality hardly changes."""
    return 0 < ends[1] - ends[0] < measure.least and any(ends[0] <= quality <= ends[1] for quality in chosen)


def _steep(points: Curve, measure: Measure) -> str:
    ends = reach(points)
    assert ends is not None
    (low, cheapest), (high, dearest) = ends
    span = f"{measure.shown(low)} to {measure.shown(high)}, {measure.name}"
    told = f"Along the curve of {text(points.name)} quality hardly changes ({span}):"
    return f"{told} any of its rates, {cheapest:.4g} to {dearest:.4g}, is as true."


def _note(best: str | None, lines: str) -> list[str]:
    """What the lines of a table have, and by which rule. `best` is Markdown."""
    ratio = f"; ×: how many times what {best} needs" if best else ""
    among = f", {best} among them," if best else ""
    signs = {
        "| ≤ ": "≤: that of its cheapest point, which is better still.",
        "| - ": "-: even its best point, which is told, is not as good.",
    }
    return [
        f"Rates are interpolated on each codec's own curve, as for BD-rates{ratio}.",
        *(told for sign, told in signs.items() if sign in lines),
        f"The qualities follow from the rows: the roundest of those for which the most codecs{among} have a rate,",
        "and the roundest above it for which at least half of them (and two) do.",
    ]
