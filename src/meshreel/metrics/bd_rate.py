"""Bjontegaard delta rate: how much more or less rate a codec needs than a named anchor for the same quality, in %.

Rate-distortion points of both -> BdRate. log rate is interpolated over quality by PCHIP and averaged over the range
of quality that both curves reach (Bjontegaard, VCEG-M33; PCHIP as in the JCT-VC common test conditions, JCTVC-L1100).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from ..errors import InputError


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

    def __str__(self) -> str:
        if self.percent is None:
            return f"{self.test} against {self.anchor}: no BD-rate ({self.reason})"
        return f"{self.test} against {self.anchor}: {self.percent:+.1f} % over {self.low:.4g} to {self.high:.4g}"


def bd_rate(anchor: Curve, test: Curve) -> BdRate:
    """The mean change of rate at equal quality, over the overlap only; nothing is extrapolated.

    A point that costs no less than another and is no better is dropped: quality must grow with rate.
    """
    a, b = _front(anchor), _front(test)
    counts = (len(a), len(b))
    for curve, points in ((anchor, a), (test, b)):
        if len(points) < 2:
            reason = f"{curve.name} has {len(points)} usable points; at least 2 are needed"
            return BdRate(anchor.name, test.name, None, math.nan, math.nan, counts, reason)
    low, high = float(max(a[0, 0], b[0, 0])), float(min(a[-1, 0], b[-1, 0]))
    if low >= high:
        reason = f"no common quality: {_range(anchor.name, a)}, {_range(test.name, b)}"
        return BdRate(anchor.name, test.name, None, low, high, counts, reason)
    mean = (_integral(b, low, high) - _integral(a, low, high)) / (high - low)
    return BdRate(anchor.name, test.name, 100 * math.expm1(mean), low, high, counts)


def _front(curve: Curve) -> Float64[np.ndarray, "N 2"]:
    """(quality, ln rate) of the points that no other beats, both strictly growing."""
    kept: list[tuple[float, float]] = []
    for rate, quality in sorted(zip(curve.rates, curve.qualities, strict=True), key=lambda p: (p[0], -p[1])):
        if not kept or quality > kept[-1][0]:
            kept.append((float(quality), math.log(rate)))
    return np.array(kept, dtype=np.float64).reshape(-1, 2)


def _integral(points: Float64[np.ndarray, "N 2"], low: float, high: float) -> float:
    from scipy.interpolate import PchipInterpolator

    return float(PchipInterpolator(points[:, 0], points[:, 1]).integrate(low, high))


def _range(name: str, points: Float64[np.ndarray, "N 2"]) -> str:
    return f"{name} {points[0, 0]:.4g} to {points[-1, 0]:.4g}"
