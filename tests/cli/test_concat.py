"""Parts of a sequence, encoded apart from one survey, join to the bytes of one encode of the whole."""

import json
from dataclasses import replace

import pytest

from meshreel.container.reader import ReelReader
from meshreel.container.sources import BytesSource, FileSource
from meshreel.container.writer import ReelWriter
from meshreel.format.layout import Form
from meshreel.geometry.topology import concatenate
from meshreel.io.write import write_mesh
from meshreel.types import Mesh
from tests.cli.conftest import FILE, encode_once, failed
from tests.metrics.shapes import moved, sphere
from tests.spheres import sliding_sphere

pytestmark = pytest.mark.usefixtures("quick_presets")
FLAGS = ("--fps", "10", "--key-interval", "0.2", "--dynamic-only")


@pytest.fixture(scope="module")
def slide(tmp_path_factory):
    """A folder of seven frames, of which one is empty; the last is larger than the others."""
    folder = tmp_path_factory.mktemp("slide")
    frames = [*sliding_sphere(5, levels=1), Mesh.empty()]
    for number, mesh in enumerate([*frames, Mesh(2 * frames[0].vertices, frames[0].faces)]):
        write_mesh(mesh, folder / f"frame_{number:05}.ply")
    return folder


@pytest.fixture
def surveyed(run, slide, tmp_path):
    """The path of the survey of the slide."""
    path = tmp_path / "survey.json"
    assert run("survey", slide, "-o", path, "--fps", "10").code == 0
    return path


def part(run, slide, survey, name, *flags):
    return encode_once(run, slide, survey.with_name(name), *FLAGS, "--survey", survey, *flags)


def test_a_survey_is_of_all_frames(run, slide, tmp_path):
    said = run("survey", slide, "-o", tmp_path / "s.json", "--frames", ":3")
    assert failed(said, "--frames :3", "give --frames to encode --survey") and not (tmp_path / "s.json").exists()


@pytest.mark.parametrize("count", [1, 3])
def test_parts_join_to_the_bytes_of_the_whole(run, slide, surveyed, tmp_path, count):
    whole, joined = encode_once(run, slide, tmp_path / "whole.reel", *FLAGS), tmp_path / "joined.reel"
    parts = [part(run, slide, surveyed, f"{k}.reel", "--part", f"{k}/{count}") for k in range(1, count + 1)]
    row = run("concat", *parts, "-o", joined, "--json").row
    assert row == {"output": str(joined), "frames": 7, "bytes": whole.stat().st_size, "files": count}
    assert joined.read_bytes() == whole.read_bytes()
    if count > 1:
        assert all(path.read_bytes() != whole.read_bytes() for path in parts)


def test_parts_have_the_tracks_of_the_whole(run, slide, surveyed, tmp_path):
    """The second of two bodies is gone in the last part."""
    (folder := tmp_path / "two").mkdir()
    for number in range(6):
        gone = [] if number > 3 else [moved(sphere(levels=3), (4 + 0.1 * number, 0, 0))]
        write_mesh(concatenate([sphere(levels=3), *gone]), folder / f"frame_{number}.ply")
    survey, whole = tmp_path / "two.json", tmp_path / "whole.reel"
    assert run("survey", folder, "-o", survey, "--fps", "10").code == 0
    assert "2 tracks, " in run("encode", folder, "-o", whole, *FLAGS).out
    parts = [part(run, folder, survey, f"{k}.reel", "--part", f"{k}/3") for k in (1, 2, 3)]
    joined = ("-o", tmp_path / "joined.reel")
    assert run("concat", *parts, *joined).code == 0
    assert joined[1].read_bytes() == whole.read_bytes()
    with FileSource(parts[2]) as source:
        assert [group.form == Form.EMPTY for group in ReelReader(source).groups] == [False, True]
    other = part(run, slide, surveyed, "other.reel", "--part", "1/1")
    assert failed(
        run("concat", parts[0], other, *joined), "other.reel: number of tracks 1, and of", "1.reel 2", "--survey FILE"
    )


def test_frames_that_end_inside_an_interval_join_too_to_other_groups(run, slide, surveyed, tmp_path):
    parts = [part(run, slide, surveyed, f"{k}.reel", "--frames", frames) for k, frames in enumerate((":3", "3:"))]
    assert run("concat", *parts, "-o", tmp_path / "joined.reel").code == 0
    with FileSource(tmp_path / "joined.reel") as source:
        reader = ReelReader(source)
        assert [group.first_frame for group in reader.groups][-2:] == [5, 6] and reader.frame_count == 7
    assert run("decode", tmp_path / "joined.reel", "-o", tmp_path / "out").code == 0


def test_files_that_no_survey_unites_are_refused(run, slide, surveyed, tmp_path):
    first = part(run, slide, surveyed, "a.reel", "--frames", ":2")
    other = encode_once(run, slide, tmp_path / "b.reel", *FLAGS, "--frames", ":2")
    out = ("-o", tmp_path / "c.reel")
    assert failed(run("concat", first, other, *out), "b.reel: origin", "meshreel survey")
    finer = part(run, slide, surveyed, "d.reel", "--frames", "2:4", "--quality", "60")
    assert failed(run("concat", first, finer, *out), "d.reel: differs from", "quality 50.0, now 60.0", "same options")
    quicker = part(run, slide, surveyed, "f.reel", "--frames", "2:4", "--effort", "fast")
    assert failed(run("concat", first, quicker, *out), "f.reel: differs from", "options", "same options")
    damaged = part(run, slide, surveyed, "g.reel", "--frames", "2:4").read_bytes()[:-1] + b"?"
    (tmp_path / "e.reel").write_bytes(damaged)
    assert failed(run("concat", first, tmp_path / "e.reel", *out), "e.reel: chunk", "damaged")
    assert failed(run("concat", tmp_path / "no.reel", *out), "no.reel: cannot be opened")
    assert failed(run("concat", first, "-o", first), "is the input")
    assert not out[1].exists()


