"""Edits copy chunks: frames are the same before and after, to the bit, and nothing hidden is shown."""

import io
import json
import time
from dataclasses import astuple, replace
from pathlib import Path

import numpy as np
import pytest

import meshreel
from meshreel.coding.mesh import encode_intra
from meshreel.container.reader import ReelReader
from meshreel.container.sources import BytesSource
from meshreel.container.writer import ReelWriter, pack_head
from meshreel.edit.edits import concat, cut, retime, tag, transform
from meshreel.edit.metadata import MEANS
from meshreel.errors import FormatError, InputError
from meshreel.format.edit import is_rotation
from meshreel.format.layout import Header
from tests.decoder.test_chains import DATA
from tests.golden import GOLDEN, colored_record, frame_record
from tests.metrics.shapes import sphere

FILES = [GOLDEN / f"{name}.reel" for name in ("scene", "mixed", "layers", "laplacian", "cut", "joined")]
ALL = sorted(GOLDEN.rglob("*.reel"))
COLORED = sorted(GOLDEN.glob("colored/*.reel"))
TURN = np.array([[0.0, 0.6, 0.8], [1.0, 0.0, 0.0], [0.0, 0.8, -0.6]])


@pytest.fixture
def chains(tmp_path: Path) -> Path:
    """A file of two chains of groups, and of empty frames."""
    (path := tmp_path / "chains.reel").write_bytes(DATA)
    return path


def records(video: meshreel.Video) -> list[object]:
    return [frame_record(mesh) for mesh in video]


def flags_of(path: Path) -> int:
    return path.read_bytes()[9]


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
@pytest.mark.parametrize("frames", ["1:3", "2:", ":2", "-2:", "1:2", ":"])
def test_a_cut_shows_the_frames_that_were_asked_for_to_the_bit(tmp_path, path, frames):
    done, before = cut(path, tmp_path / "a.reel", frames), meshreel.open(path)
    begin, end = (int(part) if part else None for part in frames.split(":"))
    after = meshreel.open(tmp_path / "a.reel")
    assert records(after) == records(before)[begin:end] and len(after) == done.frames
    assert after.timestamps == pytest.approx(before.timestamps[begin:end], abs=1e-6)
    assert done.hidden + done.frames == sum(group.frame_count for group in after.reader.tracks[0])
    assert (flags_of(tmp_path / "a.reel") == 1) == (done.hidden > 0)
    for track in after.tracks:
        assert len(track) == len(after)


@pytest.mark.parametrize("frames", ["3:7", "4:9", "9:", "1:10"])
def test_a_cut_of_a_chain_keeps_only_what_it_needs(tmp_path, chains, frames):
    done = cut(chains, tmp_path / "a.reel", frames)
    begin, end = (int(part) if part else None for part in frames.split(":"))
    assert records(meshreel.open(tmp_path / "a.reel")) == records(meshreel.open(chains))[begin:end]
    at_keys = cut(chains, tmp_path / "b.reel", frames, at_keys=True)
    assert at_keys.hidden == 0 and flags_of(tmp_path / "b.reel") == 0 and at_keys.frames == done.frames + done.hidden
    again = cut(tmp_path / "a.reel", tmp_path / "c.reel", "1:3")
    assert records(meshreel.open(tmp_path / "c.reel")) == records(meshreel.open(tmp_path / "a.reel"))[1:3]
    assert again.frames == 2 and again.size <= done.size + 40  # its history is longer


@pytest.mark.parametrize("path", COLORED, ids=lambda path: path.stem)
def test_colours_and_pictures_stay_those_of_their_frames(tmp_path, path):
    pytest.importorskip("av", reason="textures need the extra color")
    before = meshreel.open(path)
    first = len(before) // 2
    cut(path, tmp_path / "a.reel", f"{first}:{first + 2}")
    after = meshreel.open(tmp_path / "a.reel")
    for k in range(2):
        assert colored_record(after, k) == colored_record(before, first + k)
        for one, other in zip(after.parts(k).values(), before.parts(first + k).values(), strict=True):
            assert (one.texture is None) == (other.texture is None)
            assert one.texture is None or np.array_equal(one.texture.pixels, other.texture.pixels)


