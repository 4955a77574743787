"""A written file is read back by the necessary byte ranges and no others."""

import io
import json
from dataclasses import replace

import pytest

from meshreel.container.reader import FIRST_REQUEST, ReelReader
from meshreel.container.sources import BytesSource, FileSource, Source
from meshreel.container.writer import ReelWriter, pack_head
from meshreel.format.checks import MOST_TRACKS
from meshreel.format.layout import ChunkKind, EmptyGroup, Form, Index, Layer
from meshreel.format.records import pack
from tests.container.files import FRAMES, HEADER, PAYLOADS, Counted, small_file
from tests.golden import GOLDEN


def test_every_chunk_comes_back():
    data = small_file()
    reader = ReelReader(BytesSource(data))
    assert tuple(reader.read_chunk(number) for number in range(4)) == PAYLOADS
    assert reader.header == HEADER
    assert reader.metadata == {"quality": 50}
    assert (reader.frame_count, reader.frame_rate, reader.size) == (FRAMES, 30.0, len(data))
    assert reader.missing == ()


def test_the_index_says_what_each_chunk_is():
    reader = ReelReader(BytesSource(small_file()))
    background, laplacian, empty, draco = reader.chunks
    assert reader.groups == (laplacian, empty, draco)
    assert background.kind == ChunkKind.STATIC
    assert [chunk.form for chunk in reader.groups] == [Form.LAPLACIAN, Form.EMPTY, Form.DRACO]
    assert [(chunk.first_frame, chunk.frame_count) for chunk in reader.groups] == [(0, 10), (10, 5), (15, 3)]
    assert laplacian.depends_on == (0,)
    assert background.offset == reader.head_size
    assert [chunk.size for chunk in reader.chunks] == [len(payload) for payload in PAYLOADS]
    assert str(draco) == "chunk 3 (frames 15 to 17)"


@pytest.mark.parametrize(("frame", "number"), [(0, 1), (9, 1), (10, 2), (14, 2), (15, 3), (17, 3)])
def test_a_frame_is_found_in_its_group(frame, number):
    assert ReelReader(BytesSource(small_file())).chunk_of_frame(frame).number == number


@pytest.mark.parametrize("frame", [-1, FRAMES])
def test_a_frame_out_of_range_is_an_index_error(frame):
    reader = ReelReader(BytesSource(small_file()))
    with pytest.raises(IndexError, match="frames 0 to 17"):
        reader.chunk_of_frame(frame)
    with pytest.raises(IndexError):
        reader.timestamp(frame)


def test_the_first_layers_are_a_prefix_of_the_chunk():
    reader = ReelReader(BytesSource(small_file()))
    assert [len(reader.read_chunk(1, layers)) for layers in (0, 1, 2, 3, 9)] == [
        20,
        20,
        30,
        len(PAYLOADS[1]),
        len(PAYLOADS[1]),
    ]
    assert reader.read_chunk(1, 2) == PAYLOADS[1][:30]


def test_a_chunk_costs_one_request_of_exactly_its_bytes():
    source = Counted(small_file())
    assert isinstance(source, Source)
    reader = ReelReader(source)
    assert source.ranges == [(0, source.size)]
    chunk = reader.chunks[1]
    reader.read_chunk(3)
    reader.read_chunk(1, 2)
    assert source.ranges[1:] == [(reader.chunks[3].offset, len(PAYLOADS[3])), (chunk.offset, 30)]


def test_a_long_head_costs_a_second_request():
    header = replace(HEADER, metadata=json.dumps({"note": "x" * FIRST_REQUEST}))
    source = Counted(small_file(header))
    reader = ReelReader(source)
    assert source.ranges == [(0, FIRST_REQUEST), (FIRST_REQUEST, reader.head_size - FIRST_REQUEST)]
    assert reader.read_chunk(3) == PAYLOADS[3]


