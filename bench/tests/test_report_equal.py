"""Rates at equal quality: on curves whose answer is known, on what does not overlap, and which qualities are chosen."""

from __future__ import annotations

import math

import pytest
from meshreel_bench.curves import NORMALS, Measure
from meshreel_bench.names import BEST
from meshreel_bench.report.equal import common, rate_table
from meshreel_bench.study import D2, MASKED, Study

from bench.tests.report_rows import row

DB = Measure("d2_psnr_paper", "D2", " dB", least=0.5)


def curve(codec, rates, qualities, **changed):
    return [row("body", codec, mbps, db, **changed) for mbps, db in zip(rates, qualities, strict=True)]


def doubling(codec, at_60, start, end, step=1.0):
    """A curve whose rate doubles every 5 dB: at 60 dB it is given."""
    qualities = [start + step * k for k in range(round((end - start) / step) + 1)]
    return curve(codec, [at_60 * 2 ** ((db - 60) / 5) for db in qualities], qualities)


def told(rows, measures=(DB,), best=BEST):
    """Heads without arrows, cells by codec, the note."""
    lines = rate_table(rows, best, measures)
    cells = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines if line.startswith("|")]
    heads = [head.removesuffix(" ↓") for head in cells[0][1:]]
    return heads, {name: found for name, *found in cells[2:]}, " ".join(lines[len(cells) + 1 :])


def test_a_rate_is_that_of_the_curve_at_the_quality():
    rows = [*doubling(BEST, 1.0, 57.0, 64.0, 3.5), *doubling("draco", 3.0, 58.5, 63.5, 2.5)]
    heads, cells, _ = told(rows)
    assert heads == ["Mbps at 60 dB (D2)", "Mbps at 62 dB (D2)"]
    assert cells == {BEST: ["**1**", f"**{2**0.4:.4g}**"], "draco": ["*3* (×3)", f"*{3 * 2**0.4:.4g}* (×3)"]}


def test_qualities_of_which_less_is_better_are_ranked_the_same_way():
    rows = [*doubling(BEST, 1.0, 55.0, 65.0, 5.0), *doubling("draco", 2.0, 55.0, 65.0, 5.0)]  # 7 to 5 degrees
    heads, cells, _ = told(rows, (NORMALS,))
    assert heads == ["Mbps at 5 degrees (normal error)"]
    assert cells == {BEST: ["**2**"], "draco": ["*4* (×2)"]}


def test_what_is_not_reached_is_a_dash_with_the_best_point_and_has_no_rank():
    rows = [
        *doubling(BEST, 1.0, 57.0, 64.0),
        *doubling("draco", 3.0, 57.0, 64.0),
        *doubling("klt_tsdf", 0.5, 45.0, 55.0),
    ]
    _, cells, note = told(rows)
    assert cells["klt_tsdf"][0] == "- (up to 55 dB at 0.25)" and "-: even its best point" in note and "≤" not in note
    assert cells[BEST][0] == "**1**" and cells["draco"][0] == "*3* (×3)"


def test_a_curve_that_begins_above_the_quality_needs_at_most_its_cheapest_rate():
    rows = [*doubling(BEST, 1.0, 57.0, 60.0), *doubling("draco", 3.0, 57.0, 60.0), *doubling("tvmc", 1.0, 65.0, 70.0)]
    heads, cells, note = told(rows)
    assert heads == ["Mbps at 60 dB (D2)"] and cells["tvmc"] == ["≤ *2* (×2)"] and cells["draco"] == ["3 (×3)"]
    assert "≤: that of its cheapest point, which is better still." in note and "-: " not in note


def test_curves_that_do_not_overlap_are_told_by_their_ends():
    _, cells, _ = told([*doubling(BEST, 1.0, 60.0, 65.0), *doubling("klt_tsdf", 1.0, 40.0, 45.0)])
    assert cells == {BEST: ["1"], "klt_tsdf": ["- (up to 45 dB at 0.125)"]}  # one number has no rank
    _, cells, _ = told([*doubling(BEST, 1.0, 60.0, 65.0), *doubling("tvmc", 1.0, 70.0, 75.0)])
    assert cells == {BEST: ["**1**"], "tvmc": ["≤ *4* (×4)"]}


@pytest.mark.parametrize(
    ("db", "at", "cell"),
    [
        (60.0, "60", "*3* (×3)"),
        (58.5, "58.5", f"*3* (×{3 * 2**0.3:.3g})"),
        (56.9, "60", "- (up to 56.9 dB at 3)"),
        (60.1, "60", "≤ *3* (×3)"),
    ],
)
def test_a_single_point_is_known_at_its_own_quality_only(db, at, cell):
    heads, cells, _ = told([*doubling(BEST, 1.0, 57.0, 60.0), *curve("necgs", [3.0], [db])])
    assert heads == [f"Mbps at {at} dB (D2)"] and cells["necgs"] == [cell]


def test_single_points_alone_are_compared_at_that_of_the_best():
    heads, cells, note = told(
        [*curve(BEST, [1.0], [61.234]), *curve("draco", [3.0], [70.0]), *curve("tvmc", [0.5], [50.0])]
    )
    assert heads == ["Mbps at 61.234 dB (D2)"] and "hardly" not in note
    assert cells == {BEST: ["**1**"], "draco": ["≤ *3* (×3)"], "tvmc": ["- (up to 50 dB at 0.5)"]}


