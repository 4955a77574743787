"""Scenes: a frame is its background and its moving bodies, each decoded separately and only when needed."""

import io
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import meshreel
from meshreel.coding.background import decode_background, decode_change, encode_background, encode_change
from meshreel.coding.layers.coder import encode_layers
from meshreel.coding.mesh import decode_intra, encode_empty, encode_intra
from meshreel.container.writer import ReelWriter
from meshreel.decoder import cache, tracks
from meshreel.errors import FormatError
from meshreel.format.layout import ChunkKind
from meshreel.geometry.topology import concatenate
from meshreel.types import Mesh, Placement
from tests.coding.bodies import ball, moving
from tests.coding.paper.test_laplacian import icosahedron
from tests.container.files import HEADER, Counted
from tests.golden import GOLDEN, frame_record

SCENE = (GOLDEN / "scene.reel").read_bytes()  # chunks 0 and 3 static, 1, 5, 8 of track 0, 2, 4, 6, 7 of track 1
WHOLE = [frame_record(mesh) for mesh in meshreel.open(SCENE)]
COUNT = len(WHOLE)
CHANGED = 4  # the first frame that is shown with the second state of the background
CHUNKS = meshreel.open(SCENE).reader.chunks
TRACKS = [list(track) for track in meshreel.open(SCENE).tracks]
VISITS = range(4, 9)  # frames that the second body is there


STEP = 0.001
BODIES = [Mesh.of(0.3 * icosahedron(k).vertices - k, icosahedron(k).faces) for k in range(3)]
FLOOR = encode_background(icosahedron(1), STEP)
ONE = decode_background(FLOOR)
COME = encode_change(ONE, np.zeros(len(ONE.faces), bool), BODIES[2], STEP)
TWO = decode_change(COME, ONE)
GO = encode_change(TWO, np.arange(len(TWO.faces)) % 3 == 0, Mesh.empty(), STEP)
STATES, BACKGROUNDS = (FLOOR, COME, GO), (ONE, TWO, decode_change(GO, TWO))


class CountedChunks(Counted):
    """Remembers which chunks were read."""

    def read(self) -> list[int]:
        """The chunks read since the last call."""
        numbers = [chunk.number for offset, _ in self.ranges for chunk in CHUNKS if chunk.offset == offset]
        self.ranges.clear()
        return numbers


def test_a_frame_is_its_background_and_then_its_tracks():
    video = meshreel.open(SCENE)
    for frame in range(COUNT):
        parts = video.parts(frame)
        assert list(parts) == ["background", "track 0", "track 1"]
        vertices = np.concatenate([mesh.vertices for mesh in parts.values()])
        starts = np.cumsum([0, *(len(mesh.vertices) for mesh in parts.values())])
        faces = np.concatenate([mesh.faces + start for mesh, start in zip(parts.values(), starts, strict=False)])
        np.testing.assert_array_equal(video[frame].vertices, vertices)
        np.testing.assert_array_equal(video[frame].faces, faces)
        assert parts["track 1"].is_empty == (frame not in VISITS)


def test_parts_are_what_is_kept_and_not_copies():
    video = meshreel.open(SCENE)
    first, later = video.parts(0), video.parts(1)
    assert first["background"] is later["background"] is video.background(2)
    assert video.parts(1)["track 0"] is later["track 0"] is video.tracks[0][1]
    assert np.shares_memory(first["track 0"].faces, later["track 0"].faces)


def test_what_moves_and_what_does_not_can_be_had_alone():
    video = meshreel.open(SCENE)
    for frame in range(COUNT):
        parts = video.parts(frame)
        np.testing.assert_array_equal(video.background(frame).vertices, parts["background"].vertices)
        together = len(parts["track 0"].vertices) + len(parts["track 1"].vertices)
        assert len(video.moving(frame).vertices) == together
    assert video.background(-1) is video.background(COUNT - 1)
    for look in (video.background, video.moving, video.parts):
        for index in (COUNT, -COUNT - 1):
            with pytest.raises(IndexError, match="14 frames"):
                look(index)


