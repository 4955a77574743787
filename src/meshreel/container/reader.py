"""Reader of a .reel file: reads the head once, then any chunk by its byte range. A Source -> payloads checked by CRC.

A damaged head makes the file unreadable (FormatError at once); damage behind it affects only the damaged chunks.
"""

from __future__ import annotations

import zlib
from bisect import bisect_right
from dataclasses import dataclass
from itertools import accumulate, pairwise

import numpy as np

from ..errors import FormatError
from ..format.budget import check_head
from ..format.checks import COMPANIONS, check_file, unpack_audio
from ..format.edit import Edit
from ..format.layout import EDITED, MAGIC, VERSION, AudioFile, Checksum, ChunkKind, Form, Header, Index, Layer, Preamble
from ..format.records import least_size, unpack, unpack_all
from ..format.view import View, known_view
from ..shapes import Float64
from ..types import Up, known_up
from .sources import Source

FIRST_REQUEST = 16384  # bytes; the head of some minutes of video (guess)


@dataclass(frozen=True, slots=True)
class Chunk:
    """Position and contents of a chunk."""

    number: int
    kind: int  # a ChunkKind, or one that this version does not know
    form: int
    first_frame: int  # 0 for STATIC; of a group, numbered as the frames that it shows
    frame_count: int  # 0 for STATIC
    depends_on: tuple[int, ...]  # numbers of the chunks that it needs
    offset: int  # bytes from the start of the file
    layers: tuple[Layer, ...]
    track: int = 0  # 0 for STATIC
    is_alone: bool = True  # whether the file has no other track
    coded: int = 0  # of a group, the number of its first frame among the coded ones
    shown: range = range(0)  # of a group, the frames that are shown

    @property
    def form_name(self) -> str:
        """Name of the form in lower case; its number if this version does not know it."""
        return next((form.name.lower() for form in Form if form == self.form), str(self.form))

    @property
    def size(self) -> int:
        """Size of the whole chunk, bytes."""
        return sum(layer.size for layer in self.layers)

    @property
    def end(self) -> int:
        """Offset of the byte behind the chunk."""
        return self.offset + self.size

    def __str__(self) -> str:
        what = f"{ChunkKind(self.kind).name.lower()}, " if self.kind in COMPANIONS else ""
        if self.frame_count == 0:
            return f"chunk {self.number} ({'audio' if self.kind == ChunkKind.AUDIO else f'{what}static'})"
        track = "" if self.is_alone else f"track {self.track}, "
        last = self.first_frame + self.frame_count - 1
        return f"chunk {self.number} ({what}{track}frames {self.first_frame} to {last})"


class LargeHeadError(FormatError):
    """The head of a file has more bytes than the caller takes the time to read."""


