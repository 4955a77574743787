"""Tables of the report: ranks, codecs at one rate, BD-rates, failures, and names as text."""

from __future__ import annotations

import pytest
from markdown_it import MarkdownIt
from meshreel_bench.curves import D2_PAPER, NORMALS, SSIM, SYMMETRIC
from meshreel_bench.names import BEST
from meshreel_bench.report import bd_table, comparable_table, ranked_table
from meshreel_bench.report.looks import KNOWN, direction, in_order, looks_of
from meshreel_bench.report.tables import (
    DAGGER,
    NEAR,
    Told,
    common_rate,
    failure_table,
    maker_table,
    nearest,
    point_table,
    text,
)

from bench.tests.report_rows import failed, row


def cells(line):
    return [cell.strip() for cell in line.strip("|").split(" | ")]


def test_the_best_is_bold_and_the_second_is_italic_by_the_direction_of_each_column():
    lines = ranked_table(
        ["codec", "dB", "ms", "kind"], [["a", 60, 2.0, 1], ["b", 70, 3.0, 2], ["c", 50, 1.0, 3]], [0, 1, -1, 0]
    )
    assert lines[0] == "| codec | dB ↑ | ms ↓ | kind |"
    assert [cells(line) for line in lines[2:]] == [
        ["a", "*60*", "*2*", "1"],
        ["b", "**70**", "3", "2"],
        ["c", "50", "**1**", "3"],
    ]


def test_ties_share_a_rank_and_equal_as_printed_is_a_tie():
    column = [cells(line)[0] for line in ranked_table(["x"], [[0.98001], [0.98002], [0.97], [0.97], [0.1]], [1])[2:]]
    assert column == ["**0.98**", "**0.98**", "*0.97*", "*0.97*", "0.1"]


def test_what_is_not_measured_or_not_in_a_group_has_no_rank_and_one_number_alone_has_none():
    rows = [[1.0, 5.0], [2.0, None], [9.0, None], [3.0, 1.0], [4.0, None]]
    lines = ranked_table(["x", "y"], rows, [1, 1], ["a", "a", None, "b", "b"])
    assert [cells(line)[0] for line in lines[2:]] == ["*1*", "**2**", "9", "*3*", "**4**"]
    assert [line.split("|")[2].strip() for line in lines[2:]] == ["5", "", "", "1", ""]


def test_what_stands_around_a_number_is_not_ranked_and_not_marked():
    rows = [[Told(2.00001, "≤ ", " (x 2)")], [Told(1.0)], ["- (up to 3)"], [Told(2.0, "", " (x 1)")], [None]]
    column = [cells(line)[0] for line in ranked_table(["x"], rows, [-1])[2:]]
    assert column[:4] == ["≤ *2* (x 2)", "**1**", "- (up to 3)", "*2* (x 1)"] and not column[4].strip("| ")
    assert cells(ranked_table(["x"], [[Told(1.5, "a ")]], [0])[2]) == ["a 1.5"]


def test_codecs_at_a_rate_are_shown_by_their_nearest_point_and_far_ones_are_not_ranked():
    rows = [
        row("dancer", "draco", 4.0, 80.0),
        row("dancer", "draco", 9.0, 85.0),
        row("dancer", BEST, 0.5, 60.0),
        row("dancer", BEST, 1.2, 66.0),
        row("dancer", "tvmc", 0.9, 64.0),
    ]
    lines = comparable_table(rows, 1.0)
    assert cells(lines[2])[:3] == [BEST, "1.2", "**66**"]
    assert cells(lines[3])[:3] == ["tvmc", "0.9", "*64*"]
    assert cells(lines[4])[:3] == [f"draco {DAGGER}", "4", "80"]
    assert lines[-1].startswith(DAGGER) and f"{NEAR:g} of 1 Mbps" in lines[-1] and len(lines) == 7
    assert "decode (ms/frame) ↓" in lines[0] and "normal error (degrees) ↓" in lines[0] and "Mbps |" in lines[0]
    assert cells(lines[3])[-1] == "**1.9**"


