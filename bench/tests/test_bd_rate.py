import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from meshreel_bench.bd_rate import Curve, RateAt, bd_bound, bd_rate, beats, gain_end, hull, rate_at, reach
from scipy.interpolate import PchipInterpolator

from meshreel.errors import InputError

# The points of VCEG-M33's often reprinted example, and those in the README of FAU's `bjontegaard` package.
VCEG = (
    Curve("anchor", [686.76, 309.58, 157.11, 85.95], [40.28, 37.18, 34.24, 31.42]),
    Curve("test", [893.34, 407.8, 204.93, 112.75], [40.39, 37.21, 34.17, 31.24]),
)
X265 = (
    Curve("anchor", [9487.76, 4593.60, 2486.44, 1358.24], [40.037, 38.615, 36.845, 34.851]),
    Curve("test", [9787.80, 4469.00, 2451.52, 1356.24], [40.121, 38.651, 36.970, 34.987]),
)


@pytest.mark.parametrize(("pair", "published"), [(VCEG, 31.397374), (X265, -4.420463)])
def test_published_examples_are_met_as_far_as_cubic_and_pchip_agree(pair: tuple[Curve, Curve], published: float):
    low = max(min(c.qualities) for c in pair)
    high = min(max(c.qualities) for c in pair)
    integrals = [np.polyint(np.polyfit(c.qualities, np.log(c.rates), 3)) for c in pair]
    means = [(np.polyval(p, high) - np.polyval(p, low)) / (high - low) for p in integrals]
    assert 100 * np.expm1(means[1] - means[0]) == pytest.approx(published, abs=1e-5)
    assert bd_rate(*pair).percent == pytest.approx(published, abs=0.2)


@settings(max_examples=30)
@given(st.floats(0.1, 10), st.lists(st.floats(0.1, 3), min_size=2, max_size=6))
def test_a_constant_factor_of_rate_is_the_bd_rate(factor: float, steps: list[float]):
    qualities = list(50 + np.cumsum(steps))
    rates = list(np.exp(np.cumsum(steps)))
    result = bd_rate(Curve("a", rates, qualities), Curve("b", [factor * r for r in rates], qualities))
    assert result.percent == pytest.approx(100 * (factor - 1), rel=1e-9, abs=1e-9)


def test_only_the_overlap_counts_up_to_a_limit():
    result = bd_rate(_curve("a", [1, 2, 4, 8], [50, 53, 56, 59]), _curve("b", [1, 2, 4], [53, 56, 59]))
    assert (result.low, result.high) == (53, 59) and result.percent == pytest.approx(-50)
    anchor = Curve("a", [1, 2, 4, 8, 16], [28, 30, 32, 34, 36])
    test = Curve("t", [0.5, 1, 2, 64, 128], [28, 30, 32, 34, 36])
    assert bd_rate(anchor, test, 30).percent == pytest.approx(-50)
    assert bd_rate(anchor, test, 30).high == 30 and bd_rate(anchor, test, 99) == bd_rate(anchor, test)
    assert "no common quality below 28" in bd_rate(anchor, test, 28).reason


def test_without_common_quality_or_two_points_there_is_no_number_and_a_reason():
    result = bd_rate(_curve("a", [1, 2], [50, 53]), _curve("b", [1, 2], [60, 63]))
    assert result.percent is None
    assert "a 50 to 53" in result.reason and "b 60 to 63" in result.reason
    assert bd_rate(_curve("a", [1, 2], [50, 53]), _curve("b", [1, 2], [53, 63])).percent is None  # they touch
    assert "at least 2" in bd_rate(_curve("a", [1], [50]), _curve("b", [1, 2], [50, 53])).reason
    assert bd_rate(_curve("a", [], []), _curve("b", [1, 2], [50, 53])).percent is None