class ReelReader:
    """Checked head of a file, and access to its chunks; does not close the source."""

    def __init__(self, source: Source, most_head: int | None = None) -> None:
        """Read the head of a file. Raises FormatError if it is damaged, LargeHeadError over `most_head` bytes."""
        self.source, self._bytes_read = source, 0
        self.header, self.index, self.head_size, flags = _read_head(source, most_head)
        # `size`: bytes of the whole file, even if it is truncated.
        self.metadata, self.edit, self.size = check_file(self.header, self.index, flags, self.head_size)
        self.chunks = _chunks(self.index, self.head_size, self.edit)
        self._static = {chunk.number for chunk in self.chunks if chunk.kind == ChunkKind.STATIC}
        self.groups = tuple(chunk for chunk in self.chunks if chunk.kind == ChunkKind.GROUP)
        tracks: list[list[Chunk]] = [[] for _ in {group.track for group in self.groups}]
        self.shown_from = dict[int, int]()  # of each STATIC, the first coded frame with it: its pictures begin there
        for group in self.groups:
            tracks[group.track].append(group)
            for number in group.depends_on:
                self.shown_from.setdefault(number, group.coded)
        self.tracks = tuple(map(tuple, tracks))  # the groups of each
        self.frame_count = self.edit.frame_count
        self.coded_count = sum(group.frame_count for group in self.tracks[0])  # frames, hidden ones included
        if source.size > self.size:
            raise FormatError(f"{source.size - self.size} bytes behind the last chunk, copy the file again")
        self._companions = {(c.depends_on[0], c.kind): c for c in self.chunks if c.kind in COMPANIONS}
        self._shown = [[group for group in groups if group.shown] for groups in self.tracks]
        self._times = list(accumulate(self.header.intervals, initial=self.header.first_time))

    @property
    def bytes_read(self) -> int:
        """Bytes received over the network, head included; for a local file, the bytes of the chunks that were read."""
        count: int = getattr(self.source, "bytes_read", self._bytes_read)
        return count

    @property
    def box(self) -> tuple[Float64[np.ndarray, "3"], Float64[np.ndarray, "3"]]:
        """Lower and upper corner of the box that holds all frames, m."""
        head, turn = self.header, np.array(self.edit.rotation or np.eye(3)).reshape(3, 3)
        sides = head.scale * turn[:, :, None] * np.array([head.minimum, head.maximum], np.float64).T
        low, high = sides.min(axis=2).sum(axis=1), sides.max(axis=2).sum(axis=1)
        return head.origin + low, head.origin + high

    @property
    def frame_rate(self) -> float:
        """Frames per second, 1/s."""
        return self.header.frame_rate

    @property
    def duration(self) -> float:
        """Time from the first frame to the end of the last one, s."""
        return self.timestamp(self.frame_count - 1) - self.timestamp(0) + 1 / self.frame_rate

    @property
    def up(self) -> Up:
        """The axis that points up: y, z, -y or -z; y if the file does not name one."""
        return known_up(self.metadata.get("up"))

    @property
    def view(self) -> View | None:
        """The first view, m; None if the file has none."""
        view, turn = known_view(self.metadata), np.array(self.edit.rotation or np.eye(3)).reshape(3, 3)
        return None if view is None else view.moved(self.header.scale, turn, self.header.origin)

    @property
    def missing(self) -> tuple[Chunk, ...]:
        """The chunks that a truncated file has lost, entirely or in part; none in a complete file."""
        return tuple(chunk for chunk in self.chunks if chunk.end > self.source.size)

    @property
    def is_colored(self) -> bool:
        """True if the file has colours."""
        return any(chunk.kind != ChunkKind.SPLATS for chunk in self._companions.values())

    @property
    def has_splats(self) -> bool:
        return any(chunk.kind == ChunkKind.SPLATS for chunk in self._companions.values())

    @property
    def has_textures(self) -> bool:
        """True if the file has pictures, in any coding."""
        return any(chunk.form == Form.VIDEO for chunk in self._companions.values())

    @property
    def audio(self) -> Chunk | None:
        """The chunk of the audio file, if any."""
        return next((chunk for chunk in self.chunks if chunk.kind == ChunkKind.AUDIO), None)

    def read_audio(self) -> AudioFile | None:
        """Read the audio file; None if there is none. A FormatError names the chunk."""
        if (chunk := self.audio) is None:
            return None
        try:
            return unpack_audio(self.read_chunk(chunk.number))
        except FormatError as error:
            raise error if str(error).startswith(str(chunk)) else FormatError(f"{chunk}: {error}") from error

    def companion_of(self, chunk: Chunk, kind: ChunkKind) -> Chunk | None:
        """Return the chunk of a kind that belongs to a chunk, or None."""
        return self._companions.get((chunk.number, kind))

    @property
    def has_background(self) -> bool:
        return bool(self.shown_from.keys() & self._static)

    @property
    def has_moving(self) -> bool:
        return any(group.form != Form.EMPTY for group in self.groups)

    def timestamp(self, frame: int) -> float:
        """Return the time of a frame, s. Raises IndexError as chunk_of_frame does."""
        self.chunk_of_frame(frame)
        if self.header.intervals:
            return self._times[frame] / 1e6
        return self.header.first_time / 1e6 + frame / self.header.frame_rate

    def chunk_of_frame(self, frame: int, track: int = 0) -> Chunk:
        """Return the GROUP chunk of a track that holds a frame. Raises IndexError outside 0 .. frame_count - 1."""
        if not 0 <= frame < self.frame_count:
            raise IndexError(f"frame {frame}: the file has frames 0 to {self.frame_count - 1}")
        groups = self._shown[track]
        return groups[bisect_right(groups, frame, key=lambda group: group.shown.start) - 1]

    def chunks_of_frame(self, frame: int) -> tuple[Chunk, ...]:
        """Return the GROUP chunks that hold a frame, by track. Raises IndexError as chunk_of_frame does."""
        return tuple(self.chunk_of_frame(frame, track) for track in range(len(self.tracks)))

    def static_of_frame(self, frame: int) -> Chunk | None:
        """Return the STATIC chunk shown with a frame: the newest that a group of the frame depends on."""
        named = [n for chunk in self.chunks_of_frame(frame) for n in chunk.depends_on if n in self._static]
        return self.chunks[max(named)] if named else None

    def static_ranges(self, frames: range) -> dict[int, list[tuple[int, int]]]:
        """Return the ranges within `frames` (end excluded) that show each STATIC chunk, by its number."""
        ranges = dict[int, list[tuple[int, int]]]()
        begins = {group.shown.start for group in self.groups if group.shown}
        starts = sorted({frames.start, *begins.intersection(frames)})
        for start, end in pairwise([*starts, frames.stop]):  # the background changes only with a group
            if (chunk := self.static_of_frame(start)) is not None:
                shown = ranges.setdefault(chunk.number, [])
                first = shown.pop()[0] if shown and shown[-1][1] == start else start
                shown.append((first, end))
        return ranges

    def group_before(self, chunk: Chunk) -> Chunk | None:
        """Return the GROUP chunk that a chunk is predicted from, or None."""
        return next((self.chunks[n] for n in chunk.depends_on if n not in self._static), None)

    def read_chunk(self, number: int, layers: int | None = None) -> bytes:
        """Read the payload of a chunk, or its first `layers` (at least one). A FormatError names chunk and frames."""
        chunk = self.chunks[number]
        return self._read(chunk, chunk.offset, chunk.layers if layers is None else chunk.layers[: max(layers, 1)])

    def read_layer(self, number: int, layer: int) -> bytes:
        """Read one layer of a chunk whose layers are payloads of their own. Raises as `read_chunk` does."""
        chunk = self.chunks[number]
        offset = chunk.offset + sum(before.size for before in chunk.layers[:layer])
        return self._read(chunk, offset, chunk.layers[layer : layer + 1])

    def _read(self, chunk: Chunk, offset: int, layers: tuple[Layer, ...]) -> bytes:
        size = sum(layer.size for layer in layers)
        if offset + size > self.source.size:
            raise FormatError(f"{chunk}: truncated, the file ends at byte {self.source.size} of {self.size}")
        payload = self.source.get_bytes(offset, size)
        self._bytes_read += size
        if len(payload) != size:
            raise FormatError(f"{chunk}: truncated, {len(payload)} of {size} bytes")
        start = 0
        for number, layer in enumerate(layers):
            if zlib.crc32(memoryview(payload)[start : start + layer.size]) != layer.crc:
                raise FormatError(f"{chunk}: layer {number} is damaged, its checksum does not match")
            start += layer.size
        if payload[0] != chunk.form:
            raise FormatError(f"{chunk}: its form is {payload[0]}, the index says {chunk.form}")
        return payload


