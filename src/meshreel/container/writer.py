"""Writer of a .reel file, which appears complete or not at all. A header and payloads -> a file, or its bytes.

The head names every chunk and comes first, so chunks wait in the file that stores them already, or in a temporary file
that ends with the process. Memory is bounded, and a killed process leaves nothing under the final name.
"""

from __future__ import annotations

import os
import tempfile
import zlib
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, nullcontext, suppress
from dataclasses import dataclass, replace
from itertools import accumulate
from pathlib import Path
from types import TracebackType
from typing import Any, Protocol, runtime_checkable

from ..errors import FormatError, InputError
from ..format.budget import check_head
from ..format.checks import IndexChecks, check_file, check_header, parse_metadata
from ..format.layout import MAGIC, VERSION, Checksum, ChunkKind, Form, Header, Index, IndexEntry, Layer, Preamble
from ..format.records import least_size, pack
from ..io.write import FULL, sync_folder, unfinished
from .sources import Stream

SKIPPED = 255  # the kind of a chunk that no reader knows, now or later (FORMAT.md: a byte)
AUDIO_PIECE = 1 << 16  # bytes of an audio chunk's layers: 8 s of 64 kbit/s (guess)


@runtime_checkable
class Sink(Protocol):
    """Destination of bytes: io.BytesIO, an open binary file."""

    def write(self, data: bytes, /) -> Any: ...

    def flush(self) -> Any: ...


@dataclass(frozen=True, slots=True)
class Stored:
    """A payload in a file, read when it is needed; given by its path, so that few files are open."""

    file: Stream | Path
    offset: int
    size: int

    def __len__(self) -> int:
        return self.size

    def read(self) -> bytes:
        """Return the payload; fewer bytes if the file has been truncated."""
        with self.file.open("rb") if isinstance(self.file, Path) else nullcontext(self.file) as file:
            file.seek(self.offset)
            data: bytes = file.read(self.size)
            return data


@dataclass(frozen=True, slots=True)
class Companion:
    """Companion of a group or a background: its colours, an atlas, pictures or splats."""

    kind: ChunkKind
    payload: bytes | Stored
    layers: tuple[int, ...] = ()  # ends of the payload's layers, bytes; none: it is one layer

    def __len__(self) -> int:
        return len(self.payload)

    def read(self) -> bytes:
        return self.payload if isinstance(self.payload, bytes) else self.payload.read()


