"""Tables: ranks, rates at equal quality, BD-rates, and that rows are text and never markup."""

import msgspec
from meshreel_bench import names
from meshreel_bench.experiments.study import D2, MASKED, NORMALS
from meshreel_bench.report import tables
from meshreel_bench.report.comparison import beyond_table, losses, rate_ratio, rate_table, winners_table
from meshreel_bench.report.tables import bd_table, maker_table, markdown, point_table, text
from meshreel_bench.rows import Maker

from bench.tests.made_up import failed, floor, row

BEST = [row("ball", "best", rate, 60 + 5 * rate) for rate in (0.5, 1.0, 2.0)]
DRACO = [row("ball", "draco", rate, 50 + 4 * rate) for rate in (2.0, 4.0, 8.0)]
ROWS = [*DRACO, *BEST]


def test_text_is_no_markup_and_columns_of_which_nothing_is_known_are_left_out():
    assert text("a|b <script> _x_ &amp; `c`\nd") == r"a\|b \<script> \_x\_ \&amp; \`c\` d"
    assert text("decimated_draco") == "decimated_draco"
    table = [{"a": "x", "b": None, "c": 0.123456}, {"a": "y", "b": None, "c": float("nan")}]
    assert markdown(table) == ["| a | c |", "|---|---|", "| x | 0.1235 |", "| y |  |"]


def test_points_are_listed_curve_by_curve_from_the_lowest_rate_on_and_say_which_frames_they_have():
    lines = point_table(ROWS, (D2, NORMALS))
    assert [line.split(" | ")[0] for line in lines[2:]] == ["| draco"] * 3 + ["| best"] * 3
    assert lines[5].startswith("| best | quality 0.5 | 0.5 | 62.5 | 5.5 | 61.5 | 10 | 7 | code 7 | 1.5 |")
    some = msgspec.structs.replace(BEST[0], stream=msgspec.structs.replace(BEST[0].stream, coded_frames=5))
    assert "5 of 10 frames coded" in point_table([some], (D2,))[2]


def test_bd_rates_have_their_range_or_the_reason_why_there_is_none():
    best = bd_table(ROWS, "best", (D2,))
    assert best[0] == "| best against | rate at equal D2, paper form ↓ |" and best[2].startswith("| draco | -")
    anchored = bd_table(ROWS, "best", (D2,), is_anchor=True)
    assert anchored[0].startswith("| against best") and anchored[2].startswith("| draco | +")
    assert "less than two usable points of draco" in bd_table([*BEST, DRACO[0]], "best", (D2,))[2]
    worse = [row("ball", "worse", rate, 50 + rate) for rate in (1.0, 2.0)]
    assert "no overlap" in bd_table([*BEST, *worse], "best", (D2,))[2]
    assert bd_table(BEST, "best", (D2,)) == []


def test_a_summary_has_a_column_for_every_sequence():
    cubes = [row("cube", "best", rate, 60 + 5 * rate) for rate in (0.5, 1.0)]
    lines = tables.summary_table([*cubes, *ROWS], "best", D2)
    assert lines[0].endswith("| ball |") and len(lines) == 3
    tvmc = [row("cube", "tvmc", rate, 59 + 5 * rate) for rate in (0.5, 1.0)]
    lines = tables.summary_table([*cubes, *tvmc, *ROWS], "best", D2)
    assert lines[0].endswith("| cube | ball |") and lines[2].startswith("| tvmc | -") and lines[2].endswith("|  |")


def test_rates_at_equal_quality_are_told_in_times_of_the_best():
    lines = rate_table(ROWS, "best", (D2, MASKED))
    assert lines[0].startswith("| codec | Mbps at 65 dB (D2, paper form) ↓ |")
    assert lines[3].startswith("| best | 1 |") and "(×" in lines[2]
    assert rate_ratio(ROWS, "draco", "best", D2) > 3 and rate_table(DRACO, "best", (D2,)) == []
    worse = [row("ball", "worse", rate, 50 + rate) for rate in (1.0, 2.0)]
    assert "- (up to 52 dB at 2)" in rate_table([*BEST, *worse], "best", (D2,))[3]


def test_failures_floors_and_makers_are_listed():
    line = tables.failure_table([failed("ball", "draco", "crash | boom")])[2]
    assert line == r"| ball | draco | qp 9 | crash \| boom |"
    assert "iou_mean 0.9" in tables.value_table([floor("room", iou_mean=0.9)])[2] and tables.value_table([]) == []
    made = [msgspec.structs.replace(each, made_by=Maker("0.1.0", "abc")) for each in BEST]
    lines = maker_table([*made, *DRACO])
    assert len(lines) == 4 and any("| 0.1.0 | abc |" in line and line.endswith("| 3 |") for line in lines)


def test_the_first_page_says_who_needs_how_many_bytes_and_where_others_win():
    best = [row(name, names.BEST, rate, 60 + 5 * rate) for name in ("ball", "cube") for rate in (0.5, 1.0, 2.0)]
    draco = [row("ball", names.DRACO, rate, 50 + 4 * rate) for rate in (2.0, 4.0, 8.0)]
    cheap = [row("cube", names.DRACO, rate, 70 + rate) for rate in (0.25, 0.5)]
    assert winners_table([*best, *draco], []) == []  # a codec on one of two sequences is a variant
    [line] = winners_table([*best, *draco, *cheap], [])[2:]
    assert line.startswith("| Draco | **3.") and "(1 of 2)" in line and len(line.split(" | ")) == 3
    assert list(losses([*best, *draco], [])) == [] and winners_table(draco, []) == []
    loss = "- cube: Draco needs at most 0.25 times its bytes at equal D2, paper form."
    assert next(losses([*best, *cheap], [])) == loss
    beyond = "| ball | 70 dB at 2 Mbps; Draco 82 dB at 8 | 0.7 at 2 Mbps; Draco 0.82 at 8 |"
    assert beyond_table([*best, *draco, *cheap])[2:] == [beyond]