def test_a_file_of_one_sequence_has_one_track_and_no_background():
    video = meshreel.open(GOLDEN / "mixed.reel")
    assert len(video.tracks) == 1 and not video.reader.has_background and video.reader.has_moving
    assert list(video.parts(3)) == ["track 0"]
    assert video.parts(3)["track 0"] is video.tracks[0][3]
    assert frame_record(video[3]) == frame_record(video.moving(3)) == frame_record(video.tracks[0][3])
    assert video.background(3).is_empty
    nothing = meshreel.open(GOLDEN / "empty.reel")
    assert not nothing.reader.has_background and not nothing.reader.has_moving


def test_parts_of_a_scene_cannot_be_written_to_and_its_frames_belong_to_the_caller():
    video = meshreel.open(SCENE)
    for frame in range(COUNT):
        for mesh in (video.background(frame), *video.parts(frame).values()):
            for array in (mesh.vertices, mesh.faces):
                with pytest.raises(ValueError, match="read-only"):
                    array += 1
        for mesh in (video[frame], video.moving(frame)):
            mesh.vertices[:] += 1.0
            mesh.faces[:] = 0
        assert frame_record(video[frame]) == WHOLE[frame]


@pytest.mark.parametrize("seed", range(4))
def test_frames_of_a_scene_in_any_order_are_those_of_the_sequence_to_the_bit(seed: int):
    video = meshreel.open(SCENE)
    for frame in np.random.default_rng(seed).permutation(COUNT).tolist():
        assert frame_record(video[frame]) == WHOLE[frame]


def test_playing_reads_every_chunk_once():
    source = CountedChunks(SCENE)
    video = meshreel.open(source)
    source.read()
    assert [frame_record(mesh) for mesh in video] == WHOLE
    assert sorted(source.read()) == list(range(len(CHUNKS)))


def test_a_frame_asked_for_first_reads_what_it_needs_and_no_more():
    wanted = {0: {0, 1, 2}, 5: {0, 3, 1, 4}, 7: {0, 3, 1, 5, 4, 6}, 12: {0, 3, 1, 5, 8, 7}}
    for frame, chunks in wanted.items():
        source = CountedChunks(SCENE)
        video = meshreel.open(source)
        source.read()
        video[frame]
        found = source.read()
        assert set(found) == chunks and len(found) == len(chunks)


def test_what_moves_is_had_without_the_background_and_the_other_way_round():
    source = CountedChunks(SCENE)
    video = meshreel.open(source)
    source.read()
    video.moving(5)
    assert set(source.read()) == {1, 4}
    video.background(5)
    assert source.read() == [0, 3]
    video.tracks[1][8]
    assert source.read() == [6]


def test_a_background_is_decoded_once_while_it_is_shown():
    source = CountedChunks(SCENE)
    video = meshreel.open(source)
    source.read()
    states = [video.background(frame) for frame in (*range(COUNT), 2, 12)]
    assert source.read() == [0, 3, 0, 3]  # the state before the change is not kept behind it
    assert len({id(mesh) for mesh in states[:CHANGED]}) == len({id(mesh) for mesh in states[CHANGED:COUNT]}) == 1
    assert len(states[0].faces) != len(states[-1].faces)


@pytest.mark.parametrize("layers", [0, 1, 2, 9])
def test_a_coarser_scene_has_its_whole_background(layers: int):
    whole, coarse = meshreel.open(SCENE), meshreel.open(SCENE).at(layers)
    for frame in (0, 6, 8, 12):
        few, all = coarse.parts(frame), whole.parts(frame)
        np.testing.assert_array_equal(few["background"].vertices, all["background"].vertices)
        for name in ("track 0", "track 1"):
            count = len(few[name].vertices)
            np.testing.assert_array_equal(few[name].vertices, all[name].vertices[:count])
            assert layers > 0 or count < len(all[name].vertices) or count == 0


