"""Bjontegaard delta rate: how much more or less rate a codec needs than a named anchor for the same quality, in %.

Rate-distortion points of both -> BdRate. log rate is interpolated over quality by PCHIP and averaged over the range
of quality that both curves reach (Bjontegaard, VCEG-M33; PCHIP as in the JCT-VC common test conditions, JCTVC-L1100).
Several anchors are one by their hull. Where a gain ends is told too: a mean hides a curve that crosses.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from ..errors import InputError

_GRID = 2001  # qualities at which two curves are compared


@dataclass(frozen=True, slots=True)
class Curve:
    """Rate-distortion points of one codec; larger quality is better (give an error as its negative)."""

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
    """The answer, or why there is none."""

    anchor: str
    test: str
    percent: float | None  # mean change of rate against the anchor; negative is a saving
    low: float  # quality range that both curves reach
    high: float
    points: tuple[int, int]  # used of anchor and test, after dropping points that another one beats
    reason: str = ""  # why `percent` is None
    at_most: bool = False  # `percent` is a bound: the cheapest point of the test is better than all of the anchor

    def __str__(self) -> str:
        if self.percent is None:
            return f"{self.test} against {self.anchor}: no BD-rate ({self.reason})"
        told = f"{self.percent:+.1f} % over {self.low:.4g} to {self.high:.4g}"
        bound = f"{told}, at most: its cheapest point is better than all of the other's" if self.at_most else told
        return f"{self.test} against {self.anchor}: {bound}"


def bd_rate(anchor: Curve, test: Curve, highest: float = math.inf) -> BdRate:
    """The mean change of rate at equal quality, over the overlap only, up to `highest`; nothing is extrapolated.

    A point that costs no less than another and is no better is dropped: quality must grow with rate.
    """
    a, b = _front(anchor), _front(test)
    counts = (len(a), len(b))
    for curve, points in ((anchor, a), (test, b)):
        if len(points) < 2:
            reason = f"{curve.name} has {len(points)} usable points; at least 2 are needed"
            return BdRate(anchor.name, test.name, None, math.nan, math.nan, counts, reason)
    low, high = float(max(a[0, 0], b[0, 0])), float(min(a[-1, 0], b[-1, 0], highest))
    if low >= high:
        below = "" if math.isinf(highest) else f" below {highest:.4g}"
        reason = f"no common quality{below}: {_range(anchor.name, a)}, {_range(test.name, b)}"
        return BdRate(anchor.name, test.name, None, low, high, counts, reason)
    mean = (_integral(b, low, high) - _integral(a, low, high)) / (high - low)
    return BdRate(anchor.name, test.name, 100 * math.expm1(mean), low, high, counts)


def bd_bound(anchor: Curve, test: Curve, highest: float = math.inf) -> BdRate:
    """As `bd_rate`; where the test's cheapest point is better than all of the anchor up to `highest`, a bound of it.

    That point's rate is compared with those of all of the anchor: who made it worse still would need no more.
    """
    found = bd_rate(anchor, test, highest)
    a, b = _front(anchor), _front(test)
    if found.percent is not None or len(a) < 2 or not len(b):
        return found
    low, high = float(a[0, 0]), float(min(a[-1, 0], highest))
    if not low < high <= b[0, 0]:
        return found
    mean = float(b[0, 1]) - _integral(a, low, high) / (high - low)
    return BdRate(anchor.name, test.name, 100 * math.expm1(mean), low, high, found.points, at_most=True)


@dataclass(frozen=True, slots=True)
class RateAt:
    """The rate that a curve needs for a quality."""

    rate: float | None  # None: none of its points is as good
    at_most: bool = False  # `rate` is that of its cheapest point, which is better still


def rate_at(curve: Curve, quality: float) -> RateAt:
    """The rate for a quality, interpolated as for `bd_rate`; nothing is extrapolated."""
    ends = reach(curve)
    if ends is None or quality > ends[1][0]:
        return RateAt(None)
    if quality <= ends[0][0]:
        return RateAt(ends[0][1], at_most=quality < ends[0][0])
    return RateAt(math.exp(_log_rate(_front(curve), np.array([quality]))[0]))


def reach(curve: Curve) -> tuple[tuple[float, float], tuple[float, float]] | None:
    """(quality, rate) of the worst and of the best of the points that no other beats; None where there are none."""
    points = _best(curve)
    return (points[0], points[-1]) if points else None


@dataclass(frozen=True, slots=True)
class GainEnd:
    """Up to which quality a codec needs less rate than its anchor, going down from the best that both reach."""

    quality: float | None  # where the curves cross; None: there is no gain at all, or no overlap
    reached: bool  # False: at the end of the overlap the gain goes on, and `quality` is that end
    anchor_best: float  # best quality of the anchor; over it there is nothing to gain against
    test_best: float
    share: float = 0.0  # of the overlap, in quality, where there is a gain

    @property
    def where(self) -> str:
        """In words, without a number: what ends there."""
        if self.quality is None:
            return "no gain at any common quality"
        if self.reached:
            return "the curves cross"
        return (
            "the codec's best point, still a gain" if self.test_best <= self.anchor_best else "the anchors' best point"
        )


def hull(name: str, curves: Sequence[Curve]) -> Curve:
    """All curves' points on their lower convex hull in (quality, rate): the strongest anchor they make.

    Not in (quality, ln rate): there curves of dB bend the other way, and a chord from the first point to the last would
    be far under all that any of the codecs reaches.
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
    """The highest quality, within the overlap, at which `test` still needs less rate than `anchor`."""
    a, b = _front(anchor), _front(test)
    best = [float(points[-1, 0]) if len(points) else math.nan for points in (a, b)]
    low, high = (max(a[0, 0], b[0, 0]), min(best)) if len(a) and len(b) else (0.0, 0.0)
    if low >= high:
        return GainEnd(None, False, *best)
    at = np.linspace(low, high, _GRID)
    gains = np.flatnonzero(_log_rate(b, at) < _log_rate(a, at))
    if len(gains) == 0:
        return GainEnd(None, False, *best)
    return GainEnd(float(at[gains[-1]]), bool(gains[-1] < _GRID - 1), best[0], best[1], len(gains) / _GRID)


