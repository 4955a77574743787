"""Headline measures of the paper and V-DMC's points, from rows that are made up."""

from __future__ import annotations

import msgspec
import pytest
from meshreel_bench.experiments.study import D2
from meshreel_bench.names import BEST, DRACO, FLOOR_RATIO, FOUND_NAME, VDMC, VDMC_HERE
from meshreel_bench.report.bandwidth import RAW, anchor_rows, headline_table, vdmc_table
from meshreel_bench.rows import Decoding

from bench.tests.made_up import floor, row


def cells(lines, start):
    return next(line for line in lines if line.startswith(f"| {start}")).strip("|").split(" | ")


def test_the_rate_at_an_ssim_of_nine_tenths_is_interpolated_and_compared_with_what_is_not_compressed():
    best = [
        row("dancer", BEST, rate, 80, metrics={"ssim": ssim, "ssim_masked": 0.5}) for rate, ssim in ((1, 0.8), (4, 1.0))
    ]
    draco = row("dancer", DRACO, 8.0, 90, metrics={"ssim": 0.95}, decoding=Decoding(1.0, 1.0, 20_000.0))
    lines = list(headline_table([*best, draco]))
    raw = 8 * RAW * 20_000 * 30 / 1e6
    assert cells(lines, "meshreel best, SSIM 0.9")[1].strip() == f"2 Mbps (1/{raw / 2:.0f})"
    assert cells(lines, "meshreel best, masked SSIM 0.9")[1].strip() == "up to 0.500 at 1 Mbps"
    assert cells(lines, "Draco, SSIM 0.9")[1].strip() == f"≤ 8 Mbps (1/{raw / 8:.0f})"
    assert cells(lines, "TVMC*, SSIM 0.9")[1].strip() == "not measured"


def test_the_dynamic_ratio_is_that_of_the_truth_and_everything_without_a_background():
    scene = row("room", BEST, 1.0, 60)
    scene = msgspec.structs.replace(scene, stream=msgspec.structs.replace(scene.stream, background_bytes=100))
    other = msgspec.structs.replace(scene, point=msgspec.structs.replace(scene.point, sequence="real"))
    lines = list(headline_table([row("ball", BEST, 1.0, 60), scene, floor("room", **{FLOOR_RATIO: 0.125}), other]))
    assert [cell.strip() for cell in cells(lines, "dynamic ratio")[1:]] == ["100 %", "12.5 %", "not known"]
    found = msgspec.structs.replace(floor("real", **{FLOOR_RATIO: 0.25}), name=FOUND_NAME)
    assert cells(list(headline_table([other, found])), "dynamic ratio")[1].strip() == "25.0 % (as found)"


def test_points_of_v_dmc_are_rows_whose_rate_is_the_published_one():
    rows = anchor_rows("dancer")
    assert {each.name for each in rows} == {VDMC, VDMC_HERE} and len(rows) == 6
    assert rows[0].mbps == pytest.approx(1.15, rel=1e-5) and rows[0].metrics == {"mpeg_d1_psnr": 70.21}
    assert {each.point.sequence for each in anchor_rows()} == {"dancer", "basketball_player", "mitch"}


def test_best_stands_beside_each_point_of_v_dmc_at_equal_quality():
    points = (0.25, 69.85), (1.0, 73.85), (4.0, 77.85)
    best = [row("mitch", BEST, rate, 0, metrics={"mpeg_d1_psnr": db}) for rate, db in points]
    lines = list(vdmc_table(best))
    mitch = [line for line in lines if line.startswith("| mitch")]
    assert "0.811 Mbps | 71.85 dB: 0.5 Mbps (÷ 1.6)" in mitch[0]
    assert f"80.15{D2.unit}: not reached" in mitch[2] and len(lines) == 2 + len(anchor_rows())