def test_cuts_at_keys_join_to_the_frames_that_were_cut(tmp_path, chains):
    reader = meshreel.open(chains).reader
    (tmp_path / "known.reel").write_bytes(known(DATA))
    keys = [group.first_frame for group in reader.groups if reader.group_before(group) is None]
    ends = [*keys[1:], reader.frame_count]
    pieces = [tmp_path / f"{k}.reel" for k in range(len(keys))]
    for piece, first, end in zip(pieces, keys, ends, strict=True):
        assert cut(tmp_path / "known.reel", piece, f"{first}:{end}").hidden == 0
    assert concat(pieces, tmp_path / "whole.reel").frames == reader.frame_count
    whole = meshreel.open(tmp_path / "whole.reel")
    assert records(whole) == records(meshreel.open(chains))
    cuts = [f"cut {first}:{end}" for first, end in zip(keys, ends, strict=True)]
    assert whole.metadata["history"] == [*cuts, f"concat of {len(pieces)} files"] and whole.metadata["preset"] == "best"


def test_cuts_of_a_scene_are_joined_with_all_their_frames(tmp_path):
    before = meshreel.open(FILES[0])
    (tmp_path / "scene.reel").write_bytes(known(FILES[0].read_bytes(), {"preset": "best", "noise_m": 0.002}))
    cut(tmp_path / "scene.reel", tmp_path / "a.reel", ":1", at_keys=True)  # all of it: no group stands alone
    concat([tmp_path / "a.reel"] * 2, tmp_path / "b.reel")
    whole = meshreel.open(tmp_path / "b.reel")
    assert records(whole) == 2 * records(before) and whole.metadata["noise_m"] == 0.002
    assert "key_frames" not in whole.metadata


def test_a_cut_has_no_means_of_the_whole_file_and_joins_without_them(tmp_path):
    (tmp_path / "known.reel").write_bytes(known(DATA))
    cut(tmp_path / "known.reel", tmp_path / "a.reel", ":3")
    assert not meshreel.open(tmp_path / "a.reel").metadata.keys() & set(MEANS)
    concat([tmp_path / "known.reel", tmp_path / "known.reel"], tmp_path / "b.reel")
    assert meshreel.open(tmp_path / "b.reel").metadata["rms_m"] == 0.001
    cut(tmp_path / "known.reel", tmp_path / "c.reel", ":")
    assert meshreel.open(tmp_path / "c.reel").metadata["rms_m"] == 0.001


def test_what_was_least_covered_is_joined_dropped_by_cuts_and_believed_of_no_forger(tmp_path):
    (tmp_path / "a.reel").write_bytes(known(DATA, {"least_covered": [0.9, 1, 2]}))
    (tmp_path / "b.reel").write_bytes(known(DATA, {"least_covered": [0.8, 0, 4]}))
    concat([tmp_path / "a.reel", tmp_path / "b.reel"], tmp_path / "c.reel")
    count = meshreel.open(tmp_path / "a.reel").reader.frame_count
    assert meshreel.open(tmp_path / "c.reel").metadata["least_covered"] == [0.8, 0, count + 4]
    cut(tmp_path / "a.reel", tmp_path / "d.reel", "1:3")
    assert "least_covered" not in meshreel.open(tmp_path / "d.reel").metadata
    for forged in ([1e308, 0, 1], [0.5, -3, 1], [0.5, 0, 1.5], ["0.3", 0, 1], [0.5, 0], 1, [0.5, [1], 2]):
        (tmp_path / "b.reel").write_bytes(known(DATA, {"least_covered": forged}))
        with pytest.raises(InputError, match="metadata"):
            concat([tmp_path / "b.reel"] * 2, tmp_path / "e.reel")
    (tmp_path / "b.reel").write_bytes(known(DATA, dict.fromkeys(MEANS, 1e200)))
    with pytest.raises(InputError, match="metadata"):
        concat([tmp_path / "b.reel"] * 2, tmp_path / "e.reel")