NEEDED = {0: range(COUNT), 1: range(COUNT), 2: range(4), 3: range(CHANGED, COUNT), 4: VISITS, 5: range(6, COUNT)} | {
    6: range(7, 9),
    7: range(9, COUNT),
    8: range(10, COUNT),
}  # frames that need each chunk


@pytest.mark.parametrize("damaged", range(len(CHUNKS)))
def test_damage_costs_the_frames_that_need_it_and_the_error_names_chunk_track_and_frames(damaged: int):
    data, chunk = bytearray(SCENE), CHUNKS[damaged]
    data[chunk.end - 1] ^= 1
    video = meshreel.open(bytes(data))
    static = chunk.kind == ChunkKind.STATIC
    named = rf"chunk {damaged} \(static\)" if static else rf"chunk {damaged} \(track {chunk.track}, frames "
    for frame in range(COUNT):
        if frame not in NEEDED[damaged]:
            assert frame_record(video[frame]) == WHOLE[frame]
            continue
        with pytest.raises(FormatError, match=named + rf".*checksum|background of frame {frame}: {named}"):
            video[frame]
        if static:
            assert len(video.moving(frame).vertices) > 0
        else:
            assert not video.background(frame).is_empty
            other = 1 - chunk.track
            np.testing.assert_array_equal(video.tracks[other][frame].vertices, TRACKS[other][frame].vertices)


@pytest.mark.parametrize("number", range(len(CHUNKS)))
def test_of_a_scene_that_is_cut_short_what_is_there_decodes(number: int):
    cut = CHUNKS[number].end - 1
    video = meshreel.open(SCENE[:cut])
    lost = {frame for chunk in range(number, len(CHUNKS)) for frame in NEEDED[chunk]}
    for frame in range(COUNT):
        if frame in lost:
            with pytest.raises(FormatError, match="truncated"):
                video[frame]
        else:
            assert frame_record(video[frame]) == WHOLE[frame]


def test_while_a_scene_arrives_each_frame_plays_before_a_group_that_begins_behind_it():
    for frame in range(COUNT):
        there = next((c.offset for c in CHUNKS if c.first_frame > frame), len(SCENE))
        assert frame_record(meshreel.open(SCENE[:there])[frame]) == WHOLE[frame]


@st.composite
def plans(draw) -> list[list[tuple[int, bool, int | None]]]:
    """For each track its groups: frames, whether the body is there, and the state of the background that it names."""
    length = draw(st.integers(1, 12))
    made = []
    for _ in range(draw(st.integers(1, 3))):
        cuts = sorted(draw(st.sets(st.integers(1, max(length - 1, 1)), max_size=3)) - {length})
        sizes = [b - a for a, b in pairwise([0, *cuts, length])]
        made.append([(size, draw(st.booleans()), draw(st.sampled_from([None, 0, 1, 2]))) for size in sizes])
    return made


@settings(max_examples=60)
@given(plans(), st.randoms())
def test_any_scene_is_frame_by_frame_the_newest_background_and_the_bodies_that_are_there(plan, random):
    file = io.BytesIO()
    placed = [
        (sum(group[0] for group in groups[:k]), track, *groups[k])
        for track, groups in enumerate(plan)
        for k in range(len(groups))
    ]
    with ReelWriter(file, HEADER) as writer:
        for payload, before in zip(STATES, [(), (0,), (1,)], strict=True):
            writer.add_static(payload, depends_on=before)
        for first, track, size, there, state in sorted(placed):
            payload = encode_intra([BODIES[track]] * size, STEP, 0) if there else encode_empty()
            writer.add_group(first, size, payload, (), () if state is None else (state,), track)
    video = meshreel.open(file.getvalue())
    frames = list(range(len(video)))
    random.shuffle(frames)
    for frame in frames:
        own = [group for group in placed if group[0] <= frame < group[0] + group[2]]
        named = [state for *_, state in own if state is not None]
        parts = [BACKGROUNDS[max(named)]] if named else []
        wanted = concatenate([*parts, *(decode_intra(encode_intra([BODIES[g[1]]], STEP, 0))[0] for g in own if g[3])])
        np.testing.assert_array_equal(video[frame].vertices, Placement(HEADER.scale, HEADER.origin).of(wanted).vertices)
        np.testing.assert_array_equal(video[frame].faces, wanted.faces)
        assert ("background" in video.parts(frame)) == bool(named)
        assert [not mesh.is_empty for mesh in video.parts(frame).values()][len(parts) :] == [g[3] for g in own]