def test_points_that_another_one_beats_count_for_nothing():
    clean = doubling("draco", 3.0, 57.0, 64.0)
    worse = curve("draco", [3.1, 40.0, 2.9], [58.0, 63.9, 57.2])
    best = doubling(BEST, 1.0, 57.0, 64.0)
    assert rate_table([*best, *clean], BEST, (DB,)) == rate_table([*best, *worse, *clean], BEST, (DB,))
    falling = curve("klt_tsdf", [1.0, 2.0, 3.0], [62.0, 61.0, 60.0])  # its first point is its curve
    heads, cells, _ = told([*best, *clean, *falling])
    assert heads[0] == "Mbps at 62 dB (D2)" and cells["klt_tsdf"][0] == f"**1** (×{2**-0.4:.3g})"


def test_a_curve_along_which_quality_hardly_changes_is_told():
    rows = [*curve(BEST, [0.25, 0.5], [60.0, 60.25]), *doubling("draco", 3.0, 57.0, 64.0)]
    heads, cells, note = told(rows)
    assert heads == ["Mbps at 60 dB (D2)"] and cells[BEST] == ["**0.25**"]
    assert "of meshreel best quality hardly changes (60 dB to 60.25 dB, D2): any of its rates, 0.25 to 0.5," in note
    assert "hardly" not in told([*curve(BEST, [0.25, 0.5], [60.0, 60.5]), *doubling("draco", 3.0, 57.0, 64.0)])[2]


def test_without_the_best_there_are_no_ratios_and_with_one_codec_no_table():
    rows = [*doubling("draco", 1.0, 57.0, 64.0), *doubling("tvmc", 3.0, 57.0, 64.0)]
    heads, cells, note = told(rows)
    assert heads == ["Mbps at 60 dB (D2)", "Mbps at 64 dB (D2)"] and BEST not in note
    assert cells == {"tvmc": ["*3*", f"*{3 * 2**0.8:.4g}*"], "draco": ["**1**", f"**{2**0.8:.4g}**"]}
    assert rate_table(doubling(BEST, 1.0, 57.0, 64.0), BEST, (DB,)) == []
    assert rate_table(rows, BEST, (Measure("not_measured", "none", ""),)) == []


def test_a_codec_without_the_measure_is_an_empty_cell_and_names_are_text():
    rows = [*doubling(BEST, 1.0, 57.0, 64.0), *doubling("a_b|c", 3.0, 57.0, 64.0), *curve("tvmc", [1.0], [60.0])]
    rows[-1] |= {"d2_psnr_paper": None}
    lines = rate_table(rows, BEST, (DB,))
    assert "| tvmc |  |  |" in lines and any(line.startswith("| a_b\\|c | *3* ") for line in lines)


@pytest.mark.parametrize(
    ("ranges", "within", "found"),
    [
        ([(61.6, 72.9), (56.6, 65.3), (60.9, 69.1), (46.0, 59.0), (51.0, 73.7), (60.0, 78.0)], (61.6, 72.9), [65, 70]),
        ([(0.712, 0.902), (0.681, 0.766), (0.68, 0.794), (0.41, 0.93)], (0.712, 0.902), [0.75, 0.8]),
        ([(60.0, 70.0), (61.0, 63.0), (66.0, 68.0)], None, [68]),  # as many twice: the higher
        ([(60.0, 70.0), (61.0, 63.0), (66.0, 68.0)], (60.0, 64.0), [62, 63]),
        ([(53.196, 53.209), (45.0, 58.0), (52.0, 75.0), (44.0, 44.0), (53.23, 53.23)], (53.196, 53.209), [53.2]),
        ([(12.34, 12.34), (50.0, 60.0)], (12.34, 12.34), [12.34]),
        ([(-7.0, -4.0), (-6.0, -3.0)], (-7.0, -4.0), [-5, -4]),
        ([(-1.0, 3.0), (-2.0, 4.0)], None, [0, 2]),
        ([(120.0, 480.0), (90.0, 350.0)], (120.0, 480.0), [200, 300]),
        ([(0.0, 0.0), (0.0, 0.0)], None, [0.0]),
        ([(60.0, 62.0), (60.0, 70.0), (60.0, 70.0), (65.0, 65.0)], None, [65, 70]),
    ],
)
def test_the_qualities_are_the_roundest_that_most_reach(ranges, within, found):
    assert common(ranges, within, 0.01) == found
    assert common(ranges[::-1], within, 0.01) == found


def test_all_qualities_are_reached_by_the_best_and_no_other_is_reached_by_more():
    ranges = [(50.0 + 1.37 * k, 58.0 + 0.73 * k * k) for k in range(7)]
    for within in ranges:
        chosen = common(ranges, within, 0.5)
        counts = [sum(low <= quality <= high for low, high in ranges) for quality in chosen]
        grid = [within[0] + (within[1] - within[0]) * k / 1000 for k in range(1001)]
        assert counts[0] == max(sum(low <= quality <= high for low, high in ranges) for quality in grid)
        assert all(within[0] <= quality <= within[1] for quality in chosen) and chosen == sorted(set(chosen))
        assert all(2 * count >= len(ranges) for count in counts[1:]) and len(chosen) <= 2


def test_a_study_with_a_best_has_the_table_before_the_bd_rates():
    rows = [*doubling(BEST, 1.0, 57.0, 64.0), *doubling("draco", 3.0, 57.0, 64.0)]
    lines = list(Study(sequences=("body",), sweeps=(), best=BEST).comparisons(rows))
    heads = [line for line in lines if line.startswith(("| codec |", f"| {BEST} against"))]
    assert [head.split("|")[1].strip() for head in heads] == ["codec", f"{BEST} against"]
    assert f"({D2.name})" in heads[0] and f"({MASKED.name})" in heads[0]
    assert math.isclose(float(next(line for line in lines if line.startswith("| draco")).split("*")[1]), 3.0)
    assert not any("×" in line for line in Study(sequences=("body",), sweeps=(), anchor=BEST).comparisons(rows))