def beats(test: Curve, anchor: Curve, least: float = 0.0) -> bool | None:
    """Whether `test` needs less rate wherever both reach a quality; None where nothing decides.

    Where their overlap is not above `least`, points decide: whose are better and cheaper than all that the other has in
    its reach.
    """
    if have_range(test, anchor, least):
        return gain_end(anchor, test).share == 1.0
    a, b = _front(anchor), _front(test)
    won, lost = _dominates(b, a), _dominates(a, b)
    return won if won != lost else None


def have_range(test: Curve, anchor: Curve, least: float = 0.0) -> bool:
    """Whether two curves have a BD-rate over a range of qualities above `least`."""
    found = bd_rate(anchor, test)
    return found.percent is not None and found.high - found.low > least


def _dominates(b: Float64[np.ndarray, "N 2"], a: Float64[np.ndarray, "M 2"]) -> bool:
    """Whether each point of `a` up to the best of `b`, at least one, has one of `b` that is better and cheaper."""
    reached = [point for point in a if len(b) and point[0] <= b[-1, 0]]
    return bool(reached) and all(((b[:, 0] >= quality) & (b[:, 1] < rate)).any() for quality, rate in reached)


def _front(curve: Curve) -> Float64[np.ndarray, "N 2"]:
    """(quality, ln rate) of the points that no other beats, both strictly growing."""
    points = [(quality, math.log(rate)) for quality, rate in _best(curve)]
    return np.array(points, dtype=np.float64).reshape(-1, 2)


def _best(curve: Curve) -> list[tuple[float, float]]:
    """(quality, rate) of the points that no other beats, both strictly growing."""
    kept: list[tuple[float, float]] = []
    for rate, quality in sorted(zip(curve.rates, curve.qualities, strict=True), key=lambda p: (p[0], -p[1])):
        if not kept or quality > kept[-1][0]:
            kept.append((float(quality), float(rate)))
    return kept


def _integral(points: Float64[np.ndarray, "N 2"], low: float, high: float) -> float:
    from scipy.interpolate import PchipInterpolator

    return float(PchipInterpolator(points[:, 0], points[:, 1]).integrate(low, high))


def _log_rate(points: Float64[np.ndarray, "N 2"], at: Float64[np.ndarray, " Q"]) -> Float64[np.ndarray, " Q"]:
    from scipy.interpolate import PchipInterpolator

    return np.asarray(PchipInterpolator(points[:, 0], points[:, 1])(at), dtype=np.float64)


def _cross(a: tuple[float, float], b: tuple[float, float], c: tuple[float, float]) -> float:
    """Over 0 where the way from a over b to c turns upwards."""
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


def _range(name: str, points: Float64[np.ndarray, "N 2"]) -> str:
    return f"{name} {points[0, 0]:.4g} to {points[-1, 0]:.4g}"
