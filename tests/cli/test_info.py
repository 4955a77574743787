"""`meshreel info`: the contents of a file and their bytes."""

import json
from dataclasses import replace

import pytest

import meshreel
from meshreel.coding.mesh import encode_empty
from meshreel.container.writer import ReelWriter
from tests.cli.conftest import FILE, SCENE
from tests.container.files import HEADER, PAYLOADS
from tests.golden import GOLDEN


def test_every_byte_counts_as_some_content_of_some_group(run):
    row = run("info", FILE, "--json").row
    assert sum(row["bytes_by_content"].values()) == row["bytes"] == FILE.stat().st_size
    assert row["bytes"] == row["bytes_by_content"]["header and index"] + sum(group["bytes"] for group in row["groups"])
    assert abs(sum(row["mbps_by_content"].values()) - row["mbps"]) < 1e-12
    assert row["mbps"] == row["bytes"] * 8 * 25 / 10 / 1e6
    assert {"reference", "basis", "displacements", "draco"} < set(row["bytes_by_content"])


def test_groups_have_their_frames_forms_and_layers(run):
    groups = run("info", FILE, "--json").row["groups"]
    assert [(g["first_frame"], g["frames"], g["form"]) for g in groups] == [
        (0, 2, "empty"),
        (2, 4, "laplacian"),
        (6, 3, "draco"),
        (9, 1, "empty"),
    ]
    assert groups[1]["layers"] > 0


def test_the_text_has_frames_rate_forms_and_what_was_recorded(run):
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


def test_a_group_that_does_not_decode_is_named_when_all_groups_are_asked_for(run, tmp_path):
    with ReelWriter(tmp_path / "a.reel", HEADER) as writer:
        writer.add_group(0, 2, encode_empty(), depends_on=(writer.add_static(PAYLOADS[0]),))
        writer.add_group(2, 3, PAYLOADS[3])
    said = run("info", tmp_path / "a.reel", "--groups", "--json")
    assert said.code == 0 and ["error" in group for group in said.row["groups"]] == [False, True]
    assert "group 1: chunk 2 (frames 2 to 4)" in said.err and "background: " in said.err
    assert run("info", FILE, "--groups").err == run("info", SCENE, "--groups").err == ""


def test_a_truncated_file_is_reported_with_its_existing_and_missing_bytes(run, tmp_path):
    data, groups = FILE.read_bytes(), meshreel.open(FILE).reader.groups
    cut = groups[2].offset + 10
    (tmp_path / "a.reel").write_bytes(data[:cut])
    row = run("info", tmp_path / "a.reel", "--json").row
    assert (row["bytes"], row["bytes_missing"]) == (len(data), len(data) - cut)
    assert row["groups"][2]["bytes_by_content"] == {"damaged": 10, "missing": groups[2].size - 10}
    assert row["groups"][3]["bytes_by_content"] == {"missing": groups[3].size}
    assert sum(row["bytes_by_content"].values()) == len(data) and row["bytes_by_content"]["missing"] == len(data) - cut
    said = run("info", tmp_path / "a.reel")
    assert (
        said.code == 0
        and f"{cut} of {len(data)} bytes ({len(data) - cut} are missing: the file is truncated)" in said.out
    )
    assert "group 2: " in said.err and "group 3: " in said.err and "group 1" not in said.err
    assert "missing" not in run("info", FILE).out and run("info", FILE, "--json").row["bytes_missing"] == 0


def test_each_track_of_a_scene_has_the_frames_of_its_body_and_its_contents(run):
    row = run("info", SCENE, "--json").row
    assert [track["ranges"] for track in row["tracks"]] == [[[0, 13]], [[4, 8]]]
    assert [track["groups"] for track in row["tracks"]] == [3, 4]
    assert sum(row["bytes_by_content"].values()) == row["bytes"] == SCENE.stat().st_size
    for number, track in enumerate(row["tracks"]):
        own = [group for group in row["groups"] if group["track"] == number]
        assert track["bytes"] == sum(group["bytes"] for group in own) == sum(track["bytes_by_content"].values())
        assert track["bytes_by_content"] == {
            name.removeprefix(f"track {number}: "): size
            for name, size in row["bytes_by_content"].items()
            if name.startswith(f"track {number}: ")
        }
    assert row["bytes_by_content"]["track 1: patches"] > 0 and "track 0: patches" not in row["bytes_by_content"]
    said = run("info", SCENE)
    assert (said.code, said.err) == (0, "")
    assert all(words in said.out for words in ("appears in frames", "4-8", "track 1: base mesh", "background"))


def test_each_state_of_a_background_has_its_frames(run):
    row = run("info", SCENE, "--json").row
    states = row["background"]
    assert [(s["chunk"], s["form"], s["changes"], s["ranges"]) for s in states] == [
        (0, "draco", None, [[0, 3]]),
        (3, "patch", 0, [[4, 13]]),
    ]
    assert row["bytes_by_content"]["background"] == sum(state["bytes"] for state in states)
    assert "shown in frames" in run("info", SCENE).out and "shown in frames" not in run("info", FILE).out
    assert run("info", FILE, "--json").row["background"] == []


