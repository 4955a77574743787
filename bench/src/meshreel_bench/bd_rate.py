"""Bjontegaard delta rate: the change of rate, in %, of a codec against an anchor at equal quality.

log rate is interpolated over quality by PCHIP and averaged over the range of quality that both curves reach
(Bjontegaard, VCEG-M33; PCHIP as in the JCT-VC common test conditions, JCTVC-L1100). GainEnd says where a gain ends,
because a mean hides curves that cross (decision 22).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float64

from meshreel.errors import InputError

_GRID = 2001  # qualities at which two curves are compared (guess)


@dataclass(frozen=True, slots=True)
class Curve:
    """Rate-distortion points of one codec; larger quality is better, so an error is given negated."""

    name: str
    rates: Sequence[float]  # any unit, over 0
    qualities: Sequence[float]  # any unit

    def __post_init__(self) -> None:
        if len(self.rates) != len(self.qualities):
            raise InputError(f"curve {self.name}: {len(self.rates)} rates and {len(self.qualities)} qualities")
        if not all(math.isfinite(r) and r > 0 for r in self.rates):
            raise InputError(f"curve {self.name}: rates {list(self.rates)}; all must be finite and over 0")
        if not all(math.isfinite(q) for q in self.qualities):
            raise InputError(f"curve {self.name}: qualities {list(self.qualities)}; leave out lossless points")


@dataclass(frozen=True, slots=True)
class BdRate:
    """BD-rate of a test curve against an anchor, or the reason why there is none."""

    percent: float | None  # mean change of rate against the anchor; negative is a saving
    low: float  # quality range that both curves reach
    high: float
    points: tuple[int, int]  # used points of anchor and test, without those that another point beats
    reason: str = ""  # why `percent` is None
    at_most: bool = False  # `percent` is an upper bound: the test's cheapest point is better than the whole anchor


def bd_rate(anchor: Curve, test: Curve, highest: float = math.inf) -> BdRate:
    """Return the mean change of rate at equal quality over the overlap up to `highest`; nothing is extrapolated.

    A point that costs no less than another and is no better is dropped: quality must grow with rate.
    """
    a, b = _front(anchor), _front(test)
    counts = (len(a), len(b))
    for curve, count in zip((anchor, test), counts, strict=True):
        if count < 2:
            reason = f"{curve.name} has {count} usable points; at least 2 are needed"
            return BdRate(None, math.nan, math.nan, counts, reason)
    low, high = float(max(a[0, 0], b[0, 0])), float(min(a[-1, 0], b[-1, 0], highest))
    if low >= high:
        below = "" if math.isinf(highest) else f" below {highest:.4g}"
        ranges = (f"{c.name} {p[0, 0]:.4g} to {p[-1, 0]:.4g}" for c, p in ((anchor, a), (test, b)))
        return BdRate(None, low, high, counts, f"no common quality{below}: {', '.join(ranges)}")
    mean = float(_log_rate(b).integrate(low, high) - _log_rate(a).integrate(low, high)) / (high - low)
    return BdRate(100 * math.expm1(mean), low, high, counts)


def bd_bound(anchor: Curve, test: Curve, highest: float = math.inf) -> BdRate:
    """Return `bd_rate`, or an upper bound where the test's cheapest point beats the whole anchor up to `highest`.

    The bound compares that point's rate with all rates of the anchor: a worse quality would need no higher rate.
    """
    found = bd_rate(anchor, test, highest)
    a, b = _front(anchor), _front(test)
    if found.percent is not None or len(a) < 2 or not len(b):
        return found
    low, high = float(a[0, 0]), float(min(a[-1, 0], highest))
    if not low < high <= b[0, 0]:
        return found
    mean = float(b[0, 1]) - float(_log_rate(a).integrate(low, high)) / (high - low)
    return BdRate(100 * math.expm1(mean), low, high, found.points, at_most=True)


@dataclass(frozen=True, slots=True)
class RateAt:
    """Rate that a curve needs for a quality."""

    rate: float | None  # None: no point of the curve reaches the quality
    at_most: bool = False  # `rate` is that of the cheapest point, whose quality is higher


def rate_at(curve: Curve, quality: float) -> RateAt:
    """Return the rate for a quality, interpolated as for `bd_rate`; nothing is extrapolated."""
    ends = reach(curve)
    if ends is None or quality > ends[1][0]:
        return RateAt(None)
    if quality <= ends[0][0]:
        return RateAt(ends[0][1], at_most=quality < ends[0][0])
    return RateAt(math.exp(_log_rate(_front(curve))(quality)))


def reach(curve: Curve) -> tuple[tuple[float, float], tuple[float, float]] | None:
    """Return (quality, rate) of the worst and the best point that no other beats; None for an empty curve."""
    points = _best(curve)
    return (points[0], points[-1]) if points else None


@dataclass(frozen=True, slots=True)
class GainEnd:
    """Highest quality at which a codec needs less rate than its anchor, within the range that both reach."""

    quality: float | None = None  # where the curves cross, or the end of the overlap; None: no gain, or no overlap
    where: str = "no gain at any common quality"  # or what ends the gain, without numbers
    share: float = 0.0  # of the overlap, in quality, over which there is a gain


def hull(name: str, curves: Sequence[Curve]) -> Curve:
    """Return the lower convex hull of all curves' points in (quality, rate), the strongest anchor they form.

    The hull is not taken in (quality, ln rate): there curves over dB bend the other way, and a chord from the first to
    the last point would lie far below what any of the codecs reaches.
    """
    rates = [rate for curve in curves for rate in curve.rates]
    points = _best(Curve(name, rates, [quality for curve in curves for quality in curve.qualities]))
    kept: list[tuple[float, float]] = []
    for point in points:
        while len(kept) > 1 and _cross(kept[-2], kept[-1], point) <= 0:
            kept.pop()
        kept.append(point)
    return Curve(name, [p[1] for p in kept], [p[0] for p in kept])


def gain_end(anchor: Curve, test: Curve) -> GainEnd:
    """Find the highest quality within the overlap at which `test` needs less rate than `anchor`."""
    a, b = _front(anchor), _front(test)
    low, high = (max(a[0, 0], b[0, 0]), min(a[-1, 0], b[-1, 0])) if len(a) and len(b) else (0.0, 0.0)
    if low >= high:
        return GainEnd()
    at = np.linspace(low, high, _GRID)
    gains = np.flatnonzero(_log_rate(b)(at) < _log_rate(a)(at))
    if len(gains) == 0:
        return GainEnd()
    end = "the codec's best point, still a gain" if b[-1, 0] <= a[-1, 0] else "the anchors' best point"
    where = "the curves cross" if gains[-1] < _GRID - 1 else end
    return GainEnd(float(at[gains[-1]]), where, len(gains) / _GRID)


def beats(test: Curve, anchor: Curve, least: float = 0.0) -> bool | None:
    """Return whether `test` needs less rate at every common quality; None where that cannot be decided.

    Where the overlap of the curves is not above `least`, their points decide: the winner has a better and cheaper point
    for each point of the other up to its own best quality.
    """
    found = bd_rate(anchor, test)
    if found.percent is not None and found.high - found.low > least:
        return gain_end(anchor, test).share == 1.0
    a, b = _front(anchor), _front(test)
    won, lost = _dominates(b, a), _dominates(a, b)
    return won if won != lost else None


def _dominates(b: Float64[np.ndarray, "N 2"], a: Float64[np.ndarray, "M 2"]) -> bool:
    """Return whether `b` has a better and cheaper point for each point of `a` up to the best of `b`, at least one."""
    reached = [point for point in a if len(b) and point[0] <= b[-1, 0]]
    return bool(reached) and all(((b[:, 0] >= quality) & (b[:, 1] < rate)).any() for quality, rate in reached)


def _front(curve: Curve) -> Float64[np.ndarray, "N 2"]:
    """Return (quality, ln rate) of the points that no other beats, both strictly ascending."""
    points = [(quality, math.log(rate)) for quality, rate in _best(curve)]
    return np.array(points, dtype=np.float64).reshape(-1, 2)


def _best(curve: Curve) -> list[tuple[float, float]]:
    """Return (quality, rate) of the points that no other beats, both strictly ascending."""
    kept: list[tuple[float, float]] = []
    for rate, quality in sorted(zip(curve.rates, curve.qualities, strict=True), key=lambda p: (p[0], -p[1])):
        if not kept or quality > kept[-1][0]:
            kept.append((float(quality), float(rate)))
    return kept


def _log_rate(points: Float64[np.ndarray, "N 2"]) -> Any:
    """Return ln rate as a function of quality."""
    from scipy.interpolate import PchipInterpolator

    return PchipInterpolator(points[:, 0], points[:, 1])


def _cross(a: tuple[float, float], b: tuple[float, float], c: tuple[float, float]) -> float:
    """Return a number above 0 where the path from a over b to c turns upward."""
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
