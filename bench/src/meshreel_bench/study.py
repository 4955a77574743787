"""A study: an experiment of the paper's kind, declared as sweeps of codecs over sequences.

A declaration says what is run; points, what is promised of the rows, comparisons and tables follow from it. Rows are
those of `rd_rows`.
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from meshreel.errors import InputError
from meshreel.metrics.bd_rate import Curve, beats, have_range
from meshreel.metrics.comparison import ComparisonOptions

from .codecs import make_codec
from .curves import Measure, against, curve, curve_of, value
from .promises import Promise
from .rd_rows import FLOOR, RATED, SAMPLED, TRUTH_ITSELF
from .report.equal import rate_table
from .report.tables import bd_table, comparable_table, summary_table, text
from .rows import Point, Row, select

SMALL_SEQUENCE, SMALL_FRAMES = "demo", 3  # procedural: `--small` needs no data
D2 = Measure("d2_psnr_paper", "D2, paper form", " dB", least=0.5)
MASKED = Measure("ssim_masked", "masked SSIM", "", least=0.01)
MEASURES = (
    D2,
    MASKED,
    Measure("ssim", "SSIM", "", least=0.005),
    Measure("normal_error_deg", "normal error", " degrees", -1, least=0.3),
    Measure("truth_d2_psnr_backward", "D2 to the truth", " dB", least=0.5),  # where there is one
    Measure("truth_ssim_masked", "masked SSIM to the truth", "", least=0.01),
)
PROMISED = (D2, MASKED)
UNITS = {"mbps": "Mbps", "d2_psnr_paper": "dB"}
Values = Mapping[str, Sequence[Any]]  # options that are varied together, by name


@dataclass(frozen=True, slots=True)
class Sweep:
    """A codec over operating points: one for each of the values, or the fixed one where there are none."""

    codec: str
    values: Values
    fixed: Mapping[str, Any] = field(default_factory=dict)
    on: Mapping[str, Values] = field(default_factory=dict)  # other values on these sequences
    only: Sequence[str] = ()  # sequences; none: on all
    small: Mapping[str, Any] = field(default_factory=dict)  # what `--small` changes of its one point
    sampled: Sequence[str] = ()  # sequences of which it is given the frames that are measured

    def points(self, sequence: str, frames: int | None) -> Iterator[Point]:
        """Its points on a sequence."""
        if self.only and sequence not in self.only:
            return
        values = self.on.get(sequence, self.values)
        kind = SAMPLED if sequence in self.sampled else RATED
        for point in zip(*values.values(), strict=True) if values else [()]:
            options = {**self.fixed, **dict(zip(values, point, strict=True))}
            yield Point(sequence, self.codec, options, frames, kind)

    def small_point(self) -> Point:
        """The point in the middle, as `--small` has it."""
        first = {name: several[len(several) // 2] for name, several in self.values.items()}
        return Point(SMALL_SEQUENCE, self.codec, {**self.fixed, **first, **self.small}, SMALL_FRAMES, RATED)


@dataclass(frozen=True, slots=True)
class Study:
    """The declaration. `best` is the name, as rows have it, of the codec that is to beat all others; None: none is."""

    sequences: Sequence[str]
    sweeps: Sequence[Sweep]
    best: str | None = None
    anchor: str | None = None  # the codec that all others are compared with
    goals: Callable[[Sequence[Row]], list[Promise]] | None = None  # what else is promised
    truths: Sequence[str] = ()  # sequences with a truth
    frames: Mapping[str, int] = field(default_factory=dict)  # the first so many of a sequence; none said: all
    common: tuple[str, float] | None = None  # a table of each codec's point nearest to this, by the key of a row
    notes: Sequence[str] = ()  # Markdown, before the tables
    METRICS: Sequence[tuple[str, str]] = tuple((measure.key, measure.label) for measure in MEASURES)
    FLOOR_NAME: str = TRUTH_ITSELF  # what a line in the plots is
    COMPARISON: ComparisonOptions = field(default_factory=ComparisonOptions)

    def points(self, small: bool) -> Iterator[Point]:
        """All points, sequence by sequence; where `small`, one of each sweep on a few procedural frames."""
        if small:
            yield from (sweep.small_point() for sweep in self.sweeps)
            return
        for sequence in self.sequences:
            frames = self.frames.get(sequence)
            if sequence in self.truths:
                yield Point(sequence, "captured", {}, frames, FLOOR)
            for sweep in self.sweeps:
                yield from sweep.points(sequence, frames)

    def extended(self, sequences: Sequence[str], added: Sequence[str]) -> Study:
        """The same with operating points more (`operating_point`), and on these sequences instead, where there are any.

        A sequence may be any that `datasets` opens: a name or a path.
        """
        more = [Sweep(codec, {}, options) for codec, options in map(operating_point, added)]
        return replace(self, sequences=sequences or self.sequences, sweeps=(*self.sweeps, *more))

    def references(self, _sequence: str) -> dict[str, list[tuple[float, float]]]:
        """Curves that were not measured here: none."""
        return {}

    def floors(self, rows: Sequence[Row]) -> dict[str, float]:
        """What the truth reaches against the input, by metric, on the sequence of the rows."""
        found = [row for row in rows if row["kind"] == FLOOR]
        return {key: number for row in found for key, _ in self.METRICS if (number := value(row, key)) is not None}

    def promises(self, rows: Sequence[Row]) -> list[Promise]:
        """That `best` needs less rate than every other codec at every quality that both reach; then the goals."""
        left = [self._left_of_all(rows, sequence) for sequence in _sequences(rows)] if self.best else []
        return [*left, *(self.goals(rows) if self.goals else ())]

    def comparisons(self, rows: Sequence[Row]) -> Iterator[str]:
        """Rates at equal quality, and BD-rates, on the rows of one sequence."""
        yield from (*rate_table(rows, self.best, PROMISED), "") if self.best else ()
        measures = [each for each in MEASURES if any(value(row, each.key) is not None for row in rows)]
        yield from bd_table(rows, self.best, measures) if self.best else ()
        yield from bd_table(rows, self.anchor, measures, is_anchor=True) if self.anchor else ()

    def shown(self, rows: Sequence[Row]) -> list[Row]:
        """The rows of one sequence that its table has: all."""
        return list(rows)

    def sections(self, rows: Sequence[Row]) -> Iterator[str]:
        """What must be known of the numbers, and each codec at the point that can be compared."""
        yield from ("", *self.notes) if self.notes else ()
        for measure in PROMISED if self.best and len(_sequences(rows)) > 1 else ():
            yield from ("", *summary_table(rows, str(self.best), measure))
        if lacking := self._lacking(rows):
            yield from ("", f"Declared and not measured: {', '.join(lacking)}.")
        if self.common is not None:
            key, wanted = self.common
            yield from ("", f"## Near {wanted:g} {UNITS[key]}", "", *comparable_table(rows, wanted, key))

    def _lacking(self, rows: Sequence[Row]) -> list[str]:
        """Sequences with the number of their points that have no row; none where all rows are of other sequences."""
        there, counts = {row.get("point") for row in rows}, Counter[str]()
        for point in self.points(small=False):
            counts[point.sequence] += point.key not in there
        own = {row["sequence"] for row in rows} & set(counts)
        return [f"{text(name)} ({count} points)" for name, count in counts.items() if count] if own else []

    def _left_of_all(self, rows: Sequence[Row], sequence: str) -> Promise:
        own = [row for kind in (RATED, SAMPLED) for row in select(rows, sequence, kind=kind)]
        promised = f"{text(sequence)}: {self.best} needs less rate than every other codec wherever both reach a quality"
        lost, beyond = list[str](), dict[str, list[str]]()
        met, ranges = list[bool | None](), 0
        for name in dict.fromkeys(map(curve_of, own)):
            for measure in PROMISED if name != self.best else ():
                best, other = _curve(own, str(self.best), measure), _curve(own, name, measure)
                several = min(len(best.rates), len(other.rates)) > 1  # a point is no range
                left = beats(best, other, measure.least) if several else None
                met.append(left)
                ranges += left is not None and have_range(best, other, measure.least)
                lost += [f"not {text(name)}: {against(other, best, measure)}"] if left is False else []
                if several and max(other.qualities) > max(best.qualities) + measure.least:
                    beyond.setdefault(measure.name, []).append(text(name))
        decided = [left for left in met if left is not None]
        if not decided:
            return Promise(promised, "in D2 and masked SSIM")
        ways = f"{ranges} over a common range, {len(decided) - ranges} point by point"
        found = f"in {sum(decided)} of {len(met)} comparisons, {len(met) - len(decided)} undecided ({ways})"
        past = [f"past its best point in {measure}: {', '.join(names)}" for measure, names in beyond.items()]
        return Promise(promised, "in D2 and masked SSIM", "; ".join([found, *lost, *past]), all(decided))


def operating_point(point: str) -> tuple[str, dict[str, Any]]:
    """A codec and its options, from `codec` or `codec:option=value,option=value`. InputError where it is neither."""
    codec, _, told = point.partition(":")
    options: dict[str, Any] = {}
    for each in told.split(",") if told else ():
        name, is_told, found = each.partition("=")
        if not (is_told and name):
            raise InputError(f"operating point {point!r}: {each!r} is no option=value")
        try:
            options[name] = json.loads(found)
        except json.JSONDecodeError:
            options[name] = found  # text without quotes
    make_codec(codec, options)  # refuses what it does not know
    return codec, options


def _curve(rows: Sequence[Row], name: str, measure: Measure) -> Curve:
    return curve([row for row in rows if curve_of(row) == name], name, measure)


def _sequences(rows: Sequence[Row]) -> list[str]:
    return list(dict.fromkeys(row["sequence"] for row in rows))