def test_what_is_near_is_ranked_and_more_is_not():
    rates = {"draco": NEAR, "necgs": 1 / NEAR, "x": NEAR + 0.01}
    rows = [row("dancer", name, mbps, 60.0) for name, mbps in rates.items()]
    assert [DAGGER in line for line in comparable_table(rows, 1.0)[2:5]] == [False, False, True]


def test_each_sequence_is_ranked_for_itself_and_what_no_row_has_is_no_column():
    rows = [
        row(body, codec, 1.0, db)
        for body, codec, db in (("a", "x", 60.0), ("a", "y", 61.0), ("b", "x", 70.0), ("b", "y", 50.0))
    ]
    rows = [{k: v for k, v in each.items() if k != "decode"} for each in rows]
    lines = comparable_table(rows, 1.0)
    assert [cells(line)[3] for line in lines[2:]] == ["*60*", "**61**", "**70**", "*50*"]
    assert cells(lines[0])[:2] == ["sequence", "codec"] and "decode" not in lines[0]
    assert comparable_table([row("a", "x", 1.0, 60.0) | {"kind": "memory"}], 1.0) == []


def test_the_common_rate_is_the_median_over_codecs_and_of_two_as_near_the_cheaper_is_taken():
    rows = [row("a", "x", mbps, 60.0) for mbps in (0.1, 0.2, 0.4, 0.8, 1.6)] + [
        row("a", "y", 4.0, 60.0),
        row("a", "z", 1.0, 60.0),
    ]
    assert common_rate(rows) == pytest.approx(1.0)
    assert nearest([row("a", "x", 2.0, 60.0), row("a", "x", 0.5, 60.0)], 1.0)["x"]["mbps"] == 0.5


def test_bd_rates_state_their_overlap_and_say_where_there_is_none():
    rows = [row("dancer", BEST, mbps, db) for mbps, db in ((0.5, 60.0), (1.0, 70.0))]
    rows += [row("dancer", "draco", 2 * mbps, db) for mbps, db in ((0.5, 60.0), (1.0, 70.0))]
    rows += [row("dancer", "necgs", mbps, db) for mbps, db in ((0.5, 40.0), (1.0, 50.0))]
    rows += [row("dancer", "klt_tsdf", 1.0, 65.0)]
    lines = bd_table(rows, BEST, (D2_PAPER, NORMALS, SSIM))
    heads = [f"rate at equal {name} ↓" for name in ("D2, paper form", "normal error", "masked SSIM without keys")]
    assert cells(lines[0]) == [f"{BEST} against", *heads]
    found = {cells(line)[0]: cells(line)[1:] for line in lines[2:]}
    assert found["draco"][:2] == ["-50.0 % (60 dB to 70 dB)", "-50.0 % (6 degrees to 4 degrees)"]
    assert found["draco"][2].startswith("not measured of draco and meshreel best")
    assert found["necgs"][0] == "no overlap"
    assert found["klt_tsdf"][0] == "one usable point of klt_tsdf"
    assert list(found) == ["klt_tsdf", "necgs", "draco"]
    assert bd_table(rows, "tvmc", (D2_PAPER,)) == []


def test_bd_rates_of_several_sequences_name_them():
    rows = [
        row(body, codec, f * mbps, 60 + 10 * mbps)
        for body in ("a", "b")
        for codec, f in (("x", 1), ("y", 2))
        for mbps in (0.5, 1.0)
    ]
    assert [cells(line)[:3] for line in bd_table(rows, "x", (SYMMETRIC,))[2:]] == [
        ["a", "y", "-50.0 % (63 dB to 68 dB)"],
        ["b", "y", "-50.0 % (63 dB to 68 dB)"],
    ]


def test_failures_are_listed_with_their_reasons_on_one_line():
    lines = failure_table([failed("dancer", "necgs", "exit status 1: Traceback\nValueError: a | b")])
    assert cells(lines[2])[:5] == ["made up", "dancer", "necgs", "qp 9", "quality"]
    assert lines[2].endswith("| exit status 1: Traceback ValueError: a \\| b |")


