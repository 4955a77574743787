"""Chunks of files, copied byte for byte under another head. In: files. Out: a file, with audio of its own perhaps."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from itertools import chain, islice
from pathlib import Path
from typing import Any

from ..container.reader import Chunk, ReelReader
from ..container.sources import source_at
from ..container.writer import pack_head, with_audio
from ..errors import FormatError, InputError
from ..format.checks import check_file
from ..format.edit import ITEM
from ..format.layout import EDITED, ChunkKind, Header, Index, IndexEntry
from ..io.files import Place, uploaded
from ..io.write import check_apart, replacing

_MOST = 0xFFFF  # bytes of metadata (FORMAT.md)


@dataclass(frozen=True, slots=True)
class Edited:
    """Result of an edit."""

    frames: int  # shown
    size: int  # bytes
    hidden: int = 0  # frames of the file that are not shown: the first or last shown ones are predicted from them
    missing: int = 0  # frames of the sequence that no file has, if the files are parts of one
    differing: tuple[str, ...] = ()  # names of tags that differ among joined files; the first that has one counts
    lost_audio: bool = False  # the audio was removed: it would be out of step


@dataclass(frozen=True, slots=True)
class Piece:
    """Chunks of a file, in its order."""

    path: Place
    numbers: tuple[int, ...]
    entries: tuple[IndexEntry, ...]


@contextmanager
def opened(path: Place) -> Iterator[tuple[Place, ReelReader]]:
    """Open a file for the block; from a URL, only the head and the chunks that are copied are fetched."""
    source = source_at(path if isinstance(path, Path) else path.url)
    try:
        yield path, ReelReader(source)
    except FormatError as error:
        raise error if str(error).startswith(str(path)) else FormatError(f"{path}: {error}") from error
    finally:
        source.close()


def check_known(path: Place, chunks: Iterable[Chunk]) -> None:
    if unknown := [chunk for chunk in chunks if chunk.kind not in list(ChunkKind)]:
        raise InputError(f"{path}: {unknown[0]} is of a kind that this version cannot copy; update meshreel")


def piece_of(path: Place, reader: ReelReader, numbers: Iterable[int], first: int = 0) -> Piece:
    """Return chunks of a file, renumbered without gaps."""
    numbers = tuple(numbers)
    places = {number: place for place, number in enumerate(numbers, first)}
    chosen = [reader.index.chunks[number] for number in numbers]
    entries = (replace(entry, depends_on=tuple(places[n] for n in entry.depends_on)) for entry in chosen)
    return Piece(path, numbers, tuple(entries))


def silent(reader: ReelReader) -> list[int]:
    """Return the numbers of all chunks but the audio's."""
    return [chunk.number for chunk in reader.chunks if chunk.kind != ChunkKind.AUDIO]


def _with_metadata(header: Header, metadata: dict[str, Any]) -> Header:
    try:
        text = json.dumps(metadata, separators=(",", ":"), allow_nan=False)
    except (TypeError, ValueError) as error:
        raise InputError(f"metadata that JSON cannot hold ({error}); give text, numbers, lists or objects") from None
    if len(text) > _MOST:
        raise InputError(f"metadata of {len(text)} bytes: a file holds {_MOST}; give shorter tags, or join fewer files")
    return replace(header, metadata=text)


def written(output: Place, header: Header, metadata: dict[str, Any], pieces: list[Piece], audio: bytes = b"") -> Edited:
    """Write the chunks of all pieces, and audio, under one head; the file appears when it is complete."""
    header, index = _with_metadata(header, metadata), Index(tuple(e for piece in pieces for e in piece.entries))
    coded = sum(entry.frames for entry in index.chunks if entry.kind == ChunkKind.GROUP and entry.track == 0)
    if output in [piece.path for piece in pieces]:
        raise InputError(f"{output}: is the input, which it would replace; choose another name")
    index, place_of_audio = with_audio(index, audio)
    flags = EDITED if ITEM in metadata else 0
    try:
        head = pack_head(header, index, flags)
        _, edit, size = check_file(header, index, flags, len(head))
    except FormatError as error:
        raise InputError(f"{output}: cannot be stored: {error}") from error
    with uploaded(output) as place:
        check_apart(place, [piece.path for piece in pieces if isinstance(piece.path, Path)])
        with replacing(place) as file:
            file.write(head)
            payloads = _payloads(pieces)
            for payload in chain(islice(payloads, place_of_audio), (audio,), payloads):
                file.write(payload)
    return Edited(edit.frame_count, size, coded - edit.frame_count)


def _payloads(pieces: Sequence[Piece]) -> Iterator[bytes]:
    for piece in pieces:
        with opened(piece.path) as (path, reader):
            for number, entry in zip(piece.numbers, piece.entries, strict=True):
                if number >= len(reader.chunks) or reader.chunks[number].layers != entry.layers:
                    raise InputError(f"{path}: changed while it was read; start again when it is complete")
                yield reader.read_chunk(number)
