"""Verdicts on promises. In: the promises of a study, its rows. Out: measured values, and whether promises are kept."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import singledispatch
from itertools import pairwise
from math import inf

from ..bd_rate import BdRate, Curve, bd_bound, beats, gain_end, rate_at
from ..experiments import study
from ..rows import Row
from .values import curve, curve_of, floors, hull_of, is_twin, rated, sequences, value

# Misses that weigh the same where the row nearest to all bounds is looked for (guess); others count in the bound's own.
STEPS = {"Mbps": 0.03, "dB": 0.5, "degrees": 0.25, "SSIM": 0.01}


@dataclass(frozen=True, slots=True)
class Verdict:
    """A promise and what was measured; `value` and `met` are None where no row decides."""

    text: str
    bound: str
    value: str | None = None
    met: bool | None = None

    @property
    def word(self) -> str:
        """One word for a table."""
        return {None: "not measured", True: "met", False: "MISSED"}[self.met]


def verdicts(experiment: study.Study, rows: Sequence[Row]) -> list[Verdict]:
    """Return a verdict on each promise of an experiment."""
    return [found for promise in experiment.promises for found in _judged(promise, rows)]


@singledispatch
def _judged(promise: study.Promise, _rows: Sequence[Row]) -> list[Verdict]:
    raise TypeError(f"no verdict on a {type(promise).__name__}")


@_judged.register
def _(promise: study.Reaches, rows: Sequence[Row]) -> list[Verdict]:
    """The cheapest row that keeps all bounds, or the nearest one."""
    floor = floors(row for row in rows if row.point.sequence == promise.which.sequence)
    limits = [_resolved(bound, floor) for bound in promise.bounds]
    own = [row for row in _chosen(rows, promise.which) if all(value(row, b.key) is not None for b in promise.bounds)]
    limit = ", ".join(map(_text, promise.bounds)) + (f" (aim {promise.aim})" if promise.aim else "")
    if not own or None in limits:
        return [Verdict(promise.text, limit)]
    bounds = [bound for bound in limits if bound is not None]
    good = [row for row in own if not any(_miss(row, bound) for bound in bounds)]
    cheapest = min(good, key=lambda row: value(row, "mbps") or 0.0, default=None)
    row = cheapest or min(own, key=lambda row: sum(_miss(row, bound) for bound in bounds))
    found = [_number(value(row, b.key), b.unit) + (" (short)" if _miss(row, b) else "") for b in bounds]
    return [Verdict(promise.text, limit, ", ".join(found) + _where(row), bool(good))]


@_judged.register
def _(promise: study.Needs, rows: Sequence[Row]) -> list[Verdict]:
    most = f"{100 * promise.most:g} % of the other's" if promise.than else f"{promise.most:g} Mbps"
    limit = f"{_text(promise.bound)} at <= {most}" + (f" (aim {promise.aim})" if promise.aim else "")
    rates = list[float | None]()
    for which in (promise.which, promise.than) if promise.than else (promise.which,):
        pairs = [(value(row, promise.rate), value(row, promise.bound.key)) for row in _chosen(rows, which)]
        known = [(rate, quality) for rate, quality in pairs if rate is not None and quality is not None]
        if not known:
            return [Verdict(promise.text, limit)]
        rates.append(rate_at(Curve(which.curve, *map(list, zip(*known, strict=True))), promise.bound.limit).rate)
    own, other = rates[0], rates[-1] if promise.than else 1.0
    if own is None or other is None:
        return [Verdict(promise.text, limit, "a quality that is not reached", False)]
    shown = f"{own:.4g} Mbps" + (f" against {other:.4g}: {100 * own / other:.3g} %" if promise.than else "")
    return [Verdict(promise.text, limit, shown, own / other <= promise.most)]


@_judged.register
def _(promise: study.Always, rows: Sequence[Row]) -> list[Verdict]:
    """The worst row."""
    own = [row for row in _chosen(rows, promise.which) if value(row, promise.bound.key) is not None]
    bound = f"{_text(promise.bound)} at every point"
    if not own:
        return [Verdict(promise.text, bound)]
    sign = 1 if promise.bound.least else -1
    worst = min(own, key=lambda row: sign * (value(row, promise.bound.key) or 0.0))
    missed = sum(_miss(row, promise.bound) > 0 for row in own)
    place = "" if promise.which.sequence else f", {worst.point.sequence}"
    found = f"{_number(value(worst, promise.bound.key), promise.bound.unit)}{_where(worst)}{place}"
    return [Verdict(promise.text, bound, f"{found}; {missed} of {len(own)} points miss it", not missed)]


@_judged.register
def _(promise: study.Gains, rows: Sequence[Row]) -> list[Verdict]:
    text = f"{promise.sequence}: rate at equal quality against the hull of {', '.join(promise.anchors)}"
    text += ", below the noise floor" if promise.below_floor else ""
    bound = f"<= {promise.most:g} % by each measure"
    own = rated(rows, promise.sequence)
    names = set(map(curve_of, own))
    if promise.curve not in names or not names & set(promise.anchors):
        return [Verdict(text, bound)]
    rates = {measure: _gain(promise, rows, measure) for measure in promise.measures}
    found = [f"{m.name} {_percent(rate)} ({m.shown(rate.low)} to {m.shown(rate.high)})" for m, rate in rates.items()]
    met = all(rate.percent is not None and rate.percent <= promise.most for rate in rates.values())
    return [Verdict(text, bound, "; ".join(found), met), *_ends(promise, own)]


def _gain(promise: study.Gains, rows: Sequence[Row], measure: study.Measure) -> BdRate:
    """Return the BD-rate by one measure; over all qualities where none of both is below the floor."""
    own = rated(rows, promise.sequence)
    anchor, test = hull_of(own, promise.anchors, measure), curve(own, promise.curve, measure)
    known = floors(row for row in rows if row.point.sequence == promise.sequence)
    highest = known.get(measure.key, inf) if promise.below_floor else inf
    rate = bd_bound(anchor, test, highest)
    return rate if rate.percent is not None else bd_bound(anchor, test)


def _ends(promise: study.Gains, own: Sequence[Row]) -> list[Verdict]:
    """Return a verdict on the quality up to which there is a gain, if that is promised."""
    if promise.ends_past is None:
        return []
    [measure] = [each for each in promise.measures if each.key == promise.ends_past.key]
    end = gain_end(hull_of(own, promise.anchors, measure), curve(own, promise.curve, measure))
    text, bound = f"{promise.sequence}: the gain in {measure.name} ends past", _text(promise.ends_past)
    if end.quality is None:
        return [Verdict(text, bound, end.where, False)]
    return [Verdict(text, bound, f"{measure.shown(end.quality)} ({end.where})", end.quality >= promise.ends_past.limit)]


@_judged.register
def _(promise: study.LeastRate, rows: Sequence[Row]) -> list[Verdict]:
    return [_least_rate(promise, rows, sequence) for sequence in sequences(rows)]


def _least_rate(promise: study.LeastRate, rows: Sequence[Row], sequence: str) -> Verdict:
    own, truth = rated(rows, sequence), floors(row for row in rows if row.point.sequence == sequence)
    text = f"{sequence}: {promise.curve} needs less rate than every other codec wherever both reach a quality"
    met, lost, beyond = list[bool | None](), list[str](), dict[str, list[str]]()
    for name in dict.fromkeys(map(curve_of, own)):
        for measure in promise.measures:
            if name == promise.curve or is_twin(name, measure):
                continue
            best, other = curve(own, promise.curve, measure), curve(own, name, measure)
            several = min(len(best.rates), len(other.rates)) > 1  # a point is no range
            met.append(beats(best, other, measure.least) if several else None)
            if met[-1] is False:
                least = max(min(best.qualities), min(other.qualities))
                noise = measure.sign > 0 and least > truth.get(measure.key, inf)  # all that is compared is noise
                lost.append(f"not {name} ({measure.name}{', which is beyond that of the truth itself' * noise})")
            if several and max(other.qualities) > max(best.qualities) + measure.least:
                beyond.setdefault(measure.name, []).append(name)
    decided = [left for left in met if left is not None]
    bound = "in " + " and ".join(measure.name for measure in promise.measures)
    if not decided:
        return Verdict(text, bound)
    found = f"in {sum(decided)} of {len(met)} comparisons, {len(met) - len(decided)} undecided"
    past = [f"past its best point in {measure}: {', '.join(names)}" for measure, names in beyond.items()]
    return Verdict(text, bound, "; ".join([found, *lost, *past]), all(decided))


@_judged.register
def _(promise: study.Rises, rows: Sequence[Row]) -> list[Verdict]:
    falls, checked = list[str](), 0
    for sequence in sequences(rows):
        points = curve(rated(rows, sequence), promise.curve, promise.measure)
        rising = sorted(zip(points.rates, points.qualities, strict=True))
        checked += len(rising) > 1
        shown = promise.measure.shown
        falls += [f"{sequence}: {shown(a[1])} and {shown(b[1])}" for a, b in pairwise(rising) if b[1] <= a[1]]
    text = f"{promise.curve}: quality rises with rate on every sequence"
    value = "; ".join(falls) or f"on {checked} sequences"
    return [Verdict(text, promise.measure.name, value, not falls) if checked else Verdict(text, promise.measure.name)]


@_judged.register
def _(promise: study.Flat, rows: Sequence[Row]) -> list[Verdict]:
    kind, unit = ("memory", "MB") if promise.key == "encode_mb" else ("time a frame", "s")
    text = f"{promise.which.sequence}: {kind} of an encode does not grow with the number of frames"
    bound = f"within {100 * promise.within:g} %"
    own = [row for row in _chosen(rows, promise.which) if row.point.frames and value(row, promise.key) is not None]
    if len(own) < 2:
        return [Verdict(text, bound)]
    few, many = (pick(own, key=lambda row: row.frames) for pick in (min, max))
    before, after = value(few, promise.key) or 0.0, value(many, promise.key) or 0.0
    shown = f"{before:.4g} {unit} at {few.frames} frames, {after:.4g} at {many.frames}"
    found = f"{shown}: {100 * (after / before - 1):+.1f} %"
    return [Verdict(text, bound, found, after / before - 1 <= promise.within)]


@_judged.register
def _(promise: study.NoMore, rows: Sequence[Row]) -> list[Verdict]:
    bound = f"<= {promise.factor:g} times"
    found = [value(row, promise.key) for which in (promise.which, *promise.than) for row in _chosen(rows, which)[:1]]
    own, *others = [number for number in found if number is not None] or [0.0]
    if len(others) < len(promise.than):
        return [Verdict(promise.text, bound)]
    ratio = own / sum(others)
    shown = f"{own:.4g} against {sum(others):.4g}: {ratio:.3g} times"
    return [Verdict(promise.text, bound, shown, ratio <= promise.factor)]


def _chosen(rows: Sequence[Row], which: study.Which) -> list[Row]:
    """Return the rows that a promise is about."""
    return [
        row
        for row in rows
        if which.sequence in ("", row.point.sequence)
        and which.curve in (row.name, curve_of(row))
        and which.metrics in (None, row.point.metrics)
        and all(row.options.get(name) == option for name, option in which.options.items())
    ]


def _resolved(bound: study.Bound, floor: dict[str, float]) -> study.Bound | None:
    """Return the bound as a number; None where it is beyond a noise floor that is not known."""
    if not bound.over_floor:
        return bound
    known = floor.get(bound.key)
    return None if known is None else study.Bound(bound.key, known + bound.limit, bound.unit, bound.least)


def _miss(row: Row, bound: study.Bound) -> float:
    """Return the distance of a row from a bound; 0 if the bound is kept."""
    found = value(row, bound.key)
    if found is None:
        return inf
    step = STEPS.get(bound.unit, abs(bound.limit) or 1.0)
    return max(0.0, (bound.limit - found if bound.least else found - bound.limit) / step)


def _text(bound: study.Bound) -> str:
    sign = ">=" if bound.least else "<="
    if not bound.over_floor:
        return f"{sign} {_number(bound.limit, bound.unit)}"
    return f"{sign} the input's" + (f" + {_number(bound.limit, bound.unit)}" if bound.limit else "")


def _number(number: float | None, unit: str) -> str:
    return "none" if number is None else f"{number:.4g} {unit}".rstrip()


def _percent(rate: BdRate) -> str:
    if rate.percent is None:
        return f"not known: {rate.reason}"
    return f"{'at most ' if rate.at_most else ''}{rate.percent:+.1f} %"


def _where(row: Row) -> str:
    quality = row.options.get("quality")
    return f" at quality {quality:g}" if isinstance(quality, (int, float)) else ""
