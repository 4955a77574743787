"""A file appears whole or not at all, and bad calls are refused where they are made."""

import errno
import io
import os
import tracemalloc
from dataclasses import replace

import pytest

from meshreel.container.reader import ReelReader
from meshreel.container.sources import BytesSource, FileSource
from meshreel.container.writer import ReelWriter
from meshreel.errors import InputError
from meshreel.format.layout import EmptyGroup, Form, StaticPatch
from meshreel.format.records import pack
from tests.container.files import HEADER, PAYLOADS, small_file

EMPTY = pack(EmptyGroup(Form.EMPTY))
STATIC = PAYLOADS[0]
PATCH = pack(StaticPatch(Form.PATCH, 0.001, 0, b"", b"mesh"))
BIG = bytes([Form.DRACO]) + bytes(999_999)


def test_a_file_and_memory_get_the_same_bytes(tmp_path):
    path = tmp_path / "out.reel"
    with ReelWriter(path, HEADER) as writer:
        writer.add_static(PAYLOADS[0])
        writer.add_group(0, 10, PAYLOADS[1], layers=(20, 30, len(PAYLOADS[1])), depends_on=(0,))
        writer.add_group(10, 5, PAYLOADS[2])
        assert not path.exists()
        writer.add_group(15, 3, PAYLOADS[3])
    assert path.read_bytes() == small_file()
    assert list(tmp_path.iterdir()) == [path]


def test_an_exception_leaves_the_old_file_and_no_other(tmp_path):
    path = tmp_path / "out.reel"
    path.write_bytes(b"old")
    with pytest.raises(KeyboardInterrupt), ReelWriter(path, HEADER) as writer:
        writer.add_group(0, 10, BIG)
        raise KeyboardInterrupt
    assert path.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [path]


def test_an_exception_while_the_file_is_put_together_leaves_nothing(tmp_path, monkeypatch):
    def interrupted(_: int) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(os, "fsync", interrupted)
    with pytest.raises(KeyboardInterrupt), ReelWriter(tmp_path / "out.reel", HEADER) as writer:
        writer.add_group(0, 10, BIG)
    assert list(tmp_path.iterdir()) == []


def test_a_file_object_that_is_full_is_an_input_error():
    class Full(io.BytesIO):
        def write(self, _: object) -> int:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with (
        pytest.raises(InputError, match="the output: cannot be written: No space left"),
        ReelWriter(Full(), HEADER) as writer,
    ):
        writer.add_group(0, 10, EMPTY)


def test_a_chunk_that_failed_to_be_written_spoils_the_file_even_if_the_error_is_caught(tmp_path, monkeypatch):
    class HalfFull(io.BytesIO):
        def write(self, data: bytes) -> int:
            super().write(data[: len(data) // 2])
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with pytest.raises(InputError, match="a chunk could not be written"), ReelWriter(tmp_path / "x", HEADER) as writer:
        writer.add_group(0, 10, EMPTY)
        monkeypatch.setattr(writer, "_spool", HalfFull())
        with pytest.raises(InputError, match="No space left"):
            writer.add_group(10, 10, BIG)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    "change", [{"metadata": "no JSON"}, {"metadata": "é" * 40_000}, {"scale": 0.0}, {"intervals": (1,)}]
)
def test_a_header_that_readers_would_refuse_is_an_input_error(change):
    file = io.BytesIO()
    with pytest.raises(InputError), ReelWriter(file, replace(HEADER, **change)) as writer:
        writer.add_group(0, 10, EMPTY)
    assert file.getvalue() == b""


@pytest.mark.parametrize("change", [{"frame_rate": 0.0}, {"scale": -1.0}, {"intervals": (1, 0)}])
def test_a_header_without_meaning_is_refused_before_any_work(change):
    with pytest.raises(InputError, match="Header"):
        ReelWriter(io.BytesIO(), replace(HEADER, **change)).__enter__()


def test_a_file_without_frames_is_an_input_error(tmp_path):
    with pytest.raises(InputError, match="no frames"), ReelWriter(tmp_path / "out.reel", HEADER) as writer:
        writer.add_static(STATIC)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"first_frame": 3}, "frame 10 comes next"),
        ({"frame_count": 0}, "add at least one"),
        ({"frame_count": 65_536}, "IndexEntry.frames"),
        ({"payload": b""}, "first byte must be a Form"),
        ({"payload": b"\xffdata"}, "first byte must be a Form"),
        ({"layers": (5, 5, 10)}, "must rise"),
        ({"layers": (0, 10)}, "must rise"),
        ({"layers": (5,)}, "payload's 10 bytes"),
        ({"depends_on": (0, 1, 3)}, "last group of its track"),
        ({"depends_on": (2,)}, "last group of its track"),
        ({"depends_on": (-1,)}, "IndexEntry.depends_on"),
        ({"depends_on": (0, 0)}, "twice"),
        ({"track": 1}, "frame 0 comes next"),
        ({"track": 2, "first_frame": 0}, "track 2 after 1"),
        ({"track": -1}, "of track -1"),
        ({"payload": b"\x05" + bytes(9)}, "a group of form PATCH"),
    ],
)
def test_an_impossible_group_is_refused_and_the_file_stays_usable(arguments, message):
    file = io.BytesIO()
    good = {"first_frame": 10, "frame_count": 5, "payload": b"\x03" + bytes(9), "layers": (4, 10), "depends_on": (0,)}
    with ReelWriter(file, HEADER) as writer:
        assert writer.add_static(STATIC) == 0
        assert writer.add_group(0, 10, EMPTY) == 1
        with pytest.raises(InputError, match=message):
            writer.add_group(**(good | arguments))
        assert writer.add_group(**good) == 2
    assert ReelReader(BytesSource(file.getvalue())).frame_count == 15