def test_a_body_that_returns_has_two_ranges_and_one_that_never_appears_has_none(run, tmp_path):
    payload = meshreel.open(FILE).reader.read_chunk(2)
    with ReelWriter(tmp_path / "a.reel", HEADER) as writer:
        for first in range(0, 12, 3):
            writer.add_group(first, 3, encode_empty() if first == 6 else payload)
            writer.add_group(first, 3, encode_empty(), track=1)
    row = run("info", tmp_path / "a.reel", "--json").row
    assert [track["ranges"] for track in row["tracks"]] == [[[0, 5], [9, 11]], []]
    assert "0-5, 9-11" in run("info", tmp_path / "a.reel").out and "none" in run("info", tmp_path / "a.reel").out


def test_damage_of_a_scene_is_reported_by_chunk_track_and_frames(run, tmp_path):
    chunks = meshreel.open(SCENE).reader.chunks
    for number, words in ((3, "background: chunk 3 (static)"), (4, "group 2: chunk 4 (track 1, frames 4 to 6)")):
        data = bytearray(SCENE.read_bytes())
        data[chunks[number].offset + 9] ^= 4
        (tmp_path / "a.reel").write_bytes(data)
        said = run("info", tmp_path / "a.reel", "--json")
        assert said.code == 0 and words in said.err and said.err.count("\n") == 1
        assert said.row["bytes_by_content"]["damaged"] == chunks[number].size
        assert sum(said.row["bytes_by_content"].values()) == len(data)


def test_a_predicted_group_is_marked(run):
    file = GOLDEN / "layers.reel"
    groups = run("info", file, "--json").row["groups"]
    assert [(group["form"], group["layers"], group["predicted"]) for group in groups] == [
        ("layers", 2, False),
        ("layers", 2, True),
        ("layers", 2, True),
    ]
    assert run("info", file).out.count("layers, predicted") == 2


def test_what_was_recorded_cannot_steer_a_terminal(run, tmp_path):
    with ReelWriter(tmp_path / "a.reel", replace(HEADER, metadata='{"tool": "a\\u001b[31m\\nb"}')) as writer:
        writer.add_group(0, 1, encode_empty())
    said = run("info", tmp_path / "a.reel")
    assert said.code == 0 and "recorded at encode: tool a\\x1b[31m\\nb\n" in said.out


@pytest.mark.parametrize(
    ("metadata", "words"),
    [
        ("[0.9006, 1, 36]", "least_covered frame 36 of track 1, to 90.1 %"),
        ("[null, 1]", "least_covered [None, 1]"),
        ('"x"', "least_covered x"),
    ],
)
def test_the_frame_that_is_covered_least_is_named(run, tmp_path, metadata, words):
    header = replace(HEADER, metadata=f'{{"least_covered": {metadata}}}')
    with ReelWriter(tmp_path / "a.reel", header) as writer:
        writer.add_group(0, 1, encode_empty())
    said = run("info", tmp_path / "a.reel")
    assert said.code == 0 and f"recorded at encode: {words}\n" in said.out


def test_box_duration_mesh_layers_and_colour_are_shown_first(run):
    lines = run("info", SCENE).out.splitlines()
    assert "14 frames at 25/s, 0.56 s" in lines[0]
    first = meshreel.open(SCENE)[0]
    low, high = meshreel.open(SCENE).box
    box = " x ".join(f"{size:.3g}" for size in high - low)
    assert f"box {box} m, y is up; frame 0: {len(first.vertices)} vertices, {len(first.faces)} faces" in lines[1]
    assert "3 layers; colour: none" in lines[1]
    assert "colour: vertices, textures (AV1)" in run("info", GOLDEN / "colored" / "scene.reel").out
    nothing = run("info", GOLDEN / "empty.reel")
    assert nothing.code == 0 and "no surface found" in nothing.out


def test_a_long_file_fits_on_a_screen_unless_all_groups_are_asked_for(run, tmp_path):
    payload = meshreel.open(FILE).reader.read_chunk(2)
    header = replace(HEADER, metadata=json.dumps({"key_frames": [*range(500)]}))
    with ReelWriter(tmp_path / "a.reel", header) as writer:
        for first in range(0, 60, 3):
            for track in range(20):
                writer.add_group(first, 3, payload if first % 2 or not track else encode_empty(), track=track)
    short, long = run("info", tmp_path / "a.reel"), run("info", tmp_path / "a.reel", "--groups")
    assert len(short.out.splitlines()) < 60 < 400 < len(long.out.splitlines())
    assert "392 more: --groups shows all" in short.out and "12 more: --groups shows all" in short.out
    assert "more: --groups" not in long.out and "track 19: " in long.out and "track 19: " not in short.out
    assert "499" in long.out and "499" not in short.out
    assert sum(run("info", tmp_path / "a.reel", "--json").row["bytes_by_content"].values()) == (
        (tmp_path / "a.reel").stat().st_size
    )
