"""`meshreel info`: where the bytes of a file go."""

from __future__ import annotations

import meshreel
from tests.cli.conftest import FILE, failed
from tests.golden import GOLDEN


def test_every_byte_is_in_some_part_and_in_some_group(run):
    row = run("info", FILE, "--json").row
    assert sum(row["parts"].values()) == row["bytes"] == FILE.stat().st_size
    assert row["bytes"] == row["parts"]["header and index"] + sum(group["bytes"] for group in row["groups"])
    assert abs(sum(row["parts_mbps"].values()) - row["mbps"]) < 1e-12
    assert row["mbps"] == row["bytes"] * 8 * 25 / 10 / 1e6
    assert {"reference", "basis", "displacements", "draco"} < set(row["parts"])


def test_groups_have_their_frames_forms_and_layers(run):
    groups = run("info", FILE, "--json").row["groups"]
    assert [(g["first_frame"], g["frames"], g["form"]) for g in groups] == [
        (0, 2, "empty"),
        (2, 4, "laplacian"),
        (6, 3, "draco"),
        (9, 1, "empty"),
    ]
    assert groups[1]["layers"] > 0


def test_text_tells_frames_rate_forms_and_what_was_recorded(run):
    said = run("info", FILE)
    assert said.code == 0 and said.err == ""
    assert "10 frames at 25/s" in said.out and "recorded at encode: preset golden" in said.out
    assert all(word in said.out for word in ("laplacian", "displacements", "Mbps", "2-5"))
    assert run("info", FILE, "--quiet").out == ""


def test_a_damaged_group_is_reported_and_the_others_shown(run, tmp_path):
    data = bytearray(FILE.read_bytes())
    data[meshreel.open(FILE).reader.groups[1].offset + 3] ^= 4
    (tmp_path / "a.reel").write_bytes(data)
    said = run("info", tmp_path / "a.reel", "--json")
    assert said.code == 0
    assert ["error" in group for group in said.row["groups"]] == [False, True, False, False]
    assert "group 1: chunk 1 (frames 2 to 5)" in said.err


def test_of_a_truncated_file_what_is_there_and_what_is_missing_is_told(run, tmp_path):
    data, groups = FILE.read_bytes(), meshreel.open(FILE).reader.groups
    cut = groups[2].offset + 10
    (tmp_path / "a.reel").write_bytes(data[:cut])
    row = run("info", tmp_path / "a.reel", "--json").row
    assert (row["bytes"], row["bytes_missing"]) == (len(data), len(data) - cut)
    assert row["groups"][2]["parts"] == {"damaged": 10, "missing": groups[2].size - 10}
    assert row["groups"][3]["parts"] == {"missing": groups[3].size}
    assert sum(row["parts"].values()) == len(data) and row["parts"]["missing"] == len(data) - cut
    said = run("info", tmp_path / "a.reel")
    assert (
        said.code == 0
        and f"{cut} of {len(data)} bytes ({len(data) - cut} are missing: the file is truncated)" in said.out
    )
    assert "group 2: " in said.err and "group 3: " in said.err and "group 1" not in said.err
    assert "missing" not in run("info", FILE).out and run("info", FILE, "--json").row["bytes_missing"] == 0


def test_other_files_are_told(run, tmp_path):
    (tmp_path / "a.reel").write_bytes(b"PK\x03\x04")
    assert failed(run("info", tmp_path / "a.reel"), "a.reel", "not a .reel")
    assert failed(run("info", tmp_path / "b.reel", "--json"), "b.reel")
    assert failed(run("info"), "FILE")


def test_a_group_that_is_predicted_from_the_one_before_is_told(run):
    file = GOLDEN / "layers.reel"
    groups = run("info", file, "--json").row["groups"]
    assert [(group["form"], group["layers"], group["predicted"]) for group in groups] == [
        ("layers", 2, False),
        ("layers", 2, True),
        ("layers", 2, True),
    ]
    assert run("info", file).out.count("layers, predicted") == 2
