"""Hostile files: FormatError and nothing else, before memory is spent; undamaged chunks stay readable."""

import tracemalloc
import zlib
from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from meshreel.container.reader import Chunk, ReelReader
from meshreel.container.sources import BytesSource
from meshreel.container.writer import pack_head
from meshreel.errors import FormatError, InputError
from meshreel.format.budget import LIMITS
from meshreel.format.layout import MAGIC, VERSION, Checksum, ChunkKind, Form, Index, IndexEntry, Layer, Preamble
from meshreel.format.records import least_size, pack
from tests.container.files import HEADER, PAYLOADS, small_file
from tests.format.strategies import records

pytestmark = pytest.mark.filterwarnings("ignore:Do not use the `random` module")

DATA = small_file()
CHUNKS = ReelReader(BytesSource(DATA)).chunks
HEAD_SIZE = CHUNKS[0].offset


def changed(place: int, flip: int) -> bytes:
    return DATA[:place] + bytes([DATA[place] ^ flip]) + DATA[place + 1 :]


def read_all(data: bytes) -> list[bytes | None]:
    """Each chunk's payload, None where it is refused."""
    reader = ReelReader(BytesSource(data))
    payloads: list[bytes | None] = []
    for chunk in reader.chunks:
        try:
            payloads.append(reader.read_chunk(chunk.number))
        except FormatError as error:
            assert str(error).startswith(str(chunk))  # names the chunk and its frames
            payloads.append(None)
    return payloads


def expected(is_damaged: list[bool]) -> list[bytes | None]:
    return [None if bad else payload for bad, payload in zip(is_damaged, PAYLOADS, strict=True)]


@pytest.mark.parametrize("size", range(HEAD_SIZE, len(DATA)))
def test_a_file_that_ends_in_its_chunks_loses_only_those(size):
    lost = [chunk.end > size for chunk in CHUNKS]
    assert read_all(DATA[:size]) == expected(lost)
    missing = ReelReader(BytesSource(DATA[:size])).missing
    assert [chunk.number for chunk in missing] == [number for number, gone in enumerate(lost) if gone]


def test_layers_before_the_end_of_a_truncated_file_are_readable():
    reader = ReelReader(BytesSource(DATA[: CHUNKS[1].offset + 25]))
    assert reader.read_chunk(1, 1) == PAYLOADS[1][:20]
    with pytest.raises(FormatError, match=r"chunk 1 \(frames 0 to 9\): truncated"):
        reader.read_chunk(1, 2)


@pytest.mark.parametrize("flip", [0x01, 0xFF])
def test_a_changed_byte_in_a_chunk_refuses_that_chunk_only(flip):
    for place in range(HEAD_SIZE, len(DATA)):
        damaged = [chunk.offset <= place < chunk.end for chunk in CHUNKS]
        assert read_all(changed(place, flip)) == expected(damaged)


def test_layers_before_a_changed_byte_are_readable():
    reader = ReelReader(BytesSource(changed(CHUNKS[1].offset + 25, 1)))
    assert reader.read_chunk(1, 1) == PAYLOADS[1][:20]
    with pytest.raises(FormatError, match=r"chunk 1 \(frames 0 to 9\): layer 1 is damaged"):
        reader.read_chunk(1, 2)


@pytest.mark.parametrize(
    ("files", "words"),
    [
        ([DATA[:size] for size in range(HEAD_SIZE)], None),
        ([changed(place, flip) for place in range(HEAD_SIZE) for flip in (0x01, 0xFF)], None),
        ([DATA + b"\0"], "1 bytes behind the last chunk"),
        ([b"", b"ply\nformat ascii 1.0\n", b"REEL\n\x1a\n" + DATA[8:], bytes(1000)], r"not a \.reel file"),
        *(
            ([DATA[:8] + bytes([v]) + DATA[9:]], f"version {v}: this reader knows version {VERSION}")
            for v in (0, 2, 255)
        ),
    ],
)
def test_damaged_and_other_files_are_refused(files, words):
    for data in files:
        with pytest.raises(FormatError, match=words):
            ReelReader(BytesSource(data))


def test_a_form_that_differs_from_the_index_is_refused():
    entry = IndexEntry(ChunkKind.GROUP, Form.DRACO, 5, 0, (), (Layer(1, zlib.crc32(b"\x04")),))
    reader = ReelReader(BytesSource(pack_head(HEADER, Index((entry,))) + b"\x04"))
    with pytest.raises(FormatError, match="its form is 4, the index says 3"):
        reader.read_chunk(0)