def test_a_test_whose_cheapest_point_beats_the_whole_anchor_has_a_bound():
    anchor, test = _curve("a", [1, 4], [50, 56]), _curve("b", [0.5, 2], [60, 63])
    result = bd_bound(anchor, test)
    assert result.at_most and (result.low, result.high) == (50, 56)
    assert result.percent == pytest.approx(100 * (0.5 / 2 - 1))  # 2 is the anchor's mean rate: 1 to 4, logarithmic
    worse = _curve("c", [0.5, 1, 2], [55, 60, 63])  # the same codec, had it gone lower
    assert bd_bound(anchor, worse) == bd_rate(anchor, worse) and not bd_bound(anchor, worse).at_most
    below = bd_bound(anchor, test, 53)
    assert below.high == 53 and below.percent == pytest.approx(100 * (0.5 / np.sqrt(2) - 1))
    assert bd_bound(test, anchor).percent is None  # the other way round nothing is known
    assert bd_bound(_curve("a", [1], [50]), test).percent is None


def test_points_that_another_beats_are_dropped_and_counted():
    clean = _curve("a", [1, 2, 4], [50, 53, 56])
    result = bd_rate(_curve("a", [4, 3, 1, 2, 2], [56, 52, 50, 53, 51]), _curve("b", [2, 4, 8], [50, 53, 56]))
    assert result.points == (3, 3)
    assert result.percent == pytest.approx(bd_rate(clean, _curve("b", [2, 4, 8], [50, 53, 56])).percent)
    assert result.percent == pytest.approx(100)


def test_the_hull_keeps_what_no_mixture_of_others_beats():
    found = hull("all", [_curve("a", [1, 2, 8], [50, 52, 60]), _curve("b", [2, 3, 5], [54, 54.1, 53])])
    assert (list(found.rates), list(found.qualities)) == ([1, 2, 8], [50, 54, 60])
    assert hull("none", []).rates == []


@settings(max_examples=50)
@given(st.lists(st.tuples(st.floats(0.1, 10), st.floats(40, 80)), min_size=2, max_size=20))
def test_the_hull_is_convex_and_no_point_is_under_it(points: list[tuple[float, float]]):
    found = hull("all", [_curve("a", [p[0] for p in points], [p[1] for p in points])])
    slopes = np.diff(found.rates) / np.diff(found.qualities)
    assert (np.diff(slopes) >= -1e-9).all() and (slopes > 0).all()
    for rate, quality in points:
        if found.qualities[0] <= quality <= found.qualities[-1]:
            assert rate >= np.interp(quality, found.qualities, found.rates) - 1e-9


def test_a_gain_ends_where_the_curves_cross_or_with_the_curve_that_ends_first():
    anchor = _curve("a", [1, 4], [50, 60])
    found = gain_end(anchor, _curve("b", [0.5, 8], [50, 60]))
    assert found.quality == pytest.approx(55, abs=0.01) and found.where == "the curves cross"
    short, long = gain_end(anchor, _curve("b", [0.5, 1], [50, 57])), gain_end(anchor, _curve("b", [0.5, 3], [50, 70]))
    assert (short.quality, long.quality) == (57, 60)
    assert "the codec's best point" in short.where and "the anchors' best point" in long.where
    for other in (_curve("b", [2, 8], [50, 60]), _curve("b", [1, 2], [70, 80]), _curve("b", [], [])):
        assert gain_end(anchor, other).quality is None and "no gain" in gain_end(anchor, other).where


@pytest.mark.parametrize(
    ("rates", "qualities"), [([1, 2], [3]), ([0, 1], [3, 4]), ([1, np.inf], [3, 4]), ([1, 2], [3, np.inf])]
)
def test_bad_points_are_refused(rates: list, qualities: list):
    with pytest.raises(InputError, match="curve bad"):
        _curve("bad", rates, qualities)


def _curve(name: str, rates: list, qualities: list) -> Curve:
    return Curve(name, [float(r) for r in rates], [float(q) for q in qualities])


def test_a_curve_beats_another_only_where_it_needs_less_everywhere():
    anchor = _curve("a", [1, 2, 4, 8], [50, 53, 56, 59])
    left, crossing = _curve("b", [0.5, 1, 2, 4], [50, 53, 56, 59]), _curve("c", [0.5, 1.5, 5], [50, 53, 59])
    assert beats(left, anchor) is True and beats(anchor, left) is False
    assert beats(crossing, anchor) is True and beats(_curve("d", [0.5, 3, 5], [50, 53, 59]), anchor) is False
    assert gain_end(anchor, left).share == 1 and gain_end(left, anchor).share == 0
    assert 0 < gain_end(anchor, _curve("d", [0.5, 3, 5], [50, 53, 59])).share < 1


