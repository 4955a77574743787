"""Groups that are predicted from the one before: any frame in any order, coarser on demand, damage, threads."""

import io
from itertools import pairwise

import numpy as np
import pytest

import meshreel
from meshreel import _core
from meshreel.coding.layers.coder import encode_layers
from meshreel.coding.mesh import encode_empty
from meshreel.container.reader import ReelReader
from meshreel.container.sources import BytesSource
from meshreel.container.writer import ReelWriter
from meshreel.decoder import tracks
from meshreel.decoder.cache import CachedGroup, CachedStates
from meshreel.decoder.pictures import Decoders
from meshreel.decoder.tracks import Track
from meshreel.errors import FormatError
from meshreel.format.layout import Header
from tests.coding.bodies import ball, moving
from tests.container.files import Counted
from tests.golden import frame_record

LENGTHS = (3, 2, 4, 2, 3)
KEYS = (True, False, False, True, False)  # which groups stand alone
EMPTY = 2  # frames without surface behind them
HEADER = Header(25.0, (0.5, 1.0, -2.0), 1.8, (-0.5,) * 3, (0.5,) * 3, "{}")


def made() -> bytes:
    """A file of two chains, and of empty frames."""
    file, reference, state = io.BytesIO(), ball(), None
    with ReelWriter(file, HEADER) as writer:
        for length, key in zip(LENGTHS, KEYS, strict=True):
            before = () if key or writer.last_of(0) is None else (writer.last_of(0),)
            wanted = moving(reference, length, writer.frames_of(0))
            coded = encode_layers(reference, wanted, previous=state if before else None)
            writer.add_group(writer.frames_of(0), length, coded.payload, coded.layers, before)
            state = coded.state
        writer.add_group(writer.frames_of(0), EMPTY, encode_empty())
    return file.getvalue()


DATA = made()
WHOLE = [frame_record(mesh) for mesh in meshreel.open(DATA)]
COUNT = sum(LENGTHS) + EMPTY


def test_a_group_may_need_the_one_before_and_says_so():
    groups = meshreel.open(DATA).reader.groups
    assert [group.depends_on for group in groups] == [(), (0,), (1,), (), (3,), ()]


@pytest.mark.parametrize("seed", range(4))
def test_frames_in_any_order_are_those_of_the_sequence_to_the_bit(seed: int):
    video = meshreel.open(DATA)
    for frame in np.random.default_rng(seed).permutation(COUNT).tolist():
        assert frame_record(video[frame]) == WHOLE[frame]


@pytest.mark.parametrize("frame", range(COUNT))
def test_a_frame_asked_for_first_is_the_same(frame: int):
    assert frame_record(meshreel.open(DATA)[frame]) == WHOLE[frame]


def test_a_frame_costs_its_chain_and_the_next_group_only_itself():
    source = Counted(DATA)
    video = meshreel.open(source)
    offsets = [group.offset for group in video.reader.groups]
    source.ranges.clear()
    video[3]
    assert [offset for offset, _ in source.ranges] == offsets[:2]
    video[5]
    assert [offset for offset, _ in source.ranges] == offsets[:3]
    video[11]
    assert [offset for offset, _ in source.ranges] == [*offsets[:3], *offsets[3:5]]


def test_a_frame_asked_for_first_places_the_frames_of_its_own_group_alone(monkeypatch: pytest.MonkeyPatch):
    placed, decode = list[int](), _core.Group

    def count(data: bytes, frames: int, *arguments: object, shown: bool = True) -> object:
        placed.extend([frames] * shown)
        return decode(data, frames, *arguments, shown=shown)

    monkeypatch.setattr(_core, "Group", count)
    assert frame_record(meshreel.open(DATA)[8]) == WHOLE[8]
    assert placed == [LENGTHS[2]]


@pytest.mark.parametrize("layers", [0, 1, 2, 9])
def test_a_coarser_video_has_the_first_vertices_of_the_whole(layers: int):
    whole, coarse = meshreel.open(DATA), meshreel.open(DATA).at(layers)
    for frame in [11, 8, 2, 4]:  # the last is predicted from the one before, which was not kept
        few, all = coarse[frame].vertices, whole[frame].vertices
        assert len(few) == len(all) if layers > 1 else len(few) < len(all) / 3
        np.testing.assert_array_equal(few, all[: len(few)])