def known(data: bytes, metadata: dict[str, object] | None = None) -> bytes:
    """A file with metadata as an encode writes them."""
    reader = ReelReader(BytesSource(data))
    means = {"rms_m": 0.001, "worst_rms_m": 0.002, "d2_psnr_paper": 60.0, "normal_error_deg": 1.0}
    text = json.dumps(metadata or {"preset": "best", "key_frames": [0, 5]} | means)
    header = replace(reader.header, metadata=text)
    return pack_head(header, reader.index) + data[reader.head_size :]


def test_hidden_frames_stay_hidden_in_the_middle_of_a_joined_file(tmp_path):
    (tmp_path / "known.reel").write_bytes(known(DATA))
    before, parts = records(meshreel.open(tmp_path / "known.reel")), [tmp_path / "a.reel", tmp_path / "b.reel"]
    hidden = sum(
        cut(tmp_path / "known.reel", part, frames).hidden for part, frames in zip(parts, ["6:9", "1:4"], strict=True)
    )
    joined = concat(parts, tmp_path / "c.reel")
    assert joined.hidden == hidden > 0 and joined.frames == 6 and flags_of(tmp_path / "c.reel") == 1
    assert records(meshreel.open(tmp_path / "c.reel")) == before[6:9] + before[1:4]
    cut(tmp_path / "c.reel", tmp_path / "d.reel", "2:5")
    assert records(meshreel.open(tmp_path / "d.reel")) == [before[8], *before[1:3]]
    cut(tmp_path / "c.reel", tmp_path / "e.reel", "3:5", at_keys=True)  # and no frame that the file hides
    assert [record for record in records(meshreel.open(tmp_path / "e.reel")) if record not in before[1:4]] == []


@pytest.mark.parametrize("path", ALL, ids=lambda path: f"{path.parent.stem}-{path.stem}")
@pytest.mark.parametrize("seed", range(2))
def test_cuts_at_random_frames_join_to_the_frames_that_were_cut(tmp_path, path, seed):
    pytest.importorskip("av", reason="textures need the extra color")
    before, random = meshreel.open(path), np.random.default_rng(seed)
    count = len(before)
    ends = [0, *sorted(random.choice(np.arange(1, count), min(3, count - 1), replace=False)), count]
    pieces = [tmp_path / f"{k}.reel" for k in range(len(ends) - 1)]
    for piece, first, end in zip(pieces, ends[:-1], ends[1:], strict=True):
        cut(path, piece, f"{first}:{end}")
        tag(piece, piece.with_suffix(".tagged.reel"), {"title": "one"})
    concat([piece.with_suffix(".tagged.reel") for piece in pieces], tmp_path / "whole.reel")
    check_same_frames(meshreel.open(tmp_path / "whole.reel"), before, range(count))
    for order in ([2, 0], [1, 1, 0]):
        chosen = [pieces[k % len(pieces)] for k in order]
        frames = [frame for k in order for frame in range(ends[k % len(pieces)], ends[k % len(pieces) + 1])]
        if before.audio is None:  # of which a file has one, at one time
            concat(chosen, tmp_path / "other.reel")
            check_same_frames(meshreel.open(tmp_path / "other.reel"), before, frames, False)


def check_same_frames(after: meshreel.Video, before: meshreel.Video, frames, timed: bool = True) -> None:
    assert len(after) == len(frames) and after.audio == before.audio
    if timed:
        assert after.timestamps == pytest.approx(before.timestamps, abs=2e-6 * len(frames))
    for k, frame in enumerate(frames):
        assert colored_record(after, k) == colored_record(before, frame), (k, frame)
        for one, other in zip(after.parts(k).values(), before.parts(frame).values(), strict=True):
            assert (one.texture is None) == (other.texture is None)
            assert one.texture is None or np.array_equal(one.texture.pixels, other.texture.pixels)
        one, other = after.splats(k), before.splats(frame)
        assert (one is None) == (other is None)
        assert one is None or all(np.array_equal(a, b) for a, b in zip(astuple(one), astuple(other), strict=True))


def test_of_tags_that_differ_the_first_is_kept_and_they_are_named(tmp_path):
    (tmp_path / "a.reel").write_bytes(known(DATA))
    tag(tmp_path / "a.reel", tmp_path / "b.reel", {"title": "b", "take": 1})
    tag(tmp_path / "a.reel", tmp_path / "c.reel", {"title": "c", "take": 1})
    done = concat([tmp_path / f"{name}.reel" for name in "abc"], tmp_path / "d.reel")
    metadata = meshreel.open(tmp_path / "d.reel").metadata
    assert (metadata["title"], metadata["take"], done.differing) == ("b", 1, ("title",))