def test_without_a_common_quality_points_that_are_better_and_cheaper_decide():
    anchor = _curve("a", [1, 2], [40, 45])
    assert beats(_curve("b", [0.5, 0.7], [50, 55]), anchor) is True
    assert beats(_curve("b", [1.5, 1.7], [50, 55]), anchor) is None  # better, and dearer than its cheapest
    assert beats(_curve("b", [3, 4], [50, 55]), anchor) is None
    assert beats(_curve("b", [0.1, 0.2], [20, 30]), anchor) is None
    assert beats(anchor, _curve("b", [0.5, 0.7], [50, 55])) is False  # each of its points is beaten


def test_an_overlap_that_is_too_small_decides_nothing_by_itself():
    flat, anchor = _curve("flat", [0.2, 0.4], [55.08, 55.09]), _curve("a", [2, 4], [50, 60])
    assert beats(flat, anchor) is True and beats(flat, anchor, least=0.5) is True  # at 50, for less
    assert beats(_curve("b", [3, 3.5], [55.08, 55.09]), _curve("a", [2, 4], [54, 60]), least=0.5) is None


def test_a_rate_at_a_quality_is_exact_where_its_logarithm_is_linear_and_at_every_point():
    doubling = Curve("x", [2.0 ** (db / 5) for db in (50, 53, 61, 64)], [50.0, 53.0, 61.0, 64.0])
    for db in (50.0, 50.1, 53.0, 57.77, 63.9, 64.0):
        found = rate_at(doubling, db)
        assert found.rate == pytest.approx(2 ** (db / 5), rel=1e-12) and not found.at_most
    for rate, db in zip(VCEG[0].rates, VCEG[0].qualities, strict=True):
        assert rate_at(VCEG[0], db).rate == pytest.approx(rate, rel=1e-12)


@pytest.mark.parametrize("pair", [VCEG, X265])
def test_bd_rates_integrate_the_curve_that_is_interpolated_by_pchip(pair: tuple[Curve, Curve]):
    low, high = max(min(c.qualities) for c in pair), min(max(c.qualities) for c in pair)
    at = np.linspace(low, high, 20_001)
    anchor, test = (PchipInterpolator(c.qualities[::-1], np.log(c.rates[::-1]))(at) for c in pair)
    some = [rate_at(pair[0], quality).rate for quality in at[::100].tolist()]
    assert some == pytest.approx(np.exp(anchor[::100]).tolist(), rel=1e-12)
    found = bd_rate(*pair)
    assert 100 * np.expm1(np.trapezoid(test - anchor, at) / (high - low)) == pytest.approx(found.percent, abs=1e-5)
    assert (found.low, found.high) == (low, high)


def test_nothing_is_extrapolated_for_a_rate():
    curve = Curve("x", [1.0, 2.0], [60.0, 65.0])
    assert rate_at(curve, 65.001) == RateAt(None)
    assert rate_at(curve, 59.999) == RateAt(1.0, at_most=True) and rate_at(curve, 60.0) == RateAt(1.0)
    point = Curve("x", [3.0], [62.0])
    assert [rate_at(point, db) for db in (61.0, 62.0, 63.0)] == [RateAt(3.0, True), RateAt(3.0), RateAt(None)]
    assert rate_at(Curve("x", [], []), 60.0) == RateAt(None) and reach(Curve("x", [], [])) is None


def test_points_that_another_beats_change_no_rate_and_no_end():
    curve = Curve("x", [1.0, 2.0, 4.0], [60.0, 65.0, 70.0])
    more = Curve("x", [4.0, 1.5, 3.0, 1.0, 9.0, 2.0, 1.0], [70.0, 59.0, 64.0, 60.0, 70.0, 65.0, 58.0])
    assert reach(more) == reach(curve) == ((60.0, 1.0), (70.0, 4.0))
    for db in (58.0, 62.0, 67.0, 71.0):
        assert rate_at(more, db) == rate_at(curve, db)