def _read_head(source: Source, most: int | None) -> tuple[Header, Index, int, int]:
    """Return header, index, size and flags; a short head takes one request, within the size of the source."""
    data = source.get_bytes(0, min(FIRST_REQUEST, source.size))
    if data[: len(MAGIC)] != MAGIC:
        raise FormatError("not a .reel file: the signature is missing")
    preamble, start = unpack(Preamble, data)
    if preamble.version != VERSION:
        raise FormatError(f"format version {preamble.version}: this reader knows version {VERSION}, update meshreel")
    if preamble.flags & ~EDITED:
        raise FormatError(f"flags {preamble.flags}: this reader knows {EDITED} alone, update meshreel")
    size = preamble.head_size
    end = size - least_size(Checksum)
    if not start <= end or size > source.size:
        raise FormatError(f"head of {size} bytes in a file of {source.size}: truncated or damaged")
    check_head(size)
    if most is not None and size > most:
        raise LargeHeadError(f"a head of {size} bytes, over {most}")
    data = data[:size] + (source.get_bytes(len(data), size - len(data)) if size > len(data) else b"")
    if len(data) != size or unpack_all(Checksum, data[end:]).crc != zlib.crc32(data[:end]):
        raise FormatError("the head is damaged: its checksum does not match")
    header, start = unpack(Header, data[:end], start)
    return header, unpack_all(Index, data[start:end]), size, preamble.flags


def _chunks(index: Index, offset: int, edit: Edit) -> tuple[Chunk, ...]:
    """Return the chunks of an index, with positions from `offset` on."""
    chunks: list[Chunk] = []
    tracks = (entry.track for entry in index.chunks if entry.kind == ChunkKind.GROUP)
    frames = [0] * (1 + max(tracks, default=0))
    ends, befores = [run.stop for run in edit.shown], [0, *accumulate(map(len, edit.shown))]
    for number, entry in enumerate(index.chunks):
        is_group = entry.kind == ChunkKind.GROUP
        of = chunks[entry.depends_on[0]] if entry.kind in COMPANIONS else None
        first, coded, shown = 0 if of is None else of.first_frame, 0, range(0)
        if is_group:  # only groups have checked tracks: an unknown kind may have any
            coded = frames[entry.track]
            frames[entry.track] += entry.frames
            at = min(bisect_right(ends, coded), len(ends) - 1)  # the range that it ends in, or is before
            if at + 1 < len(ends) and edit.shown[at + 1].start < frames[entry.track]:
                raise FormatError(f"Header.metadata: edit.frames have two ranges with frames of chunk {number}")
            low, high = befores[at : at + 2]
            first = low + coded - edit.shown[at].start
            start = min(max(first, low), high)
            shown = range(start, max(min(first + entry.frames, high), start))
        place = (number, entry.kind, entry.form, first, entry.frames, entry.depends_on, offset, entry.layers)
        chunk = Chunk(*place, entry.track, len(frames) == 1, coded, shown)
        chunks.append(chunk)
        offset = chunk.end
    return tuple(chunks)