def test_a_group_may_depend_on_the_previous_group_and_on_no_other():
    file = io.BytesIO()
    with ReelWriter(file, HEADER) as writer:
        assert writer.last_of(0) is None
        writer.add_group(0, 10, EMPTY)
        writer.add_static(STATIC)  # may lie between them
        writer.add_group(10, 5, EMPTY, depends_on=(0, 1))
        assert writer.last_of(0) == 2
        with pytest.raises(InputError, match="last group of its track"):
            writer.add_group(15, 3, EMPTY, depends_on=(0,))
        writer.add_group(15, 3, EMPTY, depends_on=(writer.last_of(0),))
    groups = ReelReader(BytesSource(file.getvalue())).groups
    assert [group.depends_on for group in groups] == [(), (0, 1), (2,)]


def test_tracks_interleave_and_each_has_its_own_frames_and_last_group():
    file = io.BytesIO()
    with ReelWriter(file, HEADER) as writer:
        assert (writer.frames_of(1), writer.last_of(1)) == (0, None)
        background = writer.add_static(STATIC)
        writer.add_group(0, 10, EMPTY, depends_on=(background,))
        writer.add_group(0, 4, EMPTY, depends_on=(background,), track=1)
        changed = writer.add_static(PATCH, depends_on=(background,))
        assert (writer.frames_of(0), writer.frames_of(1), writer.last_of(0), writer.last_of(1)) == (10, 4, 1, 2)
        writer.add_group(4, 8, EMPTY, depends_on=(changed, 2), track=1)
        with pytest.raises(InputError, match="chunk 5: track 2 from frame 0 behind track 1 from frame 4"):
            writer.add_group(0, 12, EMPTY, track=2)
        writer.add_group(10, 2, EMPTY, depends_on=(1, changed))
        assert (writer.frames_of(0), writer.last_of(0)) == (12, 5)
    reader = ReelReader(BytesSource(file.getvalue()))
    assert [[group.number for group in groups] for groups in reader.tracks] == [[1, 5], [2, 4]]
    assert [chunk.depends_on for chunk in reader.chunks] == [(), (0,), (0,), (0,), (3, 2), (1, 3)]


def test_a_file_whose_tracks_differ_in_length_is_an_input_error(tmp_path):
    with (
        pytest.raises(InputError, match="track 1 has 9 frames, track 0 has 10"),
        ReelWriter(tmp_path / "out.reel", HEADER) as writer,
    ):
        writer.add_group(0, 10, EMPTY)
        writer.add_group(0, 9, EMPTY, track=1)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("payload", "depends_on", "message"),
    [
        (EMPTY, (), "static chunk of form EMPTY"),
        (STATIC, (0,), "form DRACO depends on"),
        (PATCH, (), "form PATCH depends on"),
        (PATCH, (1,), "no static chunk before it"),
        (PATCH, (2,), "no static chunk before it"),
        (PATCH, (0, 0), "twice"),
        (PATCH, (-1,), "IndexEntry.depends_on"),
    ],
)
def test_an_impossible_background_is_refused_and_the_file_stays_usable(payload, depends_on, message):
    file = io.BytesIO()
    with ReelWriter(file, HEADER) as writer:
        writer.add_static(STATIC)
        writer.add_group(0, 10, EMPTY)
        with pytest.raises(InputError, match=message):
            writer.add_static(payload, depends_on=depends_on)
        assert writer.add_static(PATCH, depends_on=(0,)) == 2
    assert len(ReelReader(BytesSource(file.getvalue())).chunks) == 3


def test_memory_does_not_grow_with_the_file(tmp_path):
    path = tmp_path / "out.reel"
    tracemalloc.start()
    with ReelWriter(path, HEADER) as writer:
        for group in range(30):
            writer.add_group(10 * group, 10, BIG)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 3_000_000
    with FileSource(path) as source:
        assert ReelReader(source).read_chunk(29) == BIG