@pytest.mark.parametrize("order", [(1, 3), (2, 1, 3), (1, 1, 2)])
def test_parts_that_do_not_follow_one_another_are_refused(run, slide, surveyed, tmp_path, order):
    parts = {k: part(run, slide, surveyed, f"{k}.reel", "--part", f"{k}/3") for k in sorted(set(order))}
    said = run("concat", *(parts[k] for k in order), "-o", tmp_path / "joined.reel")
    assert failed(said, f"{order[1]}.reel: begins at frame", "the next in turn is", "each part once")
    assert not (tmp_path / "joined.reel").exists()


def test_frames_that_no_part_has_are_said(run, slide, surveyed, tmp_path):
    parts = [part(run, slide, surveyed, f"{k}.reel", "--part", f"{k}/3") for k in (2, 3)]
    said = run("concat", *parts, "-o", tmp_path / "joined.reel", "--json")
    missing = 7 - said.row["frames"]
    assert said.code == 0 and missing > 0 and f"{missing} of the sequence's 7 frames are in none" in said.err
    assert "none of the files" not in run("concat", part(run, slide, surveyed, "w.reel"), "-o", tmp_path / "x.reel").err


@pytest.mark.parametrize("metadata", ['{"key_frames": 1}', '{"key_frames": [], "part": [1]}', '{"part": 1}'])
def test_metadata_that_no_encoder_wrote_are_refused(run, tmp_path, metadata):
    with FileSource(FILE) as source:
        reader = ReelReader(source)
        payload, header = reader.read_chunk(reader.groups[0].number), reader.header
    plain = replace(header, metadata=metadata, first_time=0, intervals=())
    with ReelWriter(tmp_path / "a.reel", plain) as writer:
        writer.add_group(0, reader.groups[0].frame_count, payload)
    assert ReelReader(BytesSource((tmp_path / "a.reel").read_bytes())).metadata == json.loads(metadata)
    said = run("concat", tmp_path / "a.reel", "-o", tmp_path / "b.reel")
    assert failed(said, "a.reel", "metadata are not those of meshreel encode")


@pytest.mark.parametrize(
    ("flags", "words"),
    [
        (["--part", "1/2"], ["needs the --survey"]),
        (["--survey", "S", "--part", "0/2"], ["part 0/2: give 1/2 to 2/2"]),
        (["--survey", "S", "--part", "2"], ["--part 2: give K/N"]),
        (["--survey", "S", "--part", "1/2", "--frames", ":3"], ["leave --frames out"]),
        (["--survey", "S", "--part", "1/99"], ["has 5 key intervals", "a shorter --key-interval"]),
        (["--survey", "S", "--target-mbps", "1"], ["--quality in place of a target"]),
        (["--survey", "S", "--fps", "20"], ["frame_rate 10.0, and here 20.0"]),
        (["--survey", "S", "--up", "z"], ["up y, and here z"]),
    ],
)
def test_parts_that_cannot_be_are_refused(run, slide, surveyed, tmp_path, flags, words):
    given = [surveyed if flag == "S" else flag for flag in flags]
    rate = FLAGS[2:] if "--fps" in flags else FLAGS
    assert failed(run("encode", slide, "-o", tmp_path / "a.reel", *rate, *given), *words)


def test_a_frame_that_has_changed_since_the_survey_is_refused(run, slide, surveyed, tmp_path):
    record = json.loads(surveyed.read_bytes())
    record["digests"][4] = "0" * 16
    surveyed.write_text(json.dumps(record))
    said = run("encode", slide, "-o", tmp_path / "a.reel", *FLAGS, "--survey", surveyed, "--frames", "3:6")
    assert failed(said, "frame 4 (", "has changed")


@pytest.mark.parametrize(
    "change",
    [
        {"kind": "x"},
        {"low": [0, 1]},
        {"low": [9, 9, 9]},
        {"low": [-(10**400), 0, 0]},
        {"high": [1e308, 9, 9]},
        {"dropped": float("inf")},
        {"digests": []},
        {"up": None},
        {"pieces": []},
        None,
    ],
)
def test_a_file_that_is_no_survey_is_refused(run, slide, surveyed, tmp_path, change):
    record = json.loads(surveyed.read_bytes())
    surveyed.write_text("[" if change is None else json.dumps(record | change))
    assert failed(
        run("encode", slide, "-o", tmp_path / "a.reel", *FLAGS, "--survey", surveyed), "survey.json", "survey"
    )


def test_a_scene_is_not_encoded_in_parts(run, scan, tmp_path):
    assert run("survey", scan, "-o", tmp_path / "s.json", "--fps", "10").code == 0
    said = run(
        "encode", scan, "-o", tmp_path / "a.reel", "--fps", "10", "--survey", tmp_path / "s.json", "--frames", ":2"
    )
    assert failed(said, "a scene has one background", "--dynamic-only")
