"""Joining of files: parts of one sequence become one file, and no payload is encoded again.

In: files whose frames follow one another, encoded from one survey. Out: a file, to the bytes of one encode of the whole
where the parts end at its intervals. Needs nothing of the extra `encode`.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from io import BytesIO
from itertools import accumulate
from pathlib import Path

from ..container.reader import ReelReader
from ..container.sources import FileSource, StreamSource
from ..container.writer import Companion, ReelWriter
from ..errors import FormatError, InputError
from ..format.checks import COMPANIONS
from ..format.layout import ChunkKind, Header
from ..io.read import first_difference, read_input
from ..io.remote import Place, uploaded
from ..io.write import check_apart
from .metadata import joined_metadata, of_all_parts, place_of


@dataclass(frozen=True, slots=True)
class Joined:
    """What became of the files."""

    frames: int
    size: int  # bytes
    missing: int  # frames of the sequence that no file has, where the files say of what they are parts


def concat(inputs: Sequence[Place], output: Place) -> Joined:
    """Join files one after the other as `output`, which appears when it is complete.

    One file is open at a time, and in memory where it is behind a URL. Raises InputError where files are no parts of
    one sequence, or are scenes: each has a background of its own. Raises FormatError for a damaged file.
    """
    if not inputs:
        raise InputError("no files to join; give at least one")
    if output in inputs:
        raise InputError(f"{output}: is the input, which it would replace; choose another name")
    with uploaded(output) as place:
        check_apart(place, [path for path in inputs if isinstance(path, Path)])
        header, whole = _joined_header(inputs)
        with ReelWriter(place, header) as writer:
            for path in inputs:
                _add(writer, path)
    return Joined(writer.frame_count, writer.size, max(whole - writer.frame_count, 0))


def _joined_header(inputs: Sequence[Place]) -> tuple[Header, int]:
    """Return the header of the whole, and how many frames that should have, after a look at each file."""
    header, parts, tracks = None, list[tuple[dict[str, object], int]](), 0
    for path in inputs:
        with closing(_source(path)) as source:
            reader = _opened(source, path)
        if reader.has_background:
            raise InputError(f"{path}: is a scene, whose background is its own; encode it in one run")
        if reader.header.first_time or reader.header.intervals:
            raise InputError(f"{path}: its frames have times of their own, which cannot be joined")
        header = reader.header if header is None else header
        tracks = tracks or len(reader.tracks)
        if len(reader.tracks) != tracks:
            text = f"{path}: {len(reader.tracks)} tracks, and {inputs[0]} has {tracks}"
            raise InputError(f"{text}; encode both with --survey FILE, which meshreel survey writes")
        try:
            _check_alike(path, reader, header, parts[0][0] if parts else reader.metadata, inputs[0])
            parts.append((reader.metadata, reader.frame_count))
            _check_order(path, parts)
            joined_metadata(parts[-1:])
        except (KeyError, TypeError, ValueError) as error:
            text = f"{path}: its metadata are not those of meshreel encode ({error!r})"
            raise InputError(f"{text}; encode it again") from None
    assert header is not None
    metadata, place = joined_metadata(parts), place_of(parts[0][0])
    return replace(header, metadata=json.dumps(metadata, separators=(",", ":"))), place[1] if place else 0


def _check_alike(path: Place, reader: ReelReader, header: Header, metadata: dict[str, object], first: Place) -> None:
    """Raise InputError where a file is no part of the sequence that the first is of."""
    for name in ("frame_rate", "origin", "scale", "minimum", "maximum"):
        ours, theirs = getattr(header, name), getattr(reader.header, name)
        if ours != theirs:
            text = f"{path}: {name} {theirs}, and of {first} {ours}: they are not encoded from one survey"
            raise InputError(f"{text}; encode both with --survey FILE, which meshreel survey writes")
    ours, theirs = of_all_parts(metadata), of_all_parts(reader.metadata)
    if ours != theirs:
        text = f"{path}: differs from {first}: {first_difference(ours, theirs)}"
        raise InputError(f"{text}; encode both with the same options")


def _check_order(path: Place, parts: Sequence[tuple[dict[str, object], int]]) -> None:
    """Raise InputError where the last part does not begin where those before it end."""
    first, ours = place_of(parts[0][0]), place_of(parts[-1][0])
    if first is None or ours is None:
        return
    end = first[0] + sum(frames for _, frames in parts[:-1])
    if ours[0] != end:
        text = f"{path}: begins at frame {ours[0]} of the sequence, and the next in turn is {end}"
        raise InputError(f"{text}; give each part once, in the order of the frames")


def _add(writer: ReelWriter, path: Place) -> None:
    """Add all groups of a file."""
    with closing(_source(path)) as source:
        reader, first_frame = _opened(source, path), writer.frame_count
        base = writer.chunk_count
        for chunk in reader.chunks:
            if chunk.kind != ChunkKind.GROUP and chunk.kind not in COMPANIONS:
                raise InputError(f"{path}: {chunk} is of a kind that this version cannot join; update meshreel")
            try:
                payload = reader.read_chunk(chunk.number)
            except FormatError as error:
                raise FormatError(f"{path}: {error}") from error
            ends = tuple(accumulate(layer.size for layer in chunk.layers))
            depends_on = [base + number for number in chunk.depends_on]
            if chunk.kind in COMPANIONS:
                writer.add_companion(Companion(ChunkKind(chunk.kind), payload, ends), depends_on)
                continue
            first = first_frame + chunk.first_frame
            writer.add_group(first, chunk.frame_count, payload, ends, depends_on, chunk.track)


def _source(path: Place) -> StreamSource:
    if isinstance(path, Path):
        return FileSource(path)
    return StreamSource(BytesIO(read_input(path, "check the URL and your rights")), str(path))


def _opened(source: StreamSource, path: Place) -> ReelReader:
    try:
        return ReelReader(source)
    except FormatError as error:
        raise FormatError(f"{path}: {error}") from error