def test_a_source_that_gives_less_than_it_promised_is_refused():
    class Shrinking(BytesSource):
        size = len(DATA)

    with pytest.raises(FormatError, match="checksum"):
        ReelReader(Shrinking(DATA[: HEAD_SIZE - 1]))
    with pytest.raises(FormatError, match=r"chunk 3 .* truncated"):
        ReelReader(Shrinking(DATA[:-1])).read_chunk(3)


GROUP = IndexEntry(ChunkKind.GROUP, Form.DRACO, 65_535, 0, (), (Layer((1 << 53) - 1, 0),))


PATCH = replace(GROUP, kind=ChunkKind.STATIC, form=Form.PATCH, frames=0, depends_on=(0,))


def with_head(body: bytes, head_size: int | None = None) -> bytes:
    """A file of any header and index, with a checksum that matches."""
    size = least_size(Preamble) + len(body) + least_size(Checksum)
    head = pack(Preamble(MAGIC, VERSION, 0, size if head_size is None else head_size)) + body
    return head + pack(Checksum(zlib.crc32(head)))


@pytest.mark.parametrize(
    "data",
    [
        with_head(pack(HEADER), 0xFFFFFFFF),
        with_head(pack(HEADER) + b"\xff\xff\xff\xff" + bytes(100)),
        with_head(pack(HEADER)[:64] + b"\xff\xff" + bytes(100)),
        with_head(pack(HEADER)[:-1] + b"\xff\xff\xff\xff\x0f" + bytes(100)),
        with_head(pack(HEADER) + b"\x01\0\0\0" + pack(replace(GROUP, layers=()))[:-2] + b"\xff\xff" + bytes(100)),
        pack_head(HEADER, Index((GROUP,) * 100)),
        pack_head(HEADER, Index((replace(GROUP, depends_on=(1 << 52,)),))),
        pack_head(HEADER, Index((replace(GROUP, track=(1 << 53) - 1),))),
        pack_head(HEADER, Index(tuple(replace(GROUP, track=track) for track in range(300)))),
        pack_head(HEADER, Index((replace(PATCH, depends_on=(1,)), PATCH, GROUP))),
        pack_head(HEADER, Index((replace(GROUP, depends_on=(0,) * 255),))),
        pack_head(replace(HEADER, scale=1e300), Index((GROUP,))),
        pack_head(HEADER, Index((GROUP, replace(GROUP, frames=0)))),
    ],
)
def test_absurd_sizes_cost_no_memory(data):
    tracemalloc.start()
    with pytest.raises(FormatError):
        ReelReader(BytesSource(data)).read_chunk(0)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 1_000_000


@settings(max_examples=60)
@given(st.one_of(st.binary(max_size=200), records(Index).map(lambda index: pack(HEADER) + pack(index))))
def test_any_head_with_a_matching_checksum_is_read_or_refused(body):
    try:
        reader = ReelReader(BytesSource(with_head(body)))
    except FormatError:
        return
    assert reader.missing == reader.chunks
    assert all(isinstance(chunk, Chunk) for chunk in reader.chunks)


def test_a_head_of_a_sparse_file_is_refused_before_it_is_read():
    class Sparse(BytesSource):
        size = 1 << 32

        def get_bytes(self, offset: int, length: int) -> bytes:
            assert offset == 0 and length < 1 << 20
            return super().get_bytes(offset, length)

    with pytest.raises(FormatError, match="a head of 4294967295 bytes, over 67108864"):
        ReelReader(Sparse(pack(Preamble(MAGIC, VERSION, 0, (1 << 32) - 1)) + bytes(1000)))


def test_no_head_is_written_that_would_not_be_read(monkeypatch):
    monkeypatch.setattr("meshreel.format.budget.LIMITS", replace(LIMITS, head=HEAD_SIZE - 1))
    with pytest.raises(FormatError, match=f"a head of {HEAD_SIZE} bytes, over {HEAD_SIZE - 1}"):
        ReelReader(BytesSource(DATA))
    with pytest.raises(InputError, match=f"cannot be stored: a head of {HEAD_SIZE} bytes"):
        small_file()
