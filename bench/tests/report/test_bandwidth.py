"""The paper's numbers and V-DMC's points beside ours, from rows that are made up."""

import msgspec
import pytest
from meshreel_bench.experiments.study import D2
from meshreel_bench.names import BEST, DRACO, FLOOR_RATIO, FOUND_NAME, VDMC, VDMC_HERE
from meshreel_bench.report.bandwidth import RAW, anchor_rows, headline_table, vdmc_table
from meshreel_bench.report.reproducing import reproducing_page
from meshreel_bench.rows import Decoding, Point, Row, Stream

from bench.tests.made_up import floor, row


def cells(lines, start):
    return next(line for line in lines if line.startswith(f"| {start}")).strip("|").split(" | ")


def test_the_rate_at_an_ssim_of_nine_tenths_is_interpolated_and_compared_with_what_is_not_compressed():
    metrics = {1: {"ssim": 0.8, "ssim_masked": 0.5}, 4: {"ssim": 1.0, "ssim_masked": 0.5}}
    best = [row("dancer", BEST, rate, 80, metrics=own) for rate, own in metrics.items()]
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
    rows = [row for row in anchor_rows() if row.point.sequence == "dancer"]
    assert {each.name for each in rows} == {VDMC, VDMC_HERE} and len(rows) == 6
    assert rows[0].mbps == pytest.approx(1.15, rel=1e-5) and rows[0].metrics == {"mpeg_d1_psnr": 70.21}
    assert {each.point.sequence for each in anchor_rows()} == {"dancer", "basketball_player", "mitch", "thomas"}


def test_best_stands_beside_each_point_of_v_dmc_at_equal_quality():
    points = (0.25, 69.85), (1.0, 73.85), (4.0, 77.85)
    best = [row("mitch", BEST, rate, 0, metrics={"mpeg_d1_psnr": db}) for rate, db in points]
    lines = list(vdmc_table(best))
    mitch = [line for line in lines if line.startswith("| mitch")]
    assert "0.811 Mbps | 71.85 dB: 0.5 Mbps (÷ 1.6)" in mitch[0]
    assert f"80.15{D2.unit}: not reached" in mitch[2] and len(lines) == 2 + len(anchor_rows())


def played(level, throttle, share, load=0.5):
    options = {"level": level, "throttle": throttle, "rate": 24}
    keys = ("decode_group_ms", "main_ms", "main_99_ms", "fps", "upload_mb_s", "triangles")
    metrics = dict.fromkeys(keys, 10.0 * throttle) | {"shown_share": share, "decode_load": load}
    point = Point("dancer", "headset", options)
    return Row(point=point, name=f"level {level}", options=options, stream=Stream(1, 1), metrics=metrics)


def test_figure_9_tells_the_strongest_throttle_below_which_all_is_held():
    rows = [played(0, 1, 1.0), played(0, 4, 0.96), played(0, 6, 0.9), played(0, 10, 1.0)]
    rows += [played(1, 1, 1.0), played(1, 4, 1.0, load=1.5), played(2, 1, 0.5), played(3, 4, 0.99), played(3, 1, 0.99)]
    page = reproducing_page({"figure6": [row("dancer", "draco", 1.0, 60)], "headset": rows})
    lines = [line for line in page if line.startswith("| dancer, ")]
    assert [line.split(" | ")[2] for line in lines] == ["4", "1", "none", "4 or more"]
    assert lines[0].split(" | ")[1:4] == ["10", "4", "10 / 40 / 60"]


def test_what_is_played_is_in_no_other_table():
    page = reproducing_page(own := {"figure6": [row("dancer", "draco", 1.0, 60)]})
    with_played = reproducing_page(own | {"headset": [played(0, 1, 1.0)]})
    assert [line for line in with_played if line not in page] == [line for line in with_played if "dancer, 0" in line]


def literal(m, mbps, db, **options):
    variant = f", {options['variant']}" if options else ""
    made = row("dancer", f"meshreel paper-literal{variant} m", mbps, db)
    return msgspec.structs.replace(
        made, options={"preset": "paper-literal", "quality": 50.0, "basis_size": m} | options
    )


def test_beside_the_released_code_stands_the_paper_as_written_with_more_centers_only_where_the_usual_are_short():
    finest = {"centers": 4000, "variant": "the release's step"}
    rows = [
        literal(3, 0.5, 52.0),
        literal(10, 1.0, 57.0),
        literal(10, 2.0, 58.0, **finest),
        literal(30, 6.0, 59.5, **finest),
    ]
    page = reproducing_page({"figure6": [row("dancer", "draco", 1.0, 60)], "ablation_paper": rows})
    shown = [line.split(" | ")[2] for line in page if line.startswith("| dancer | m = ")]
    assert [cell.partition("(")[2] for cell in shown] == [
        "m 3)",
        "m 10)",
        "m 10)",
        "m 30, 4000 centers, the release's step)",
    ]
    short = reproducing_page({"figure6": [row("dancer", "draco", 1.0, 60)], "ablation_paper": rows[:2]})
    shown = [line.split(" | ")[2] for line in short if line.startswith("| dancer | m = ")]
    assert [cell.endswith("†") for cell in shown] == [False, False, False, True]