def test_threads_that_share_a_scene_get_the_frames_they_asked_for():
    video = meshreel.open(SCENE)
    frames = np.random.default_rng(0).integers(0, COUNT, 60).tolist()
    with ThreadPoolExecutor(4) as executor:
        found = list(executor.map(lambda frame: frame_record(video[frame]), frames))
    assert found == [WHOLE[frame] for frame in frames]


def chains(count: int) -> bytes:
    """A file of so many tracks, each a chain of three groups."""
    file, reference = io.BytesIO(), ball()
    states = [None] * count
    with ReelWriter(file, HEADER) as writer:
        for group in range(3):
            for track in range(count):
                coded = encode_layers(reference, moving(reference, 2, 2 * group + track), previous=states[track])
                before = () if group == 0 else (writer.last_of(track),)
                writer.add_group(2 * group, 2, coded.payload, coded.layers, before, track)
                states[track] = coded.state
    return file.getvalue()


@pytest.mark.parametrize("most", [0, 200_000])
def test_all_tracks_together_keep_no_more_than_one_alone_would(monkeypatch: pytest.MonkeyPatch, most: int):
    data = chains(3)
    whole = [frame_record(mesh) for mesh in meshreel.open(data)]
    alone = meshreel.open(data).tracks[0]
    alone[0]
    monkeypatch.setattr(tracks, "MOST_KEPT", most)
    video = meshreel.open(data)
    for frame in [*range(6), *reversed(range(6)), 1, 5, 3]:
        assert frame_record(video[frame]) == whole[frame]
        kept = [track._states.nbytes for track in video.tracks]
        assert sum(kept) <= max(most, 3 * alone._states.nbytes)
        assert most > 0 or [len(track._states.known) for track in video.tracks] == [1, 1, 1]


def test_tracks_read_one_by_one_keep_no_more_groups_than_a_frame_may_have(monkeypatch: pytest.MonkeyPatch):
    video = meshreel.open(chains(3))
    size = video.tracks[0].memory(0) + video.tracks[0]._states.nbytes
    monkeypatch.setattr(cache, "MOST_TOGETHER", 2 * size)
    for track in video.tracks:
        assert len(track[0].vertices) == len(ball().base.vertices)
    assert [track._group is None for track in video.tracks] == [True, False, False]  # the oldest goes
    monkeypatch.setattr(cache, "MOST_TOGETHER", 0)
    assert len(video.tracks[0][3].vertices) > 0
    assert [track._group is None for track in video.tracks] == [False, True, True]


def test_groups_that_together_are_too_large_are_refused_and_each_is_still_there(monkeypatch: pytest.MonkeyPatch):
    video = meshreel.open(chains(3))
    size = video.tracks[0].memory(0)
    first, second = video.tracks[0][0], video.tracks[0][1]
    assert size == first.vertices.nbytes + second.vertices.nbytes + first.faces.nbytes  # which both share
    monkeypatch.setattr(cache, "MOST_TOGETHER", 3 * size)
    assert len(video[0].vertices) == 3 * len(ball().base.vertices)
    monkeypatch.setattr(cache, "MOST_TOGETHER", 3 * size - 1)
    with pytest.raises(FormatError, match="frame 0: its groups of tracks 0 to 2 take"):
        video[0]
    monkeypatch.setattr(cache, "MOST_TOGETHER", 0)
    assert [len(track[0].vertices) for track in video.tracks] == [len(ball().base.vertices)] * 3
    assert len(meshreel.open(GOLDEN / "layers.reel")[0].vertices) > 0  # one track may be as large as its group may