def test_whole_and_coarser_videos_of_one_file_do_not_disturb_each_other():
    whole = meshreel.open(DATA)
    coarse = whole.at(0)
    for frame in (1, 4, 7):
        assert frame_record(whole[frame]) == WHOLE[frame]
        assert len(coarse[frame].vertices) == len(ball().mesh.vertices)


@pytest.mark.parametrize("damaged", range(5))
def test_damage_costs_the_groups_that_depend_on_it_and_the_error_names_it(damaged: int):
    groups = meshreel.open(DATA).reader.groups
    data = bytearray(DATA)
    data[groups[damaged].end - 1] ^= 1
    lost = {0: {0, 1, 2}, 1: {1, 2}, 2: {2}, 3: {3, 4}, 4: {4}}[damaged]
    first = groups[damaged].first_frame
    video = meshreel.open(bytes(data))
    for group in groups:
        for frame in range(group.first_frame, group.first_frame + group.frame_count):
            if group.number in lost:
                with pytest.raises(FormatError, match=rf"chunk {damaged} \(frames {first} to"):
                    video[frame]
            else:
                assert frame_record(video[frame]) == WHOLE[frame]


def test_where_only_the_finest_layer_is_damaged_the_coarser_ones_still_decode():
    groups = meshreel.open(DATA).reader.groups
    data = bytearray(DATA)
    data[groups[0].end - 1] ^= 1
    video = meshreel.open(bytes(data)).at(1)
    for frame in range(sum(LENGTHS[:3])):
        np.testing.assert_array_equal(video[frame].vertices, meshreel.open(DATA).at(1)[frame].vertices)


def test_an_index_that_hides_the_dependence_is_refused_at_the_group():
    file = io.BytesIO()
    with ReelWriter(file, HEADER) as writer:
        for group in (reader := meshreel.open(DATA).reader).groups[:2]:
            writer.add_group(group.first_frame, group.frame_count, reader.read_chunk(group.number))
    video = meshreel.open(file.getvalue())
    assert frame_record(video[2]) == WHOLE[2]
    with pytest.raises(FormatError, match=r"chunk 1 \(frames 3 to 4\): .*not at hand"):
        video[3]


def test_a_group_that_depends_on_one_without_layers_is_refused():
    file = io.BytesIO()
    reader = meshreel.open(DATA).reader
    with ReelWriter(file, HEADER) as writer:
        writer.add_group(0, 2, encode_empty())
        writer.add_group(2, LENGTHS[1], reader.read_chunk(1), (), (0,))
    with pytest.raises(FormatError, match="not at hand"):
        meshreel.open(file.getvalue())[2]


class Contended(Track):
    """As if another thread had always just put group 1 in the place of the last one."""

    @property
    def _group(self) -> CachedGroup:
        video = meshreel.open(DATA)
        video[3]
        return video.tracks[0]._group

    @_group.setter
    def _group(self, group: CachedGroup | None) -> None:
        pass


def test_what_another_thread_left_is_used_only_where_it_is_right():
    assert [frame_record(mesh) for mesh in Contended(ReelReader(BytesSource(DATA)), 0, Decoders())] == WHOLE


@pytest.mark.parametrize("most", [0, 30_000, 60_000])
def test_what_is_kept_of_a_chain_is_bounded_and_frames_stay_the_same(monkeypatch: pytest.MonkeyPatch, most: int):
    free, bound = meshreel.open(DATA), meshreel.open(DATA)
    for frame in range(COUNT - EMPTY):
        assert frame_record(free[frame]) == WHOLE[frame]
    alone = _states_after(DATA, 0).nbytes
    monkeypatch.setattr(tracks, "MOST_KEPT", most)
    for frame in [*range(COUNT), *reversed(range(COUNT)), 7, 2, 8, 4]:
        assert frame_record(bound[frame]) == WHOLE[frame]
        states = bound.tracks[0]._states
        assert _size(states) == states.nbytes <= max(most, alone)
    assert most > 0 or len(states.known) == 1


def test_groups_of_a_chain_share_what_follows_from_their_faces():
    first, both = _states_after(DATA, 0), _states_after(DATA, 3)
    assert list(both.known) == [0, 1]
    assert first.nbytes < both.nbytes < 1.5 * first.nbytes


def _size(states: CachedStates) -> int:
    known = [None, *states.known.values()]
    return sum(state.nbytes_beyond(before) for before, state in pairwise(known) if state is not None)


def _states_after(data: bytes, frame: int) -> CachedStates:
    video = meshreel.open(data)
    video[frame]
    return video.tracks[0]._states
