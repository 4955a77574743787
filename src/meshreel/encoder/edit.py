"""Edits of .reel files that encode nothing again: chunks are copied, byte for byte, under another head.

In: files. Out: a file with some of their frames, one after the other, in another time, place or with other metadata.
What was edited is kept in the metadata. Needs nothing of the extra `encode`.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ..container.reader import Chunk, ReelReader
from ..container.sources import source_at
from ..container.writer import pack_head
from ..errors import FormatError, InputError
from ..format.budget import check_frames
from ..format.checks import check_header, check_index, parse_metadata
from ..format.edit import ITEM, Edit, is_rotation, nearest_rotation, parse_edit
from ..format.layout import EDITED, ChunkKind, Header, Index, IndexEntry
from ..io.read import first_difference
from ..io.remote import Place, located, uploaded
from ..io.sequence import SequenceOptions
from ..io.write import check_apart, replacing
from ..types import Up, check_up
from .file_intervals import interval_of, kept_chunks
from .metadata import HISTORY, MEANS, PART, joined_metadata, of_all_parts, place_of, scaled_metadata, upright

Name = str | Place
Numbers = Sequence[Any] | np.ndarray
Part = tuple[dict[str, Any], int]  # the metadata of a file, and its number of frames
_MOST = 0xFFFF  # bytes of metadata (FORMAT.md)
_OWN = ("key_frames", PART, HISTORY, ITEM, "up")  # metadata that `tag` leaves alone: others are computed from them


@dataclass(frozen=True, slots=True)
class Edited:
    """What became of the files."""

    frames: int  # shown
    size: int  # bytes
    hidden: int = 0  # frames that are in the file and not shown: those that the first or last shown ones are coded with
    missing: int = 0  # frames of the sequence that no file has, where the files say of what they are parts


@dataclass(frozen=True, slots=True)
class _Piece:
    """Chunks of a file, in its order."""

    path: Place
    numbers: tuple[int, ...]
    entries: tuple[IndexEntry, ...]


def cut(source: Name, output: Name, frames: str, at_keys: bool = False) -> Edited:
    """Write frames A:B (B excluded) of a file.

    Frames that these are coded with are kept and hidden, unless `at_keys`: then the cut is made before A and behind B,
    where frames stand alone. Raises InputError for frames that the file has not, and FormatError for a damaged one.
    """
    with _opened(located(source)) as (path, reader):
        count = reader.frame_count
        shown = SequenceOptions(frames=frames).chosen(count)
        if any(abs(int(number)) > count for number in frames.split(":") if number):
            raise InputError(f"{path}: frames {frames} of {count} frames; give numbers from 0 to {count}")
        whole = interval_of(reader, shown)
        shown = range(max(whole.start, 0), min(whole.stop, count)) if at_keys else shown
        numbers = kept_chunks(reader, whole)
        _check_known(path, (reader.chunks[number] for number in numbers))
        edit = Edit(shown.start - whole.start, shown.stop - whole.start, reader.edit.rotation)
        intervals = reader.header.intervals[shown.start : shown.stop - 1]
        header = replace(reader.header, first_time=round(1e6 * reader.timestamp(shown.start)), intervals=intervals)
        lost = (ITEM, PART) if len(shown) == count else (ITEM, PART, *MEANS)  # means are those of all frames
        metadata = {name: value for name, value in reader.metadata.items() if name not in lost}
        keys = metadata.get("key_frames")
        if isinstance(keys, list):
            metadata["key_frames"] = [key - shown.start for key in keys if isinstance(key, int) and key in shown]
        metadata |= edit.item(len(whole)) | _history(metadata, f"cut {shown.start}:{shown.stop}")
        piece = _piece(path, reader, numbers, {})
    return _written(located(output), _with(header, metadata), [piece])


def concat(sources: Sequence[Name], output: Name) -> Edited:
    """Join files one after the other: parts of a sequence, or cuts of one file.

    One file is open at a time. Raises InputError where files are not of one sequence, and FormatError for a damaged
    file.
    """
    if not sources:
        raise InputError("no files to join; give at least one")
    pieces, parts, heads, hidden = list[_Piece](), list[Part](), list[ReelReader](), [0, 0]
    for source in sources:
        with _opened(located(source)) as (path, reader):
            first = heads[0] if heads else reader
            parts.append((reader.metadata, reader.frame_count))
            _check_alike(path, reader, first, located(sources[0]), parts)
            ends = (reader.edit.first, reader.coded_count - reader.edit.end)
            if (ends[0] and heads) or (ends[1] and len(heads) < len(sources) - 1):
                text = f"{path}: hides {ends[0]} frames at its begin and {ends[1]} at its end, and would show them"
                raise InputError(f"{text}; cut it with --keys")
            hidden = [hidden[0] or ends[0], ends[1]]
            known = {n: sum(len(piece.numbers) for piece in pieces) + n for n in range(len(reader.chunks))}
            pieces.append(_piece(path, reader, range(len(reader.chunks)), known))
            heads.append(reader)
    frames = sum(count for _, count in parts)
    header, place = _timed(heads), place_of(parts[0][0])
    edit = Edit(hidden[0], hidden[0] + frames, heads[0].edit.rotation)
    metadata = joined_metadata(parts) | edit.item(frames + sum(hidden))
    if place is None and len(sources) > 1:
        before = [told for of, _ in parts for told in _history(of)[HISTORY]]
        metadata |= _history({HISTORY: [*dict.fromkeys(before)]}, f"concat of {len(sources)} files")
    done = _written(located(output), _with(header, metadata), pieces)
    return replace(done, missing=max(place[1] - frames, 0) if place else 0)


def retime(source: Name, output: Name, frame_rate: float | None = None, speed: float | None = None) -> Edited:
    """Write a file that plays at another frame rate (1/s, and evenly), or `speed` times as fast."""
    if (frame_rate is None) == (speed is None):
        raise InputError("give a frame rate or a speed, and not both")
    factor = frame_rate if speed is None else speed
    if factor is None or not 1e-3 <= factor <= 1e6:
        raise InputError(f"{'frame rate' if speed is None else 'speed'} {factor}: give a number from 0.001 to 1000000")
    with _opened(located(source)) as (path, reader):
        head = reader.header
        if speed is None:
            header, told = replace(head, frame_rate=factor, first_time=0, intervals=()), f"retime to {factor:g}/s"
        else:
            intervals = tuple(max(round(interval / speed), 1) for interval in head.intervals)
            header = replace(head, frame_rate=head.frame_rate * speed, intervals=intervals)
            told = f"retime by {speed:g}"
        return _relabelled(path, reader, output, header, reader.metadata | _history(reader.metadata, told))


def transform(
    source: Name,
    output: Name,
    scale: float = 1.0,
    rotation: Numbers | None = None,
    translation: Numbers = (0.0, 0.0, 0.0),
    up: Up | None = None,
) -> Edited:
    """Write a file whose frames are scaled and rotated about the world's origin, then moved (m).

    `rotation` is a matrix of 3 x 3. Scale and translation are exact and known to all readers; versions before this one
    refuse a rotated file. `up` names another axis that points up, and moves nothing.
    """
    turn = _numbers("rotation", np.eye(3) if rotation is None else rotation, (3, 3))
    move = _numbers("translation", translation, (3,))
    if not 1e-9 <= scale <= 1e9:
        raise InputError(f"scale {scale}: give a number from 1e-9 to 1e9, as 0.001 for millimetres")
    if not is_rotation(turn.ravel().tolist()):
        raise InputError(f"rotation {turn.tolist()}: give the three rows of a rotation matrix")
    if up is not None:
        check_up(up)
    with _opened(located(source)) as (path, reader):
        head, turn = reader.header, turn if rotation is None else nearest_rotation(turn)
        origin = scale * (turn @ np.array(head.origin)) + move
        header = replace(head, scale=scale * head.scale, origin=tuple(map(float, origin)))
        before = np.array(reader.edit.rotation).reshape(3, 3) if reader.edit.rotation else np.eye(3)
        both = before if rotation is None else nearest_rotation(turn @ before)
        rotated = tuple(both.ravel().tolist()) if np.abs(both - np.eye(3)).max() > 1e-12 else ()
        try:
            metadata = scaled_metadata(reader.metadata, scale)
        except (KeyError, TypeError, ValueError) as error:
            raise _unknown(path, error) from None
        if up is not None:
            metadata = {name: value for name, value in metadata.items() if name != "up"} | upright(up)
        told = f"transform by {scale:g}, {np.round(turn, 6).tolist()}, {move.tolist()}"
        edit = replace(reader.edit, rotation=rotated)
        return _relabelled(path, reader, output, header, metadata | _history(metadata, told), edit)


def tag(source: Name, output: Name, values: dict[str, Any]) -> Edited:
    """Write a file with other metadata: each name with its value, which JSON can hold; None takes a name away."""
    if own := [name for name in values if name in _OWN or not name]:
        raise InputError(f"{own[0]!r} is no name for a tag: readers use it; choose another, as title")
    with _opened(located(source)) as (path, reader):
        metadata = {name: value for name, value in (reader.metadata | values).items() if value is not None}
        return _relabelled(path, reader, output, reader.header, metadata)


def _check_alike(path: Place, reader: ReelReader, other: ReelReader, first: Place, parts: Sequence[Part]) -> None:
    """Raise InputError where a file, the last of the parts, is not of the sequence of the first, or not the next."""
    if len(reader.tracks) != len(other.tracks):
        text = f"{path}: {len(reader.tracks)} tracks, and {first} has {len(other.tracks)}"
        raise InputError(f"{text}; encode both with --survey FILE, which meshreel survey writes")
    for name in ("frame_rate", "origin", "scale", "minimum", "maximum"):
        ours, theirs = getattr(other.header, name), getattr(reader.header, name)
        if ours != theirs:
            text = f"{path}: {name} {theirs}, and of {first} {ours}: they are not encoded from one survey"
            raise InputError(f"{text}; encode both with --survey FILE, which meshreel survey writes")
    if reader.edit.rotation != other.edit.rotation:
        raise InputError(f"{path}: is rotated otherwise than {first}; transform both in the same way")
    _check_known(path, reader.chunks)
    try:
        ours, theirs = of_all_parts(other.metadata), of_all_parts(reader.metadata)
        joined_metadata(parts[-1:])
        begin, own = place_of(parts[0][0]), place_of(parts[-1][0])
    except (KeyError, TypeError, ValueError) as error:
        raise _unknown(path, error) from None
    if ours != theirs:
        text = f"{path}: differs from {first}: {first_difference(ours, theirs)}"
        raise InputError(f"{text}; encode both with the same options")
    end = sum(frames for _, frames in parts[:-1])
    if begin is not None and own is not None and own[0] != begin[0] + end:
        text = f"{path}: begins at frame {own[0]} of the sequence, and the next in turn is {begin[0] + end}"
        raise InputError(f"{text}; give each part once, in the order of the frames")


def _unknown(path: Place, error: Exception) -> InputError:
    return InputError(f"{path}: its metadata are not those of meshreel encode ({error!r}); encode it again")


def _numbers(name: str, given: Numbers, shape: tuple[int, ...]) -> np.ndarray:
    """Return numbers as an array. Raises InputError where they are not finite, or not of the shape."""
    try:
        array = np.asarray(given, np.float64)
    except (TypeError, ValueError):
        array = np.empty(0)
    if array.shape != shape or not np.isfinite(array).all():
        text = " ".join(repr(given).split())
        raise InputError(f"{name} {text:.80}: give {' x '.join(map(str, shape))} finite numbers")
    return array


def _check_known(path: Place, chunks: Iterable[Chunk]) -> None:
    if unknown := [chunk for chunk in chunks if chunk.kind not in list(ChunkKind)]:
        raise InputError(f"{path}: {unknown[0]} is of a kind that this version cannot copy; update meshreel")


def _timed(readers: Sequence[ReelReader]) -> Header:
    """Return the header of files one after the other, with the times that their frames have in them."""
    first = readers[0].header
    if not any(reader.header.intervals for reader in readers):
        return first
    steps = list[int]()
    for reader in readers:
        even = [round(1e6 / reader.frame_rate)]
        steps += [*(reader.header.intervals or even * (reader.frame_count - 1)), *even]
    return replace(first, intervals=tuple(steps[:-1]))


def _history(metadata: dict[str, Any], *told: str) -> dict[str, Any]:
    """Return the metadata that tell of more edits."""
    before = metadata.get(HISTORY)
    return {HISTORY: [*map(str, before if isinstance(before, list) else ()), *told]}


def _with(header: Header, metadata: dict[str, Any]) -> Header:
    try:
        text = json.dumps(metadata, separators=(",", ":"), allow_nan=False)
    except (TypeError, ValueError) as error:
        raise InputError(f"metadata that JSON cannot hold ({error}); give text, numbers, lists or objects") from None
    if len(text) > _MOST:
        raise InputError(f"metadata of {len(text)} bytes: a file holds {_MOST}; give shorter tags, or join fewer files")
    return replace(header, metadata=text)


def _piece(path: Place, reader: ReelReader, numbers: Iterable[int], known: dict[int, int]) -> _Piece:
    """Return chunks of a file with the numbers that they get: `known`, or one after the other."""
    numbers = tuple(numbers)
    places = known or {number: place for place, number in enumerate(numbers)}
    entries = tuple(
        replace(entry, depends_on=tuple(places[number] for number in entry.depends_on))
        for entry in (reader.index.chunks[number] for number in numbers)
    )
    return _Piece(path, numbers, entries)


def _relabelled(
    path: Place, reader: ReelReader, output: Name, header: Header, metadata: dict[str, Any], edit: Edit | None = None
) -> Edited:
    """Write a file with all its chunks, of unknown kinds, too, under another header, with its own edit or another."""
    metadata = {name: value for name, value in metadata.items() if name != ITEM}  # without the flag, it is none
    metadata |= (edit or reader.edit).item(reader.coded_count)
    piece = _Piece(path, tuple(range(len(reader.chunks))), reader.index.chunks)
    return _written(located(output), _with(header, metadata), [piece])


def _written(output: Place, header: Header, pieces: Sequence[_Piece]) -> Edited:
    """Write the chunks of all pieces under one head; the file appears when it is complete."""
    index = Index(tuple(entry for piece in pieces for entry in piece.entries))
    coded = sum(entry.frames for entry in index.chunks if entry.kind == ChunkKind.GROUP and entry.track == 0)
    if output in [piece.path for piece in pieces]:
        raise InputError(f"{output}: is the input, which it would replace; choose another name")
    try:
        metadata = parse_metadata(header.metadata)
        flags = EDITED if ITEM in metadata else 0
        edit = parse_edit(metadata, flags, coded)
        check_header(header, edit.end - edit.first)
        check_index(index)
        head = pack_head(header, index, flags)
        size = len(head) + sum(layer.size for entry in index.chunks for layer in entry.layers)
        check_frames(sum(entry.frames for entry in index.chunks if entry.kind == ChunkKind.GROUP), size)
    except FormatError as error:
        raise InputError(f"{output}: cannot be stored: {error}") from error
    with uploaded(output) as place:
        check_apart(place, [piece.path for piece in pieces if isinstance(piece.path, Path)])
        with replacing(place) as file:
            file.write(head)
            for payload in _payloads(pieces):
                file.write(payload)
    return Edited(edit.end - edit.first, size, coded - (edit.end - edit.first))


def _payloads(pieces: Sequence[_Piece]) -> Iterator[bytes]:
    for piece in pieces:
        with _opened(piece.path) as (path, reader):
            for number, entry in zip(piece.numbers, piece.entries, strict=True):
                if number >= len(reader.chunks) or reader.chunks[number].layers != entry.layers:
                    raise InputError(f"{path}: changed while it was read; start again when it is complete")
                try:
                    yield reader.read_chunk(number)
                except FormatError as error:
                    raise FormatError(f"{path}: {error}") from error


@contextmanager
def _opened(path: Place) -> Iterator[tuple[Place, ReelReader]]:
    """Open a file for the block; of one behind a URL, the head and the chunks that are copied are fetched."""
    source = source_at(path if isinstance(path, Path) else path.url)
    try:
        reader = ReelReader(source)
        yield path, reader
    except FormatError as error:
        known = str(error).startswith(str(path))
        raise error if known else FormatError(f"{path}: {error}") from error
    finally:
        source.close()