def test_among_many_groups_each_frame_is_found():
    file = io.BytesIO()
    with ReelWriter(file, HEADER) as writer:
        for number in range(100):
            writer.add_group(10 * number, 10, pack(EmptyGroup(Form.EMPTY)))
    reader = ReelReader(BytesSource(file.getvalue()))
    assert [reader.chunk_of_frame(frame).number for frame in range(1000)] == [frame // 10 for frame in range(1000)]


SCENE = (GOLDEN / "scene.reel").read_bytes()  # chunks 0 and 3 static, 1, 5, 8 of track 0, 2, 4, 6, 7 of track 1


def test_a_scene_has_the_groups_of_each_track_and_those_of_a_frame():
    reader = ReelReader(BytesSource(SCENE))
    assert [[group.number for group in groups] for groups in reader.tracks] == [[1, 5, 8], [2, 4, 6, 7]]
    assert [group.number for group in reader.groups] == [1, 2, 4, 5, 6, 7, 8]
    assert [[g.first_frame for g in groups] for groups in reader.tracks] == [[0, 6, 10], [0, 4, 7, 9]]
    assert reader.frame_count == 14
    found = [tuple(chunk.number for chunk in reader.chunks_of_frame(frame)) for frame in range(14)]
    assert found == [(1, 2)] * 4 + [(1, 4)] * 2 + [(5, 4)] + [(5, 6)] * 2 + [(5, 7)] + [(8, 7)] * 4
    for frame in (-1, 14):
        with pytest.raises(IndexError, match="frames 0 to 13"):
            reader.chunks_of_frame(frame)


def test_a_frame_is_shown_with_the_newest_state_that_a_group_of_it_names():
    reader = ReelReader(BytesSource(SCENE))
    shown = [reader.static_of_frame(frame) for frame in range(14)]
    assert [chunk.number for chunk in shown if chunk is not None] == [0] * 4 + [3] * 10
    assert [reader.static_of_frame(frame) is None for frame in (0, 10)] == [False, False]
    sequence = ReelReader(BytesSource(small_file()))
    assert [sequence.static_of_frame(frame) is None for frame in (0, 10)] == [False, True]


def test_a_group_is_predicted_from_a_group_of_its_track():
    reader = ReelReader(BytesSource(SCENE))
    before = [reader.group_before(chunk) for chunk in reader.groups]
    assert [chunk and chunk.number for chunk in before] == [None, None, None, 1, 4, None, 5]


def test_where_there_are_several_tracks_a_chunk_names_its_own():
    reader = ReelReader(BytesSource(SCENE))
    assert [str(reader.chunks[n]) for n in (0, 4, 5)] == [
        "chunk 0 (static)",
        "chunk 4 (track 1, frames 4 to 6)",
        "chunk 5 (track 0, frames 6 to 9)",
    ]


def test_a_chunk_of_a_kind_to_come_may_have_any_track_and_frames():
    reader = ReelReader(BytesSource(small_file()))
    entry = replace(reader.index.chunks[-1], kind=200, track=300, depends_on=(), layers=(Layer(1, 0),))
    data = pack_head(reader.header, Index((*reader.index.chunks, entry)))
    more = ReelReader(BytesSource(data + small_file()[reader.head_size :] + b"?"))
    assert [chunk.number for chunk in more.groups] == [chunk.number for chunk in reader.groups]
    assert (more.chunks[-1].kind, more.chunks[-1].track) == (200, 300)


def test_the_largest_number_of_tracks_is_read_quickly():
    file = io.BytesIO()
    with ReelWriter(file, HEADER) as writer:
        for first in range(0, 100, 50):
            for track in range(MOST_TRACKS):
                writer.add_group(first, 50, pack(EmptyGroup(Form.EMPTY)), track=track)
    reader = ReelReader(BytesSource(file.getvalue()))
    assert [chunk.track for chunk in reader.chunks_of_frame(57)] == list(range(MOST_TRACKS))
    assert {chunk.first_frame for chunk in reader.chunks_of_frame(57)} == {50}


def test_times_are_uniform_from_the_first():
    reader = ReelReader(BytesSource(small_file()))
    assert [reader.timestamp(frame) for frame in (0, 3, 15)] == [1.0, 1.1, 1.5]


def test_times_may_be_uneven():
    intervals = (40_000, 10_000, *[50_000] * 15)
    reader = ReelReader(BytesSource(small_file(replace(HEADER, intervals=intervals))))
    assert [reader.timestamp(frame) for frame in (0, 1, 2, 17)] == [1.0, 1.04, 1.05, 1.8]


def test_a_file_on_disk_reads_like_one_in_memory(tmp_path):
    path = tmp_path / "small.reel"
    path.write_bytes(small_file())
    with FileSource(path) as source:
        assert isinstance(source, Source)
        assert ReelReader(source).read_chunk(3) == PAYLOADS[3]
        assert source.get_bytes(source.size - 3, 100) == small_file()[-3:]
