"""Edits of .reel files: chunks are copied, byte for byte, under another head. Needs nothing of the extra `encode`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import accumulate
from typing import Any

import numpy as np

from ..container.reader import ReelReader
from ..errors import InputError
from ..format.checks import COMPANIONS
from ..format.edit import ITEM, Edit, is_rotation, joined, nearest_rotation
from ..format.layout import Form, Header
from ..format.records import pack
from ..format.view import ITEM as VIEW
from ..format.view import USUAL, View
from ..io.files import Place, first_difference, located, located_all
from ..io.sequence import SequenceOptions
from ..types import Up, check_up
from .audio import Given, joined_audio, packed_audio
from .copies import Edited, Piece, check_known, opened, piece_of, silent, written
from .metadata import (
    HISTORY,
    LAST,
    LEAST_COVERED,
    MEANS,
    PART,
    RECORDED,
    joined_metadata,
    place_in_whole,
    scaled_metadata,
    shared,
    up_metadata,
)

Name = str | Place
Numbers = Sequence[Any] | np.ndarray
Part = tuple[dict[str, Any], int]  # the metadata of a file, and its number of frames
_OWN = (PART, HISTORY, ITEM, VIEW, LAST, *RECORDED)  # metadata that `tag` does not change: others depend on them


def cut(source: Name, output: Name, frames: str, at_keys: bool = False) -> Edited:
    """Write frames A:B (B excluded) of a file.

    Frames that these are coded with are kept and hidden, unless `at_keys`: then the cut is made before A and behind B,
    where frames stand alone. Audio is kept whole, and stays in step. Raises InputError for frames that the file has
    not, and FormatError for a damaged one.
    """
    with opened(located(source)) as (path, reader):
        count = reader.frame_count
        asked = SequenceOptions(frames=frames).chosen(count)
        if any(abs(int(number)) > count for number in frames.split(":") if number):
            raise InputError(f"{path}: frames {frames} of {count} frames; give numbers from 0 to {count}")
        coded = range(reader.edit.coded(asked.start), reader.edit.coded(asked.stop - 1) + 1)
        whole = interval_of(reader, coded)
        numbers = kept_chunks(reader, whole)
        check_known(path, (reader.chunks[number] for number in numbers))
        low, high = (whole.start, whole.stop) if at_keys else (coded.start, coded.stop)
        kept = ((max(run.start, low) - whole.start, min(run.stop, high) - whole.start) for run in reader.edit.shown)
        edit = Edit(joined(range(*ends) for ends in kept), reader.edit.rotation)
        first = sum(len(range(run.start, min(run.stop, low))) for run in reader.edit.shown)
        shown = range(first, first + edit.frame_count)
        intervals = reader.header.intervals[shown.start : shown.stop - 1]
        header = replace(reader.header, first_time=round(1e6 * reader.timestamp(shown.start)), intervals=intervals)
        lost = (ITEM, PART) if len(shown) == count else (ITEM, PART, LEAST_COVERED, *MEANS)  # which are of all frames
        metadata = {name: value for name, value in reader.metadata.items() if name not in lost}
        if behind := reader.header.intervals[shown.stop - 1 : shown.stop]:
            metadata[LAST] = behind[0]
        keys = metadata.get("key_frames")
        if isinstance(keys, list):
            metadata["key_frames"] = [key - shown.start for key in keys if isinstance(key, int) and key in shown]
        metadata |= edit.item(len(whole)) | _history(metadata, f"cut {shown.start}:{shown.stop}")
        piece = piece_of(path, reader, numbers)
    return written(located(output), header, metadata, [piece])


def concat(sources: Sequence[Name], output: Name) -> Edited:
    """Join files one after the other: parts of a sequence, or cuts of one file.

    One file is open at a time. Frames that a file hides stay hidden. Of tags that differ, those of the first file that
    has them are kept, and the result names them. Where some have audio, it must be the same at the same time, as in
    cuts of one file. Raises InputError where files are not of one sequence, and FormatError for a damaged file.
    """
    places = located_all(sources)
    if not places:
        raise InputError("no files to join; give at least one")
    pieces, parts, heads, audio = list[Piece](), list[Part](), list[ReelReader](), None
    for place in places:
        with opened(place) as (path, reader):
            first = heads[0] if heads else reader
            parts.append((reader.metadata, reader.frame_count))
            _check_alike(path, reader, first, places[0], parts)
            pieces.append(piece_of(path, reader, silent(reader), sum(len(piece.numbers) for piece in pieces)))
            heads.append(reader)
            later = _begin_of_last(heads) - reader.header.first_time
            audio = joined_audio(audio, path, reader.read_audio(), later)
    frames = sum(count for _, count in parts)
    header, whole = _timed(heads), place_in_whole(parts[0][0])
    befores = [*accumulate((head.coded_count for head in heads), initial=0)]
    moved = ((run, before) for head, before in zip(heads, befores, strict=False) for run in head.edit.shown)
    shown = joined(range(run.start + before, run.stop + before) for run, before in moved)
    edit, (metadata, differing) = Edit(shown, heads[0].edit.rotation), joined_metadata(parts)
    metadata |= edit.item(befores[-1])
    if whole is None and len(places) > 1:
        before = [entry for of, _ in parts for entry in _history(of)[HISTORY]]
        metadata |= _history({HISTORY: [*dict.fromkeys(before)]}, f"concat of {len(places)} files")
    done = written(located(output), header, metadata, pieces, b"" if audio is None else pack(audio))
    return replace(done, missing=max(whole[1] - frames, 0) if whole else 0, differing=differing)


def retime(source: Name, output: Name, frame_rate: float | None = None, speed: float | None = None) -> Edited:
    """Write a file that plays at another frame rate (1/s, in equal steps) or `speed` times as fast, without audio."""
    if (frame_rate is None) == (speed is None):
        raise InputError("give a frame rate or a speed, and not both")
    factor = frame_rate if speed is None else speed
    if factor is None or not 1e-3 <= factor <= 1e6:
        raise InputError(f"{'frame rate' if speed is None else 'speed'} {factor}: give a number from 0.001 to 1000000")
    with opened(located(source)) as (path, reader):
        head = reader.header
        if speed is None:
            header, entry = replace(head, frame_rate=factor, first_time=0, intervals=()), f"retime to {factor:g}/s"
        else:
            intervals = tuple(max(round(interval / speed), 1) for interval in head.intervals)
            header = replace(head, frame_rate=head.frame_rate * speed, intervals=intervals)
            entry = f"retime by {speed:g}"
        silent, metadata = None if reader.audio is None else b"", reader.metadata | _history(reader.metadata, entry)
        if isinstance(last := metadata.pop(LAST, None), int) and speed is not None:
            metadata[LAST] = max(round(last / speed), 1)
        done = _relabelled(path, reader, output, header, metadata, audio=silent)
        return replace(done, lost_audio=silent is not None)


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
    with opened(located(source)) as (path, reader):
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
            metadata = {name: value for name, value in metadata.items() if name != "up"} | up_metadata(up)
        entry = f"transform by {scale:g}, {np.round(turn, 6).tolist()}, {move.tolist()}"
        edit = replace(reader.edit, rotation=rotated)
        return _relabelled(path, reader, output, header, metadata | _history(metadata, entry), edit)


def tag(
    source: Name,
    output: Name,
    values: dict[str, Any] | None = None,
    *,
    audio: Given | None = None,
    audio_start: float | None = None,
    view: Numbers | None = None,
) -> Edited:
    """Write a file with other metadata, audio or first view.

    `values` are names with values that JSON can hold; None takes a name away. `audio` is a path, a URL or the bytes of
    an audio file, in place of one that the file has; no bytes take that away. It begins `audio_start` seconds after the
    first frame (0), which may also move the audio that the file has. `view` is what players begin with: position and
    target (x, y, z, m, as frames have them), and perhaps the degrees of the field of view of the picture's height (45).
    Raises InputError for other audio, values or views.
    """
    values = values or {}
    if own := [name for name in values if name in _OWN or not name]:
        raise InputError(f"{own[0]!r} is no name for a tag: readers use it; choose another, as title")
    with opened(located(source)) as (path, reader):
        metadata = {name: value for name, value in (reader.metadata | values).items() if value is not None}
        metadata |= {} if view is None else _normalised(reader, view).item
        if audio is None and audio_start is not None:
            if (known := reader.read_audio()) is None:
                raise InputError(f"{path}: has no audio that could begin at {audio_start:g} s; give one, too")
            audio = known.data
        payload = None if audio is None else b""
        if audio:
            payload = packed_audio(audio, audio_start or 0.0, reader.header.first_time)
        return _relabelled(path, reader, output, reader.header, metadata, audio=payload)


def _normalised(reader: ReelReader, view: Numbers) -> View:
    """Return a view in the normalised coordinates of a file. Raises InputError for one that no file may have."""
    numbers = _numbers("view", [*view, USUAL] if len(view) == 6 else view, (7,))
    turn = np.array(reader.edit.rotation or np.eye(3)).reshape(3, 3)
    places = (numbers[:6].reshape(2, 3) - reader.header.origin) @ turn / reader.header.scale
    position, target = (tuple(place) for place in places.tolist())
    found, fov = View(position, target, float(numbers[6])), numbers[6]
    if not 0 < fov < 180:
        raise InputError(f"view: a field of view of {fov:g} degrees; give one between 0 and 180, as 45")
    if not found.is_valid:
        text = f"view from {numbers[:3].tolist()} to {numbers[3:6].tolist()}"
        raise InputError(f"{text}: position and target are the same, or too far away; give two places, m")
    return found


def _check_alike(path: Place, reader: ReelReader, other: ReelReader, first: Place, parts: Sequence[Part]) -> None:
    """Raise InputError if the last of the parts is of another sequence than the first, or not the next part."""
    names = ("frame_rate", "origin", "scale", "minimum", "maximum")
    pairs = [(name, getattr(other.header, name), getattr(reader.header, name)) for name in names]
    for name, ours, theirs in [("number of tracks", len(other.tracks), len(reader.tracks)), *pairs]:
        if ours != theirs:
            text = f"{path}: {name} {theirs}, and of {first} {ours}: they are not encoded from one survey"
            raise InputError(f"{text}; encode both with --survey FILE, which meshreel survey writes")
    if reader.edit.rotation != other.edit.rotation:
        raise InputError(f"{path}: is rotated otherwise than {first}; transform both in the same way")
    check_known(path, reader.chunks)
    if "interval" in reader.metadata:
        raise InputError(f"{path}: is an interval of an encode that was stopped; finish that with --resume")
    try:
        ours, theirs = shared(other.metadata), shared(reader.metadata)
        joined_metadata(parts[-1:])
        begin, own = place_in_whole(parts[0][0]), place_in_whole(parts[-1][0])
    except (KeyError, TypeError, ValueError, OverflowError) as error:
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
    """Return numbers as an array. Raises InputError if they are not finite, or not of the shape."""
    try:
        array = np.asarray(given, np.float64)
    except (TypeError, ValueError):
        array = np.empty(0)
    if array.shape != shape or not np.isfinite(array).all():
        text = " ".join(repr(given).split())
        raise InputError(f"{name} {text:.80}: give {' x '.join(map(str, shape))} finite numbers")
    return array


def _timed(readers: Sequence[ReelReader]) -> Header:
    """Return the header of files one after the other, with the times of their frames."""
    first = readers[0].header
    if not any(reader.header.intervals or LAST in reader.metadata for reader in readers):
        return first
    steps = list[int]()
    for reader in readers:
        even, last = round(1e6 / reader.frame_rate), reader.metadata.get(LAST)
        steps += reader.header.intervals or [even] * (reader.frame_count - 1)
        steps.append(last if isinstance(last, int) and 0 < last < 1e15 else even)
    return replace(first, intervals=tuple(steps[:-1]))


def _history(metadata: dict[str, Any], *edits: str) -> dict[str, Any]:
    """Return the history of a file as metadata, with these edits added."""
    before = metadata.get(HISTORY)
    return {HISTORY: [*map(str, before if isinstance(before, list) else ()), *edits]}


def _begin_of_last(readers: Sequence[ReelReader]) -> int:
    """Return the time of the first frame of the last of joined files, microseconds."""
    header, frames = _timed(readers), sum(reader.frame_count for reader in readers[:-1])
    before = sum(header.intervals[:frames]) if header.intervals else round(1e6 * frames / header.frame_rate)
    return header.first_time + before


def _relabelled(
    path: Place,
    reader: ReelReader,
    output: Name,
    header: Header,
    metadata: dict[str, Any],
    edit: Edit | None = None,
    audio: bytes | None = None,
) -> Edited:
    """Write a file with all its chunks under another header; with `audio`, or no bytes, unknown kinds are refused."""
    metadata = {name: value for name, value in metadata.items() if name != ITEM}  # not an edit if the flag is missing
    metadata |= (edit or reader.edit).item(reader.coded_count)
    piece = Piece(path, tuple(range(len(reader.chunks))), reader.index.chunks)
    if audio is not None:
        check_known(path, reader.chunks)
        piece = piece_of(path, reader, silent(reader))
    return written(located(output), header, metadata, [piece], audio or b"")


def interval_of(reader: ReelReader, frames: range) -> range:
    """Return the shortest interval that contains given frames, and begins and ends with groups of all tracks.

    It begins with groups that name no group before. Pictures of a background are counted from the first frame that it
    is shown in, which an interval then begins with. Frames have the numbers of coded ones.
    """
    start, end = frames.start, frames.stop
    while True:
        kept = set(kept_chunks(reader, range(start, end)))
        groups = [group for group in reader.groups if group.number in kept]
        named = {number for group in groups for number in group.depends_on}
        timed = [c.depends_on[0] for c in reader.chunks if c.form == Form.VIDEO and not c.frame_count]  # states
        begins = [*(group.coded for group in groups), *(reader.shown_from[n] for n in timed if n in named)]
        if (found := (min(begins), max(group.coded + group.frame_count for group in groups))) == (start, end):
            return range(start, end)
        start, end = found


def kept_chunks(reader: ReelReader, frames: range) -> list[int]:
    """Return the numbers of the chunks that coded frames need, and of audio, in the order of the file."""
    kept = {g.number for g in reader.groups if g.coded < frames.stop and g.coded + g.frame_count > frames.start}
    waiting = list(kept)
    while waiting:
        new = set(reader.chunks[waiting.pop()].depends_on) - kept
        kept |= new
        waiting += new
    kept |= {c.number for c in reader.chunks if c.kind in COMPANIONS and c.depends_on[0] in kept}
    return sorted(kept | ({reader.audio.number} if reader.audio else set()))
