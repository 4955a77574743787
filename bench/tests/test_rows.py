"""Rows: what a file of them means, and which of several rows of a point counts."""

import msgspec
import pytest
from meshreel_bench.rows import Point, append_row, checked, join_rows, read_rows

from bench.tests.made_up import failed, floor, row
from meshreel.errors import InputError


def test_rows_come_back_as_they_were_with_the_rate_of_all_bytes_over_the_time_that_they_play(tmp_path):
    rows = [row("ball", "best", 1.0, 60.0), floor("ball", d2_psnr_paper=None), failed("ball", "draco", "no\nluck")]
    for each in rows:
        append_row(tmp_path / "new" / "rows.jsonl", each)
    assert read_rows(tmp_path / "new" / "rows.jsonl") == rows
    assert row("ball", "best", 1.5, 60.0).mbps == pytest.approx(1.5, rel=1e-5)


def test_a_row_that_was_not_written_to_its_end_is_left_out_and_replaced(tmp_path):
    file = tmp_path / "rows.jsonl"
    append_row(file, row("ball", "best", 1.0, 60.0))
    with file.open("ab") as end:
        end.write(b'{"point": {"sequ')
    assert len(read_rows(file)) == 1
    append_row(file, row("ball", "best", 2.0, 65.0))
    assert [round(each.mbps) for each in read_rows(file)] == [1, 2]


@pytest.mark.parametrize(
    ("line", "reason"),
    [
        ('{"name": "a"}', "line 2: not a row: .*point"),
        ('{"point": {"sequence": "a", "codec": "b"}, "name": "b", "frames": "ten"}', "Expected `int`, got `str`"),
        ('{"point": {"sequence": "a", "codec": "b"}, "name": "b", "speed": 1}', "unknown field `speed`"),
        ("no JSON", "line 2: not a row: .*; delete that line"),
        ('{"point":' * 3000, "line 2: not a row: .*; delete that line"),
        ('{"point": {"sequence": "a", "codec": "b"}, "name": "b", "frame_rate": 0}', "line 2: not a row: .*> 0"),
        ('{"point": {"sequence": "a", "codec": "b"}, "name": "b", "stream": {"bytes": 9, "coded_frames": 0}}', ">= 1"),
    ],
)
def test_a_line_that_is_no_row_is_refused(tmp_path, line, reason):
    file = tmp_path / "rows.jsonl"
    append_row(file, row("ball", "best", 1.0, 60.0))
    file.write_bytes(file.read_bytes() + line.encode() + b"\n")
    with pytest.raises(InputError, match=reason):
        read_rows(file)


def test_a_last_line_that_ends_without_a_break_is_kept_if_it_is_whole(tmp_path):
    file, rows = tmp_path / "rows.jsonl", [row("ball", "best", rate, 60.0) for rate in (1.0, 2.0, 3.0)]
    for each in rows[:2]:
        append_row(file, each)
    file.write_bytes(file.read_bytes().rstrip(b"\n"))
    append_row(file, rows[2])
    assert read_rows(file) == rows


@pytest.mark.parametrize("options", [{"q": float("nan")}, {"q": b"a"}, {"q": object()}, {"q": [1]}, {1: 2}, None])
def test_a_row_that_could_not_be_read_again_is_refused_before_it_is_written(options):
    with pytest.raises(InputError, match="codec 'best'"):
        checked(msgspec.structs.replace(row("ball", "best", 1.0, 60.0), options=options))


def test_what_is_no_file_of_rows_is_refused(tmp_path):
    (tmp_path / "notes.txt").write_bytes(b"my only copy\xe9")
    with pytest.raises(InputError, match="line 1: not a row"):
        read_rows(tmp_path / "notes.txt")
    with pytest.raises(InputError, match="cannot be read"):
        read_rows(tmp_path / "none.jsonl")
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="cannot be written"):
        append_row(tmp_path / "file" / "rows.jsonl", row("ball", "best", 1.0, 60.0))


def test_of_a_point_the_last_row_of_a_file_counts_and_of_several_files_the_first_that_was_measured(tmp_path):
    first, second = row("ball", "best", 1.0, 60.0), row("ball", "best", 1.0, 61.0)
    bad = failed("ball", "best", "slow")
    lost = type(bad)(point=first.point, name="best", failed="slow")
    for each in (first, second, lost):
        append_row(tmp_path / "rows.jsonl", each)
    assert read_rows(tmp_path / "rows.jsonl") == [second]
    assert join_rows([[lost], [first], [second]]) == [first]
    # points that differ in frames or metrics are different points
    points = [Point("a", "b"), Point("a", "b", frames=3), Point("a", "b", metrics="regions"), Point("a", "b", {"q": 1})]
    assert len({point.key for point in points}) == 4