class ReelWriter:
    """Context manager that writes a file: chunks are added by `add_*`, and the file appears when the block succeeds.

    The output is a path, or a Sink such as io.BytesIO. Raises InputError if the output cannot be written (no such
    folder, disk full), if no frame was added, or if a value cannot be stored.
    """

    def __init__(self, output: str | Path | Sink, header: Header, name: str = "the output", audio: bytes = b"") -> None:
        """Write to `output`; `name` is a Sink's name in error messages, `audio` a payload of form AUDIO_FILE."""
        self._output = Path(output) if isinstance(output, str | Path) else output
        self._name = str(self._output) if isinstance(self._output, Path) else name
        self.header = header  # may be replaced until the block ends, to store measured values as metadata
        self._audio = audio
        self.size = 0  # bytes of the whole file, set when the block has ended
        self._entries: list[IndexEntry] = []
        self._chunks: list[Stored] = []
        self._checks = IndexChecks()

    def frames_of(self, track: int) -> int:
        """Return the number of frames added to a track: the first frame of its next group."""
        return self._checks.frames[track] if track < len(self._checks.frames) else 0

    def last_of(self, track: int) -> int | None:
        """Return the number of a track's newest chunk, from which the next may be predicted, or None."""
        return self._checks.groups[track] if track < len(self._checks.groups) else None

    def __enter__(self) -> ReelWriter:
        with _as_input_error(self._name):
            pack(self.header)
            check_header(self.header, len(self.header.intervals) + 1)  # before encoding, not after it
            parse_metadata(self.header.metadata)
            folder = self._output.parent if isinstance(self._output, Path) else None
            if isinstance(self._output, Path) and self._output.is_dir():
                raise IsADirectoryError(None, "is a folder, name a file")
            self._spool = tempfile.TemporaryFile(dir=folder)  # for chunks that are in memory
        return self

    def __exit__(self, kind: type[BaseException] | None, error: object, trace: TracebackType | None) -> None:
        try:
            if kind is None:
                with _as_input_error(self._name):
                    self._finish()
        finally:
            with suppress(OSError):
                self._spool.close()

    def add_static(self, payload: bytes, depends_on: Sequence[int] = ()) -> int:
        """Add a state of the background and return the number of its chunk.

        The payload has form DRACO or PATCH; for PATCH, `depends_on` is the number of the state that it changes.
        """
        entry = IndexEntry(ChunkKind.STATIC, _form(payload), 0, 0, tuple(depends_on), _layers(payload, ()))
        return self._add(entry, payload)

    def add_group(
        self,
        first_frame: int,
        frame_count: int,
        payload: bytes | Stored,
        layers: Sequence[int] = (),
        depends_on: Sequence[int] = (),
        track: int = 0,
    ) -> int:
        """Add a group of frames, which follow the track's previous group, and return the number of its chunk.

        Add groups in the order of their first frame, then of their track. `layers` are the ends of the payload's
        layers, bytes, ascending to its length; without any it is one layer. `depends_on` are the numbers of the static
        chunk that the frames are shown with and, for a predicted group, of the previous group of its track. A stored
        payload must remain in its file until the block ends.
        """
        if track < 0 or first_frame != self.frames_of(track):
            raise InputError(
                f"group at frame {first_frame} of track {track}: frame {self.frames_of(max(track, 0))} comes next, "
                "add groups in order"
            )
        if frame_count < 1:
            raise InputError(f"group at frame {first_frame}: {frame_count} frames, add at least one")
        data = payload if isinstance(payload, bytes) else payload.read()
        entry = IndexEntry(ChunkKind.GROUP, _form(data), frame_count, track, tuple(depends_on), _layers(data, layers))
        return self._add(entry, payload)

    def add_companion(self, companion: Companion, depends_on: Sequence[int]) -> int:
        """Add a companion of a chunk, and return the number of its own chunk.

        `depends_on` are the numbers of the chunk that it belongs to and of other chunks that it needs.
        """
        data, entry = companion.read(), self._entries[depends_on[0]]
        place = (entry.frames, entry.track, tuple(depends_on))
        layers = _layers(data, companion.layers)
        return self._add(IndexEntry(companion.kind, _form(data), *place, layers), companion.payload)

    def add_skipped(self, payload: bytes) -> int:
        """Add bytes for the writer's own use, of a kind that readers skip, and return the number of their chunk."""
        return self._add(IndexEntry(SKIPPED, _form(payload), 0, 0, (), _layers(payload, ())), payload)

    def companion_of(self, number: int | None, kind: ChunkKind) -> int | None:
        """Return the number of the chunk of a kind that belongs to a chunk, or None."""
        return None if number is None else self._checks.companions.get((number, kind))

    def atlas_of(self, number: int, before: int | None) -> int:
        """Return the number of the atlas of a group's pictures: its own, or that of the group before."""
        own_atlas = self.companion_of(number, ChunkKind.ATLAS)
        atlas = self._checks.atlases.get(before) if own_atlas is None and before is not None else own_atlas
        if atlas is None:
            raise InputError(f"pictures of chunk {number}, which has no atlas; add one first")
        return atlas

    def _add(self, entry: IndexEntry, payload: bytes | Stored) -> int:
        pack(entry)  # refuses values that do not fit their fields
        try:
            number = self._checks.add(entry)
        except FormatError as error:
            raise InputError(f"a file that no reader would take: {error}") from error
        self._entries.append(entry)
        with _as_input_error(self._name):
            self._chunks.append(payload if isinstance(payload, Stored) else self._kept(payload))
        return number

    def _kept(self, payload: bytes) -> Stored:
        stored = Stored(self._spool, self._spool.seek(0, os.SEEK_END), len(payload))
        self._spool.write(payload)
        return stored

    def _finish(self) -> None:
        index, place = with_audio(Index(tuple(self._entries)), self._audio)
        head = pack_head(self.header, index)
        check_file(self.header, index, 0, len(head))
        if self._audio:
            self._chunks.insert(place, self._kept(self._audio))
        output = self._output
        with unfinished(output) if isinstance(output, Path) else nullcontext(output) as file:
            file.write(head)
            if len(self._chunks) != len(index.chunks):
                raise InputError(f"{self._name}: a chunk could not be written, encode again")
            for entry, chunk in zip(index.chunks, self._chunks, strict=True):
                data, ends = chunk.read(), list(accumulate(layer.size for layer in entry.layers))
                if len(data) != len(chunk) or _layers(data, ends) != entry.layers:  # it must still match its entry
                    raise InputError(f"{self._name}: a chunk could not be written, encode again")
                file.write(data)
            file.flush()
        if isinstance(output, Path):
            sync_folder(output.parent)
        self.size = len(head) + sum(map(len, self._chunks))