def test_uneven_times_of_cuts_are_joined_as_they_were(tmp_path):
    before = meshreel.open(path := GOLDEN / "mixed.reel")
    pieces = [tmp_path / f"{frame}.reel" for frame in range(len(before))]
    for frame, piece in enumerate(pieces):
        cut(path, piece, f"{frame}:{frame + 1}")
    concat(pieces, tmp_path / "all.reel")
    assert meshreel.open(tmp_path / "all.reel").timestamps == before.timestamps
    for piece in pieces:
        retime(piece, piece.with_suffix(".slow.reel"), speed=0.5)
    concat([piece.with_suffix(".slow.reel") for piece in pieces], tmp_path / "slow.reel")
    steps = np.diff(meshreel.open(tmp_path / "slow.reel").timestamps)
    np.testing.assert_allclose(steps, 2 * np.diff(before.timestamps), atol=2e-6)


def test_six_hundred_frames_are_joined_within_a_second(tmp_path):
    header = Header(30.0, (0.0, 0.0, 0.0), 1.0, (-0.5,) * 3, (0.5,) * 3, "{}")
    payload, file = encode_intra([sphere(0.4)] * 20, 1e-4, 0), io.BytesIO()
    with ReelWriter(file, header) as writer:
        for group in range(3):
            writer.add_group(20 * group, 20, payload)
    parts = [tmp_path / f"{k}.reel" for k in range(10)]
    for part in parts:
        part.write_bytes(known(file.getvalue()))
    start = time.process_time()
    done = concat(parts, tmp_path / "whole.reel")
    assert time.process_time() - start < 1
    assert done.frames == 600 and done.size > 10 * 3 * len(payload)
    assert frame_record(meshreel.open(tmp_path / "whole.reel")[599]) == frame_record(meshreel.open(parts[0])[0])


@pytest.mark.parametrize("frames", [":", "2:6"])
def test_a_file_plays_at_another_rate_or_speed(tmp_path, chains, frames):
    cut(chains, tmp_path / "a.reel", frames)
    before = meshreel.open(tmp_path / "a.reel")
    retime(tmp_path / "a.reel", tmp_path / "b.reel", frame_rate=50)
    retime(tmp_path / "a.reel", tmp_path / "c.reel", speed=0.5)
    rated, slow = meshreel.open(tmp_path / "b.reel"), meshreel.open(tmp_path / "c.reel")
    assert records(rated) == records(slow) == records(before)
    assert rated.frame_rate == 50 and rated.duration == pytest.approx(len(before) / 50)
    assert slow.duration == pytest.approx(2 * before.duration)
    assert slow.metadata["history"][-1] == "retime by 0.5"


def test_frames_with_times_of_their_own_keep_them_through_cuts_speeds_and_joins(tmp_path):
    reader = ReelReader(BytesSource(DATA))
    steps = tuple(30_000 + 1000 * k for k in range(reader.frame_count - 1))
    header = replace(reader.header, intervals=steps)
    (tmp_path / "timed.reel").write_bytes(known(pack_head(header, reader.index) + DATA[reader.head_size :]))
    before = meshreel.open(tmp_path / "timed.reel").timestamps
    cut(tmp_path / "timed.reel", tmp_path / "a.reel", "2:6")
    assert meshreel.open(tmp_path / "a.reel").timestamps == pytest.approx(before[2:6])
    retime(tmp_path / "timed.reel", tmp_path / "b.reel", speed=2)
    assert meshreel.open(tmp_path / "b.reel").timestamps == pytest.approx([t / 2 for t in before])
    concat([tmp_path / "timed.reel"] * 2, tmp_path / "c.reel")
    both = meshreel.open(tmp_path / "c.reel").timestamps
    gap = before[-1] + 1 / reader.frame_rate
    assert both == pytest.approx([*before, *(gap + t for t in before)], abs=1e-6)