def test_makers_are_counted_by_what_they_say():
    made = {"meshreel": "0.1.0", "commit": "abc", "platform": "P", "cpu": "C", "python": "3.12", "cores": 2}
    rows = [row("a", "x", 1.0, 60.0, made_by=made), row("a", "y", 1.0, 60.0, made_by=made), row("a", "z", 1.0, 60.0)]
    rows.append(row("a", "w", 1.0, 60.0, made_by=made | {"commit": None}))
    assert [cells(line) for line in maker_table(rows)[2:]] == [
        ["made up", "0.1.0", "abc", "P", "C", "3.12", "2", "2"],
        ["made up", *["not recorded"] * 6, "1"],
        ["made up", "0.1.0", "none: installed", "P", "C", "3.12", "2", "1"],
    ]


@pytest.mark.parametrize(
    "name",
    [
        "TVMC*",
        "*x*",
        "a|b",
        "<b>x</b>",
        "_x_",
        "[a](http://b)",
        "`x`",
        "&amp;",
        "\\",
        "![x](y)",
        "a < b",
        "\\<b>x</b>",
        "\\\\<b>",
        "~~x~~",
        "klt_tsdf",
    ],
)
def test_a_name_is_shown_as_it_is(name):
    reader = MarkdownIt("commonmark", {"html": False}).enable("table")
    tokens = reader.parse(f"| head |\n|---|\n| {text(name)} |\n")
    inline = [token for token in tokens if token.type == "inline"][1]
    assert {child.type for child in inline.children} <= {"text", "text_special"}
    assert "".join(child.content for child in inline.children) == name


def test_a_codec_looks_the_same_wherever_it_is_and_the_system_is_first_and_bold():
    names = ["zeta", "draco", BEST, "alpha"]
    assert in_order(names) == [BEST, "draco", "alpha", "zeta"]
    looks = looks_of(names)
    assert looks_of(reversed(names)) == looks and looks["draco"] == KNOWN["draco"]
    assert looks[BEST].width == max(look.width for look in looks.values()) > looks["draco"].width
    many = looks_of([*KNOWN, *(f"codec {i}" for i in range(20))])
    others = [(many[f"codec {i}"].color, many[f"codec {i}"].marker) for i in range(20)]
    assert len(set(others)) == 20 and not {color for color, _ in others} & {look.color for look in KNOWN.values()}


@pytest.mark.parametrize(
    ("key", "sign"),
    [("d2_psnr_paper", 1), ("ssim_masked_without_keys", 1), ("normal_error_deg", -1), ("truth_people_median_m", -1)]
    + [("truth_covered", 1), ("seam_uncovered", -1), ("hausdorff95_forward_percent", -1), ("frames", 0)],
)
def test_a_metric_tells_which_way_it_is_better(key, sign):
    assert direction(key) == sign


def test_options_that_all_points_of_a_codec_share_are_told_once_and_empty_columns_not_at_all():
    rows = [
        row("a", "draco", 1.0, 60.0, options={"qp": 7, "levels": 1}),
        row("a", "draco", 2.0, 60.0, options={"qp": 8, "levels": 1}),
        row("a", "alone", 3.0, 60.0, options={"size": 4, "unset": None}),
    ]
    lines = point_table(rows[::-1])
    assert "| draco | qp 7 | 1 |" in lines[2] and "| draco | qp 8 | 2 |" in lines[3]
    assert "| alone | size 4 | 3 |" in lines[4] and lines[-1] == "All points of draco: levels 1."
    assert "DracoPy" not in lines[0] and lines[0].count("|") == lines[2].count("|")
    assert [cells(line)[0] for line in lines[2:5]] == ["draco", "draco", "alone"]
    with_peer = [rows[0] | {"decode_over_peer": 1.5}, *rows[1:]]
    assert "/ DracoPy" in point_table(with_peer)[0]
    assert len(point_table([rows[2]])) == 3  # one point shares nothing
