"""Journal of an encode: the intervals that are done, in a file beside the output, from which another run can continue.

In: the groups of each interval, in any order, and what their bytes depend on. Out: the same groups, from `NAME.part`,
which is no .reel file: MAGIC, and records of their length, their CRC-32, and their bytes: the length of a JSON text,
the text, and payloads. The first record says what the bytes depend on, each other one has the groups of an interval.
Where a record is torn or damaged, the journal ends before it.
"""

from __future__ import annotations

import json
import os
import struct
import zlib
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import asdict, astuple, replace
from pathlib import Path
from types import TracebackType
from typing import Any, BinaryIO

from ... import __version__
from ...container.writer import Companion, Stored
from ...errors import InputError
from ...format.layout import ChunkKind, Form
from ...geometry.derived_sequences import DerivedSequence
from ...io.read import first_difference
from ...io.remote import Place, located, uploaded
from ...io.unfinished import cannot_be_written, claim, discard, part_of, sync, sync_folder, unfinished
from ...io.write import check_apart
from ..group.digests import versions
from ..group.forms import EncodedGroup
from ..group.interval import Interval
from ..group.target import Fidelity
from ..settings.options import EncoderOptions

MAGIC = b"meshreel journal 2\n"
_HEAD, _TEXT = struct.Struct("<QI"), struct.Struct("<I")
_BLOCK = 1 << 20  # bytes that are read at once to check a record (guess)


class Journal:
    """Context manager that holds an output's journal, and with it the right to write this output.

    It is deleted where the block succeeds, and where it fails before an interval is done. `resume`: True continues from
    what an earlier run left, False starts over, None refuses where there is something to continue.
    """

    def __init__(self, output: Path, resume: bool | None = None, lasting: bool = True) -> None:
        """Open the journal of `output` when the block begins; no other run can continue from one not `lasting`."""
        self.output, self.path = output, part_of(output, hidden=False)
        self.continued = 0  # intervals that an earlier run had done
        self._resume, self._lasting = resume, lasting
        self._made: dict[str, Any] | None = None  # what the bytes of the records depend on
        self._records: dict[tuple[Any, Any], tuple[int, int]] = {}  # of intervals done before: begin and length
        self._done = self._end = 0
        self._begun = False

    def __enter__(self) -> Journal:
        with cannot_be_written(self.output):
            if self.output.is_dir():
                raise InputError(f"{self.output}: cannot be written: is a folder, name a file")
            self._file = claim(self.path, self.output)
            try:
                self._open()
            except BaseException:
                if os.fstat(self._file.fileno()).st_size == 0:  # no room for its first bytes
                    discard(self._file, self.path)
                else:
                    self._file.close()
                raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if error is None:
            sync_folder(self.output.parent)
        elif self._done and self._lasting:
            if self._begun:
                error.add_note(f"{self.path} has the {self._done} intervals that are done: continue with --resume")
            with suppress(OSError):  # bytes of a torn record, for which there is still no room
                self._file.close()
            return
        discard(self._file, self.path)

    def begin(self, made: dict[str, Any]) -> None:
        """Record what the bytes depend on. Raises InputError where an earlier run's depend on something else."""
        made = json.loads(json.dumps(made, default=lambda array: array.tolist()))
        if self._made is None:
            self._made = made
            if self._lasting:
                self._append({"made": made}, b"")
        elif self._made != made:
            text = f"{self.path}: is of another encode: {first_difference(self._made, made)}"
            raise InputError(f"{text}; give what it was begun with, or start over with --no-resume (resume=False)")
        self._begun = True

    def restart(self) -> None:
        """Forget all intervals."""
        with cannot_be_written(self.output):
            self._file.truncate(0)
            self._file.seek(0)
            self._file.write(MAGIC)
            self._file.flush()
        self._made, self._records, self._end = None, {}, len(MAGIC)
        self._done = self.continued = 0

    def take(self, interval: Interval) -> list[EncodedGroup] | None:
        """Return the groups of an interval, None where no earlier run encoded it."""
        place = _place(interval)
        if (record := self._records.get((place["first_frame"], place["track"]))) is None:
            return None
        head, offset = self._read(*record)
        if place != (before := head.get("interval")):
            text = f"{self.path}: {_named(interval)} is of another surface: {first_difference(before, place)}"
            raise InputError(f"{text}; have masks or depth changed? Start over with --no-resume (resume=False)")
        return self._groups(interval, head, offset)

    def keep(self, interval: Interval, groups: Sequence[EncodedGroup]) -> list[EncodedGroup]:
        """Store the groups of an interval; return them with payloads that are read when they are needed."""
        head = {"interval": _place(interval), "groups": [_packed(group) for group in groups]}
        parts = [part for group in groups for part in (group.payload, *(one.read() for one in group.companions))]
        offset = self._append(head, b"".join(parts))
        self._done += 1
        return self._groups(interval, head, offset)

    def _open(self) -> None:
        """Find what an earlier run left, and start over where that is nothing, or not wanted."""
        start = self._file.read(len(MAGIC))
        if not MAGIC.startswith(start):
            raise InputError(f"{self.path}: is no journal of an encode, and in the way of one; move it away")
        whole, is_damaged = self._whole_records() if start == MAGIC else ([], False)
        made = self._read(*whole[0])[0].get("made") if whole else None
        count = len(whole) - 1 if isinstance(made, dict) else 0
        if count and self._resume is None:
            text = f"{self.path}: has {count} intervals of an encode that was stopped"
            raise InputError(
                f"{text}; continue with --resume (resume=True), or start over with --no-resume (resume=False)"
            )
        if is_damaged and not count and self._resume is not False:
            raise InputError(f"{self.path}: is damaged at its beginning; start over with --no-resume (resume=False)")
        if not count or not self._resume:
            self.restart()
            return
        self._made, self._end = made, sum(whole[-1])
        for record in whole[1:]:
            place = self._read(*record)[0].get("interval")
            place = place if isinstance(place, dict) else {}
            self._records[place.get("first_frame"), place.get("track")] = record
        self._done = self.continued = count
        self._file.truncate(self._end)

    def _whole_records(self) -> tuple[list[tuple[int, int]], bool]:
        """Return begin and length of each record up to the first that is torn or damaged, and whether one is damaged.

        They are read block by block. A torn one ends beyond the file.
        """
        records: list[tuple[int, int]] = []
        size, at = self._file.seek(0, 2), len(MAGIC)
        while at + _HEAD.size <= size:
            self._file.seek(at)
            length, wanted = _HEAD.unpack(self._file.read(_HEAD.size))
            at += _HEAD.size
            if not _TEXT.size <= length <= size - at:
                break
            found = 0
            for start in range(0, length, _BLOCK):
                found = zlib.crc32(self._file.read(min(_BLOCK, length - start)), found)
            if found != wanted:
                return records, True
            records.append((at, length))
            at += length
        return records, False

    def _read(self, begin: int, length: int) -> tuple[dict[str, Any], int]:
        """Return the JSON of a record, and where its payloads begin."""
        self._file.seek(begin)
        (size,) = _TEXT.unpack(self._file.read(_TEXT.size))
        try:
            head = json.loads(self._file.read(min(size, length - _TEXT.size)))
        except (ValueError, RecursionError):
            head = None
        return head if isinstance(head, dict) else {}, begin + _TEXT.size + size

    def _append(self, head: dict[str, Any], payloads: bytes) -> int:
        """Write a record that is on the disk when this returns; return where its payloads begin."""
        text = json.dumps(head).encode()
        body = _TEXT.pack(len(text)) + text + payloads
        with cannot_be_written(self.output):
            self._file.seek(self._end)
            self._file.write(_HEAD.pack(len(body), zlib.crc32(body)) + body)
            sync(self._file)
        self._end += _HEAD.size + len(body)
        return self._end - len(payloads)

    def _groups(self, interval: Interval, head: dict[str, Any], offset: int) -> list[EncodedGroup]:
        """Return the groups that a record tells of. Raises InputError where no encoder wrote it."""
        found = []
        try:
            for form, count, size, layers, predicted, key, fidelity, companions, *told in head["groups"]:
                stored = Stored(self._file, offset, int(size))
                offset += stored.size
                others = list[Companion]()
                for kind, length, ends in companions:
                    others.append(Companion(ChunkKind(kind), Stored(self._file, offset, int(length)), tuple(ends)))
                    offset += int(length)
                error = Fidelity(*fidelity)
                group = EncodedGroup(Form(form), count, b"", tuple(layers), error, predicted, key, stored)
                lost_colors, canonical = told
                found.append(replace(group, companions=tuple(others), lost_colors=lost_colors, canonical=canonical))
        except (KeyError, TypeError, ValueError) as error:
            text = f"{self.path}: {_named(interval)} cannot be read ({error})"
            raise InputError(f"{text}; start over with --no-resume (resume=False)") from None
        return found