@pytest.mark.parametrize("path", [*FILES, GOLDEN / "splats" / "splats.reel"], ids=lambda path: path.stem)
def test_a_transform_moves_every_part_and_the_box_with_it(tmp_path, path):
    move, before = np.array([3.0, -2.0, 5.0]), meshreel.open(path)
    transform(path, tmp_path / "a.reel", 2.0, TURN, move)
    after = meshreel.open(tmp_path / "a.reel")
    assert flags_of(tmp_path / "a.reel") == 1
    corners = np.array(
        [[box[k] for box, k in zip(np.array(before.box).T, at, strict=True)] for at in np.ndindex(2, 2, 2)]
    )
    corners = 2.0 * corners @ TURN.T + move
    np.testing.assert_allclose(after.box, [corners.min(axis=0), corners.max(axis=0)], rtol=1e-12, atol=1e-9)
    for k, mesh in enumerate(before):
        wanted = 2.0 * mesh.vertices @ TURN.T + move
        assert np.abs(after[k].vertices - wanted).max(initial=0) < 1e-9 * max(1, np.abs(wanted).max(initial=0))
        assert np.array_equal(after[k].faces, mesh.faces)
        for one, other in zip(after.parts(k).values(), before.parts(k).values(), strict=True):
            assert one.vertices.shape == other.vertices.shape
        if (bound := before.splats(k)) is not None:
            np.testing.assert_allclose(after.splats(k).means, 2.0 * bound.means @ TURN.T + move, atol=1e-6)
    transform(tmp_path / "a.reel", tmp_path / "b.reel", 0.5, TURN.T, -0.5 * TURN.T @ move)
    back = meshreel.open(tmp_path / "b.reel")
    assert flags_of(tmp_path / "b.reel") == flags_of(path)  # turned back: any reader may have it
    assert np.abs(back[0].vertices - before[0].vertices).max(initial=0) < 1e-6


def test_what_the_metadata_have_in_metres_is_scaled_with_the_frames(tmp_path):
    part = {"first_frame": 0, "of": 9, "totals": [4.0, 0.5, 60.0, None], "options": ""}
    (tmp_path / "a.reel").write_bytes(known(DATA, {"rms_m": 0.002, "noise_m": None, "take": 3, "part": part}))
    transform(tmp_path / "a.reel", tmp_path / "b.reel", 0.5)
    found = meshreel.open(tmp_path / "b.reel").metadata
    del found["history"]
    part = part | {"totals": [1.0, 0.25, 60.0, None]}
    assert found == {"rms_m": 0.001, "noise_m": None, "take": 3, "part": part}


def test_rotations_after_one_another_are_still_a_rotation(tmp_path, chains):
    angle, places = np.radians(10), [tmp_path / "a.reel", tmp_path / "b.reel"]
    step = np.array([[np.cos(angle), 0, np.sin(angle)], [0, 1, 0], [-np.sin(angle), 0, np.cos(angle)]])
    step = np.round(step, 7)  # as a user may type it: 40 such products are off by more than a reader takes
    assert not is_rotation(np.linalg.matrix_power(step, 40).ravel().tolist())
    places[1].write_bytes(chains.read_bytes())
    for k in range(40):
        transform(places[1 - k % 2], places[k % 2], rotation=step)
    turn = np.array(meshreel.open(places[1]).reader.edit.rotation).reshape(3, 3)
    assert np.abs(turn @ turn.T - np.eye(3)).max() < 1e-14


def test_the_axis_that_points_up_is_named_where_it_is_not_y(tmp_path, chains):
    transform(chains, tmp_path / "a.reel", up="z")
    transform(tmp_path / "a.reel", tmp_path / "b.reel", up="y")
    assert meshreel.open(tmp_path / "a.reel").metadata["up"] == "z"
    assert "up" not in meshreel.open(tmp_path / "b.reel").metadata


