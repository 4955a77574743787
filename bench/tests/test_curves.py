"""Curves from rows: the anchors' hull, what is compared with it, and targets of several parts."""

from __future__ import annotations

import pytest
from meshreel_bench.bounds import Bound, bounds_text, judge
from meshreel_bench.curves import (
    NORMALS,
    SSIM,
    SYMMETRIC,
    against_hull,
    anchor_hull,
    hull_lines,
    on_hull,
    repeated,
    value,
)

SUBDIVIDED = "decimated_draco_subdivided"


def row(codec, mbps, db, **changed):
    angle = 90 - db
    frames = [{"ssim_masked": db / 100, "normal_error_deg": angle}] * 2
    groups = [{"first_frame": 0, "frames": 2, "bytes": 5}]
    base = {"codec": codec, "mbps": mbps, "symmetric_psnr": db, "normal_error_deg": angle, "d2_psnr_paper": db}
    return base | {"options": {"quality": 50.0}, "per_frame": frames, "groups": groups} | changed


ANCHORS = [row(SUBDIVIDED, 1.0, 60.0), row("decimated_draco", 2.0, 66.0), row("draco", 4.0, 72.0)]


def test_the_hull_takes_the_best_of_every_anchor():
    worse = [row("draco", 3.9, 61.0), row("decimated_draco", 2.5, 66.0)]
    points = anchor_hull([*ANCHORS, *worse], SYMMETRIC)
    assert list(zip(points.rates, points.qualities, strict=True)) == [(1.0, 60.0), (2.0, 66.0), (4.0, 72.0)]
    assert on_hull([*ANCHORS, *worse, row("own", 0.1, 80.0)]) == ANCHORS


def test_half_the_rate_of_the_hull_is_half_by_every_measure():
    own = [row("own", r["mbps"] / 2, r["symmetric_psnr"]) for r in ANCHORS]
    for measure in (SYMMETRIC, NORMALS, SSIM):
        found = against_hull([*ANCHORS, *own], "own", measure)
        assert found.rate.percent == pytest.approx(-50)
        assert not found.end.reached
    told = list(hull_lines([*ANCHORS, *own]))
    assert len(told) == 4 and all("own against the hull of the anchors" in line for line in told)
    assert "normal error -50.0 % (30 degrees to 18 degrees, gain up to 18 degrees" in told[2]


def test_a_curve_that_crosses_says_where():
    own = [row("own", 0.5, 60.0), row("own", 2.0, 66.0), row("own", 8.0, 72.0)]
    found = against_hull([*ANCHORS, *own], "own", SYMMETRIC)
    assert found.end.reached and found.end.quality == pytest.approx(66, abs=0.02)
    assert "the curves cross" in str(found)


def test_without_points_there_is_a_reason_instead_of_a_number():
    assert "no BD-rate" in str(against_hull(ANCHORS, "own", SYMMETRIC))


def test_ssim_without_keys_is_made_of_frames_and_groups():
    frames = [{"ssim_masked": 0.9}, {"ssim_masked": 0.7}]
    assert value(row("own", 1, 60, per_frame=frames), "ssim_masked_without_keys") == pytest.approx(0.7)
    assert value({"mbps": 1.0}, "ssim_masked_without_keys") is None and value({"mbps": 1.0}, "mbps") == 1


BOUNDS = (Bound("mbps", 0.34, "Mbps", least=False), Bound("d2_psnr_paper", 64.0, "dB"))


def test_points_of_a_curve_that_are_the_same_are_counted():
    curve = [row("tvmc", 1.0, 60.0, options={"qp": qp}) for qp in (5, 7)] + [row("tvmc", 2.0, 60.0)]
    assert repeated([*curve, *ANCHORS, row("other", 1.0, 60.0)]) == {"tvmc": (2, 3)}
    assert repeated([*ANCHORS, row("draco", 4.0, 71.0), row("draco", 4.1, 72.0)]) == {}


def test_the_cheapest_point_that_keeps_all_bounds_is_told():
    rows = [row("own", 0.33, 65.0), row("own", 0.3, 64.0, options={"quality": 40.0}), row("own", 0.1, 60.0)]
    assert judge(rows, BOUNDS) == ("0.300 Mbps, 64.00 dB at quality 40", True)
    assert bounds_text(BOUNDS) == "<= 0.340 Mbps, >= 64.00 dB"


def test_else_the_nearest_with_what_it_lacks():
    rows = [row("own", 0.35, 65.0), row("own", 0.1, 50.0)]
    assert judge(rows, BOUNDS) == ("0.350 Mbps (short), 65.00 dB at quality 50", False)
    assert judge([row("own", 0.3, 60, d2_psnr_paper=None)], BOUNDS) == (
        "0.300 Mbps, no d2_psnr_paper (short) at quality 50",
        False,
    )