@contextmanager
def opened(
    output: str | Place, inputs: Iterable[Path], resume: bool | None, lasting: bool = True
) -> Iterator[tuple[BinaryIO, Journal]]:
    """Open an output, which appears when the block succeeds, and its journal, which does not last where it is a URL.

    Raises InputError where an output is one of the inputs, and where that of a URL should be continued.
    """
    place = located(output)
    is_here = isinstance(place, Path)
    if resume and not is_here:
        raise InputError(f"{place}: only an output on a disk can be continued; leave --resume (resume=True) out")
    with uploaded(place) as path:
        check_apart(path, inputs)
        with Journal(path, resume, lasting and is_here) as journal, unfinished(path) as file:
            yield file, journal


def made_of(sequence: DerivedSequence, options: EncoderOptions, masker: object) -> dict[str, Any]:
    """Return all that the bytes of an encode depend on, for a sequence of which each frame has been read."""
    return {
        "meshreel": __version__,
        "libraries": versions(),
        "frames": len(sequence),
        "frame_rate": sequence.frame_rate,
        "up": sequence.up,
        "preset": options.preset,
        "quality": options.quality,
        "options": asdict(options),
        "masks": type(masker).__name__,
        "surfaces": sequence.digests,
    }


def _place(interval: Interval) -> dict[str, Any]:
    """Return the place of an interval and what its groups depend on, beyond what the first record says."""
    return {
        "first_frame": interval.first_frame,
        "frames": len(interval.frames),
        "track": interval.track,
        "noise": interval.noise,
        "surface": interval.surface,
    }


def _named(interval: Interval) -> str:
    """Return the name of an interval in error messages."""
    return f"the interval of frame {interval.first_frame}, track {interval.track},"


def _packed(group: EncodedGroup) -> list[Any]:
    """Return a group without its payload, for JSON."""
    layers, key = [int(end) for end in group.layers], None if group.key is None else int(group.key)
    fidelity = [float(value) for value in astuple(group.fidelity)]
    others = [[int(one.kind), len(one), [int(end) for end in one.layers]] for one in group.companions]
    geometry = [int(group.form), int(group.frame_count), len(group.payload), layers, bool(group.predicted), key]
    return [*geometry, fidelity, others, group.lost_colors, group.canonical]