def test_an_item_without_its_flag_does_not_come_to_count(tmp_path):
    (tmp_path / "a.reel").write_bytes(known(DATA, {"edit": {"frames": [1, 3]}}))
    for k, change in enumerate([lambda a, b: tag(a, b, {"x": 1}), lambda a, b: retime(a, b, speed=2)]):
        change(tmp_path / "a.reel", tmp_path / f"b{k}.reel")
        assert records(meshreel.open(tmp_path / f"b{k}.reel")) == records(meshreel.open(DATA))
        assert "edit" not in meshreel.open(tmp_path / f"b{k}.reel").metadata
    cut(FILES[0], tmp_path / "c.reel", "3:5")
    tag(tmp_path / "c.reel", tmp_path / "d.reel", {"x": 1})
    assert len(meshreel.open(tmp_path / "d.reel")) == 2


def test_scale_and_translation_are_for_every_reader_and_up_is_a_name(tmp_path):
    transform(FILES[0], tmp_path / "a.reel", 0.001, translation=(0, 1, 0), up="z")
    before, after = meshreel.open(FILES[0]), meshreel.open(tmp_path / "a.reel")
    assert flags_of(tmp_path / "a.reel") == 0 and after.up == "z" and after.reader.edit.rotation == ()
    np.testing.assert_allclose(after[3].vertices, 0.001 * before[3].vertices + [0, 1, 0], atol=1e-9)


def test_tags_are_added_and_taken_away_and_those_that_readers_use_are_not(tmp_path):
    tag(FILES[0], tmp_path / "a.reel", {"title": "Grüße", "take": 3})
    tag(tmp_path / "a.reel", tmp_path / "b.reel", {"take": None, "rights": ["x"]})
    video = meshreel.open(tmp_path / "b.reel")
    assert video.metadata == meshreel.open(FILES[0]).metadata | {"title": "Grüße", "rights": ["x"]}
    assert records(video) == records(meshreel.open(FILES[0]))
    for name in ("up", "edit", "part", "key_frames", "history", "least_covered", "quality", "noise_m", "rms_m", ""):
        with pytest.raises(InputError, match="is no name for a tag"):
            tag(FILES[0], tmp_path / "c.reel", {name: 1})
    for value in ({1, 2}, float("nan")):
        with pytest.raises(InputError, match="JSON cannot hold"):
            tag(FILES[0], tmp_path / "c.reel", {"x": value})
    with pytest.raises(InputError, match=r"metadata of 70\d+ bytes: a file holds 65535"):
        tag(FILES[0], tmp_path / "c.reel", {"x": "y" * 70_000})
    assert not (tmp_path / "c.reel").exists()


@pytest.mark.parametrize(
    ("call", "text"),
    [
        (lambda a, b: cut(a, b, "20:30"), "leave 0"),
        (lambda a, b: cut(a, b, "1:30"), "frames 1:30 of 14 frames; give numbers from 0 to 14"),
        (lambda a, b: cut(a, b, "-20:"), "frames -20: of 14 frames"),
        (lambda a, b: cut(a, b, "x"), "is not a range"),
        (lambda a, b: retime(a, b), "a frame rate or a speed"),
        (lambda a, b: retime(a, b, 25, 2), "a frame rate or a speed"),
        (lambda a, b: retime(a, b, speed=0), "speed 0: give a number"),
        (lambda a, b: retime(a, b, float("nan")), "frame rate nan: give a number"),
        (lambda a, b: transform(a, b, 0), "scale 0: give a number"),
        (lambda a, b: transform(a, b, rotation=[[1, 0], [0, 1]]), "rotation .* give 3 x 3 finite numbers"),
        (lambda a, b: transform(a, b, rotation=[[1, 0], [0]]), "rotation .* give 3 x 3 finite numbers"),
        (lambda a, b: transform(a, b, rotation=np.full((3, 3), np.nan)), "rotation .* give 3 x 3 finite numbers"),
        (lambda a, b: transform(a, b, translation=(1.0, 2.0)), "translation .*: give 3 finite numbers"),
        (lambda a, b: transform(a, b, translation=(0, 0, np.inf)), "translation .* give 3 finite numbers"),
        (lambda a, b: transform(a, b, rotation=np.diag([1, 1, -1])), "three rows of a rotation"),
        (lambda a, b: transform(a, b, translation=(1e300, 0, 0)), "cannot be stored"),
        (lambda _, b: concat([], b), "no files to join"),
        (lambda a, _: tag(a, a, {"x": 1}), "is the input"),
        (lambda _, b: tag("nowhere.reel", b, {"x": 1}), "nowhere.reel: cannot be opened"),
    ],
)
def test_what_cannot_be_done_is_said_and_leaves_nothing(tmp_path, call, text):
    (tmp_path / "a.reel").write_bytes(FILES[0].read_bytes())
    with pytest.raises(InputError, match=text):
        call(tmp_path / "a.reel", tmp_path / "b.reel")
    assert [path.name for path in tmp_path.iterdir()] == ["a.reel"]
    assert (tmp_path / "a.reel").read_bytes() == FILES[0].read_bytes()


