"""A chunk that was refused for its bytes is refused from memory; one that could not be read is tried again."""

import io
from collections import Counter
from collections.abc import Callable

import pytest

import meshreel
from meshreel import _core
from meshreel.coding.mesh import encode_empty
from meshreel.container.reader import ReelReader
from meshreel.container.sources import BytesSource
from meshreel.container.writer import ReelWriter
from meshreel.errors import FormatError, InputError
from tests.container.files import HEADER
from tests.decoder.test_chains import COUNT, DATA, WHOLE
from tests.decoder.test_tracks import COME, FLOOR
from tests.golden import frame_record

SECOND = range(9, COUNT)  # frames of the second chain, which do not need chunk 1


def with_payload(data: bytes, number: int, change: Callable[[bytes], bytes]) -> bytes:
    """The file with another payload of a chunk, and sums that match it."""
    reader, file = ReelReader(BytesSource(data)), io.BytesIO()
    with ReelWriter(file, reader.header) as writer:
        for chunk in reader.chunks:
            payload = reader.read_chunk(chunk.number)
            payload = change(payload) if chunk.number == number else payload
            writer.add_group(chunk.first_frame, chunk.frame_count, payload, depends_on=chunk.depends_on)
    return file.getvalue()


def shortened(payload: bytes) -> bytes:
    return payload[:-1]


@pytest.fixture
def decoded(monkeypatch: pytest.MonkeyPatch) -> Counter[int]:
    """How often each payload was decoded, by its length and the background's by their form."""
    counts: Counter[int] = Counter()
    for name in ("Group", "Background"):

        def count(data: bytes, *arguments: object, of=getattr(_core, name), **named: object) -> object:
            counts[data[0], len(data)] += 1
            return of(data, *arguments, **named)

        monkeypatch.setattr(_core, name, count)
    return counts


def test_a_refused_group_is_decoded_once_for_its_frames_and_once_for_those_that_need_it(decoded: Counter[int]):
    video = meshreel.open(with_payload(DATA, 1, shortened))
    messages = set()
    for frame in [*range(3, 9)] * 3:
        with pytest.raises(FormatError) as refused:
            video[frame]
        messages.add(str(refused.value))
    [message] = messages
    assert message.startswith("chunk 1 (frames 3 to 4): ")
    assert sorted(decoded.values()) == [2, 2]  # chunks 0 and 1
    assert [frame_record(video[frame]) for frame in SECOND] == [WHOLE[frame] for frame in SECOND]
    assert frame_record(video.at(layers=0)[3]) == frame_record(
        meshreel.open(DATA).at(layers=0)[3]
    )  # needs no byte of it


@pytest.mark.parametrize("frames", [(5, 3, 5), (3, 5)])
def test_damaged_patches_cost_no_frame_of_the_groups_behind_in_any_order(frames: tuple[int, ...]):
    video = meshreel.open(with_payload(DATA, 1, lambda payload: payload + b"no patches"))
    for frame in frames:
        if frame == 5:  # of chunk 2
            assert frame_record(video[frame]) == WHOLE[frame]
            continue
        with pytest.raises(FormatError, match="chunk 1"):
            video[frame]


def test_a_group_that_could_not_be_read_is_tried_again():
    class Growing(BytesSource):
        end = len(DATA) // 2
        fails = False

        @property
        def size(self) -> int:
            return self.end

        def get_bytes(self, offset: int, length: int) -> bytes:
            if self.fails:
                raise InputError("the network is down")
            return super().get_bytes(offset, min(length, self.end - offset))

    source = Growing(DATA)
    video = meshreel.open(source)
    source.fails = True
    with pytest.raises(InputError):
        video[0]
    source.fails = False
    assert frame_record(video[0]) == WHOLE[0]
    with pytest.raises(FormatError, match="truncated"):
        video[COUNT - 1]
    source.end = len(DATA)
    assert frame_record(video[COUNT - 1]) == WHOLE[COUNT - 1]


def test_a_damaged_sum_is_read_again():
    flipped = bytearray(DATA)
    flipped[-1] ^= 1  # of the empty group, the last chunk
    source = BytesSource(bytes(flipped))
    video = meshreel.open(source)
    with pytest.raises(FormatError, match="checksum"):
        video[COUNT - 1]
    source._data = DATA
    assert video[COUNT - 1].is_empty


def test_a_refused_state_of_the_background_is_decoded_once(decoded: Counter[int]):
    file = io.BytesIO()
    with ReelWriter(file, HEADER) as writer:
        floor = writer.add_static(FLOOR[:-1])
        come = writer.add_static(COME, depends_on=(floor,))
        writer.add_group(0, 5, encode_empty(), depends_on=(come,))
    video = meshreel.open(file.getvalue())
    for frame in [*range(5)] * 2:
        with pytest.raises(FormatError, match=rf"background of frame {frame}: chunk 0 \(static\): "):
            video[frame]
    assert list(decoded.values()) == [1]
    assert video.moving(0).is_empty