def pack_head(header: Header, index: Index, flags: int = 0) -> bytes:
    """Pack the head, which is everything before the chunks. Raises FormatError if readers would refuse it.

    The flag EDITED makes the metadata's item `edit` valid.
    """
    body = pack(header) + pack(index)
    size = least_size(Preamble) + len(body) + least_size(Checksum)
    check_head(size)
    data = pack(Preamble(MAGIC, VERSION, flags, size)) + body
    return data + pack(Checksum(zlib.crc32(data)))


def with_audio(index: Index, payload: bytes) -> tuple[Index, int]:
    """Return an index with an additional AUDIO chunk, and its number; without a payload, the same index.

    It lies behind all chunks that the first frame needs and before the others, so that a file plays while it arrives.
    """
    later, frames = len(index.chunks), dict[int, int]()
    if not payload:
        return index, later
    for number, entry in enumerate(index.chunks):
        if entry.kind == ChunkKind.GROUP:
            if entry.track in frames:
                later = number
                break
            frames[entry.track] = number
    layers = _layers(payload, (*range(AUDIO_PIECE, len(payload), AUDIO_PIECE), len(payload)))
    audio = IndexEntry(ChunkKind.AUDIO, Form.AUDIO_FILE, 0, 0, (), layers)
    moved = [
        replace(entry, depends_on=tuple(number + (number >= later) for number in entry.depends_on))
        for entry in index.chunks
    ]
    return Index((*moved[:later], audio, *moved[later:])), later


def _form(payload: bytes) -> Form:
    try:
        return Form(payload[0])
    except (IndexError, ValueError) as error:
        raise InputError(f"payload starting {payload[:4]!r}: its first byte must be a Form") from error


def _layers(payload: bytes, ends: Sequence[int]) -> tuple[Layer, ...]:
    ends = [int(end) for end in ends] or [len(payload)]
    starts = [0, *ends[:-1]]
    if ends[-1] != len(payload) or any(start >= end for start, end in zip(starts, ends, strict=True)):
        raise InputError(f"layers ending at {list(ends)}: must rise from above 0 to the payload's {len(payload)} bytes")
    view = memoryview(payload)
    return tuple(Layer(end - start, zlib.crc32(view[start:end])) for start, end in zip(starts, ends, strict=True))


@contextmanager
def _as_input_error(name: str) -> Iterator[None]:
    """Turn errors inside the block that the user can repair into an InputError that names the output."""
    try:
        yield
    except OSError as error:
        remedy = "; free space, or choose another folder" if error.errno in FULL else ""
        raise InputError(f"{name}: cannot be written: {error.strerror or error}{remedy}") from error
    except FormatError as error:
        raise InputError(f"{name}: cannot be stored: {error}") from error