@pytest.mark.parametrize("edit", [lambda a, b: cut(a, b, "3:9"), lambda a, b: tag(a, b, {"x": 1})])
def test_every_truncation_and_every_flipped_byte_is_a_format_error_or_the_same_frames(tmp_path, edit):
    data, source, output = FILES[0].read_bytes(), tmp_path / "a.reel", tmp_path / "b.reel"
    edit(FILES[0], output)
    wanted = records(meshreel.open(output))
    for at in range(0, len(data), 61):
        for damaged in (data[:at], data[:at] + bytes([data[at] ^ 0x10]) + data[at + 1 :]):
            output.unlink(missing_ok=True)
            source.write_bytes(damaged)
            try:
                edit(source, output)
            except FormatError as error:
                assert str(source) in str(error) and not output.exists()
                continue
            assert records(meshreel.open(output)) == wanted  # the damage is in a chunk that is not kept


def test_without_its_flag_an_edit_is_metadata_like_others_and_other_flags_are_refused():
    data = bytearray(pack_head(ReelReader(BytesSource(DATA)).header, ReelReader(BytesSource(DATA)).index))
    with pytest.raises(FormatError, match="flags 2: this reader knows 1 alone"):
        meshreel.open(bytes([*data[:9], 2, *data[10:]]))


def test_a_view_is_tagged_in_metres_and_moves_with_the_file(tmp_path):
    view = [0.5, 1.6, 3.0, 0.0, 1.0, 0.25, 60.0]
    tag(GOLDEN / "scene.reel", tmp_path / "a.reel", view=view)
    found = meshreel.open(tmp_path / "a.reel").view
    assert found is not None and [*found.position, *found.target, found.fov] == pytest.approx(view, abs=1e-6)
    transform(tmp_path / "a.reel", tmp_path / "b.reel", 2.0, TURN, (1.0, 2.0, 3.0))
    cut(tmp_path / "b.reel", tmp_path / "c.reel", "2:5")
    moved = meshreel.open(tmp_path / "c.reel").view
    assert moved is not None and moved.fov == 60.0
    for place, before in ((moved.position, view[:3]), (moved.target, view[3:6])):
        np.testing.assert_allclose(place, 2 * TURN @ before + [1.0, 2.0, 3.0], atol=1e-9)
    tag(tmp_path / "c.reel", tmp_path / "d.reel", view=[*moved.position, *moved.target])
    again = meshreel.open(tmp_path / "d.reel").view
    assert again is not None and again.position == pytest.approx(moved.position) and again.fov == 45.0


@pytest.mark.parametrize(
    ("view", "message"),
    [
        ([0, 0, 0, 0, 0], "give 7 finite numbers"),
        ([0, 0, 3, 0, 0, float("nan")], "give 7 finite numbers"),
        ([0, 0, 3, 0, 0, 3], "position and target are the same"),
        ([0, 0, 3, 0, 0, 1e30], "too far away"),
        ([0, 0, 3, 0, 0, 0, 180], "180 degrees"),
        ([0, 0, 3, 0, 0, 0, 0], "0 degrees"),
    ],
)
def test_a_view_that_no_file_may_have_is_refused(tmp_path, view, message):
    with pytest.raises(InputError, match=message):
        tag(GOLDEN / "scene.reel", tmp_path / "a.reel", view=view)
    assert not (tmp_path / "a.reel").exists()


def test_the_name_of_the_view_is_no_name_for_a_tag(tmp_path):
    with pytest.raises(InputError, match="'view' is no name for a tag"):
        tag(GOLDEN / "scene.reel", tmp_path / "a.reel", {"view": "front"})
