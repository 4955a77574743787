"""Files of an unfinished encode: a folder `NAME.part` beside the output, in which each interval is a small .reel file.

In: the intervals that are done, in any order. Out: their groups, whose payloads stay in the files until they are
needed. `whole.json` says what the bytes depend on, and has the survey; `scene.npz` has the parts of a scene. The
process that holds the folder's lock writes the output. A file that is damaged, or of another encode, counts as missing.
"""

from __future__ import annotations

import hashlib
import io
import json
import math
import re
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import asdict, astuple, replace
from itertools import accumulate
from pathlib import Path
from types import TracebackType
from typing import Any, BinaryIO

from ... import __version__
from ...container.reader import Chunk, ReelReader
from ...container.sources import BytesSource, FileSource
from ...container.writer import Companion, ReelWriter, Stored
from ...errors import FormatError, InputError
from ...format.checks import COMPANIONS
from ...format.layout import ChunkKind, Form, Header
from ...geometry.derived_sequences import DerivedSequence
from ...io.files import Place, first_difference, located, read_file, uploaded
from ...io.write import cannot_be_written, check_apart, claim, discard, part_of, sync, sync_folder, unfinished
from ...texts import json_of
from ..group.digests import versions
from ..group.forms import EncodedGroup, Fidelity
from ..group.interval import Interval
from ..settings.options import EncoderOptions

LOCK, WHOLE, SCENE = "lock", "whole.json", "scene.npz"
_INTERVAL = re.compile(r"\d{8,}-\d{3}\.reel")  # the number of its first frame, and its track
_KNOWN = re.compile(rf"{WHOLE}|{_INTERVAL.pattern}")  # by which a folder is told from others
_OWN = re.compile(rf"{LOCK}|\.?({WHOLE}|{SCENE}|{_INTERVAL.pattern})")  # with a dot: while it is written
_MOST = 0xFFFF  # bytes of metadata (FORMAT.md)
_OTHERWISE = "start over with --no-resume (resume=False)"


class IntervalFiles:
    """Context manager that holds the folder of an output, and with it the right to write this output.

    The folder is deleted where the block succeeds, and where it fails before anything is done. `resume`: True continues
    from what an earlier run left, False starts over, None refuses where there is something to continue.
    """

    def __init__(self, output: Path, resume: bool | None = None, lasting: bool = True) -> None:
        """Open the folder of `output` when the block begins; no other run can continue from one not `lasting`."""
        self.output, self.path = output, part_of(output, hidden=False)
        self.continued = 0  # intervals that an earlier run had done
        self.lasting = lasting
        self.whole: dict[str, Any] | None = None  # what an earlier run, or this one, wrote of the whole
        self._resume, self._begun, self._refused = resume, False, False
        self._done = set[str]()  # names of intervals

    def __enter__(self) -> IntervalFiles:
        with cannot_be_written(self.output):
            if self.output.is_dir():
                raise InputError(f"{self.output}: cannot be written: is a folder, name a file")
            self._lock = self._claimed()
            try:
                self._open()
            except BaseException:
                self._leave()
                raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if error is None:
            sync_folder(self.output.parent)
        done = self._contents() if error is not None and self.lasting else ""
        if not done:
            with suppress(OSError):
                self._clear()
        elif error is not None and self._begun and not self._refused and self.path.is_dir():
            error.add_note(f"{self.path} has {done}: continue with --resume")
        self._leave()

    def check(self, made: dict[str, Any]) -> None:
        """Raise InputError where the bytes of an earlier run depend on something else, as far as `made` says it."""
        made = _plain(made)
        if self.whole is not None and (before := {name: self.whole["made"].get(name) for name in made}) != made:
            text = f"{self.path}: is of another encode: {first_difference(before, made)}"
            raise InputError(f"{text}; give what it was begun with, or {_OTHERWISE}")

    def begin(self, made: dict[str, Any], facts: dict[str, Any], scene: bytes | None = None) -> str:
        """Write what the bytes depend on, facts about the whole, and a scene, where an earlier run has not.

        Return a digest of the former, which all files of intervals have. Raises InputError as `check` does.
        """
        self.check(made)
        digest = None if scene is None else hashlib.sha256(scene).hexdigest()
        if self.whole is None or scene is not None:
            self.whole = {"made": _plain(made), **facts, "scene": digest}
            if self.lasting:
                if scene is not None:
                    self._write(SCENE, scene)
                self._write(WHOLE, json.dumps(self.whole | {"digest": _digest(self.whole)}).encode())
        self._begun = True
        return _digest(self.whole["made"])[:16]

    @property
    def scene(self) -> bytes | None:
        """The parts of a scene as an earlier run packed them; None where it wrote none, or they are damaged."""
        if self.whole is None or self.whole["scene"] is None:
            return None
        with suppress(OSError):
            data = read_file(self.path / SCENE)
            return data if hashlib.sha256(data).hexdigest() == self.whole["scene"] else None
        return None

    def restart(self) -> None:
        """Forget all intervals."""
        with cannot_be_written(self.output):
            self._clear()
        self.whole, self._done, self.continued = None, set(), 0

    def take(self, interval: Interval, head: Header) -> list[EncodedGroup] | None:
        """Return the groups of an interval; None where no earlier run encoded it, or what it wrote is damaged."""
        name, place = _name(interval), place_of(interval)
        if name not in self._done:
            return None
        try:
            with FileSource(self.path / name) as source:
                reader = ReelReader(source)
                for chunk in reader.chunks:
                    reader.read_chunk(chunk.number)  # checks its sums
                groups, before = unpack_interval(self.path / name, reader), reader.metadata["interval"]
                is_ours = reader.metadata["encode"] == json_of(head.metadata)["encode"]
        except (FormatError, InputError, OSError, KeyError, TypeError, ValueError, AttributeError):
            is_ours = False
        if not is_ours:
            self._done.discard(name)
            return None
        if place != before:
            self._refused = True
            text = f"{self.path / name}: {named(interval)} is of another surface: {first_difference(before, place)}"
            raise InputError(f"{text}; if masks or depth have changed, {_OTHERWISE}")
        self.continued += 1
        return groups

    def keep(self, interval: Interval, data: bytes) -> list[EncodedGroup]:
        """Write the file of an interval; return its groups with payloads that are read when they are needed."""
        name = _name(interval)
        place = self._write(name, data)
        self._done.add(name)
        return unpack_interval(place, ReelReader(BytesSource(data)))

    def _claimed(self) -> BinaryIO:
        """Make the folder where it is missing, and lock it."""
        while True:
            if self.path.is_symlink() or (self.path.exists() and not self.path.is_dir()):
                text = "is no folder of an encode, as earlier versions of meshreel kept a file of this name"
                raise InputError(f"{self.path}: {text}, and in the way of one; move it away")
            self.path.mkdir(exist_ok=True)
            names = {path.name for path in self.path.iterdir()}
            known, others = any(map(_KNOWN.fullmatch, names)), sorted(n for n in names if not _OWN.fullmatch(n))
            if others and not known:
                text = f"is no folder of an encode, for it holds {others[0]}, and in the way of one"
                raise InputError(f"{self.path}: {text}; move it away")
            try:
                return claim(self.path / LOCK, self.output)
            except FileNotFoundError:
                continue  # another process has just finished the output
            except BaseException:
                with suppress(OSError):
                    self.path.rmdir()  # where it is empty
                raise

    def _open(self) -> None:
        """Find what an earlier run left, and start over where that is nothing, or not wanted."""
        names = {path.name for path in self.path.iterdir()}
        self._done, self.whole = set(filter(_INTERVAL.fullmatch, names)), self._read_whole()
        if self._done and self.whole is None and self._resume is not False:
            text = f"{self.path / WHOLE}: is damaged, or missing, and tells what {len(self._done)} intervals are of"
            raise InputError(f"{text}; {_OTHERWISE}")
        if (contents := self._contents()) and self._resume is None:
            text = f"{self.path}: has {contents}, of an encode that was stopped"
            raise InputError(f"{text}; continue with --resume (resume=True), or {_OTHERWISE}")
        if not self._resume or self.whole is None:
            self.restart()

    def _contents(self) -> str:
        """Describe the work from which another run can continue; an empty text if there is none."""
        if self._done:
            return f"the {len(self._done)} intervals that are done"
        return "" if self.scene is None else "the parts of the scene"

    def _read_whole(self) -> dict[str, Any] | None:
        """Return the facts in `whole.json`, or None if it is missing or damaged."""
        with suppress(FileNotFoundError, ValueError, KeyError, TypeError, AttributeError):
            record: dict[str, Any] = json_of(read_file(self.path / WHOLE))
            is_ours = record.pop("digest") == _digest(record) and isinstance(record["made"], dict) and "scene" in record
            return record if is_ours else None
        return None

    def _write(self, name: str, data: bytes) -> Path:
        """Write a file that is whole and on the disk when it has its name, and return its path.

        Nothing continues from files that do not last, which keep the names of unfinished ones.
        """
        temporary = self.path / f".{name}"
        with cannot_be_written(self.output):
            try:
                with temporary.open("wb") as file:
                    file.write(data)
                    sync(file)
                if not self.lasting:
                    return temporary
                temporary.replace(self.path / name)
            except BaseException:
                temporary.unlink(missing_ok=True)
                raise
        sync_folder(self.path)
        return self.path / name

    def _clear(self) -> None:
        """Remove the files of an encode, and leave others alone."""
        for path in self.path.iterdir():
            if path.name != LOCK and _OWN.fullmatch(path.name):
                path.unlink()

    def _leave(self) -> None:
        """Give up the right to write the output, and remove the folder where it is empty."""
        discard(self._lock, self.path / LOCK)
        with suppress(OSError):
            self.path.rmdir()


@contextmanager
def opened_output(
    output: str | Place, inputs: Iterable[Path], resume: bool | None, lasting: bool = True
) -> Iterator[tuple[BinaryIO, IntervalFiles]]:
    """Open an output, which appears when the block succeeds, and its folder, which does not last where it is a URL.

    Raises InputError where an output is one of the inputs, and where that of a URL should be continued.
    """
    place = located(output)
    is_here = isinstance(place, Path)
    if resume and not is_here:
        raise InputError(f"{place}: only an output on a disk can be continued; leave --resume (resume=True) out")
    with uploaded(place) as path:
        check_apart(path, inputs)
        with IntervalFiles(path, resume, lasting and is_here) as files, unfinished(path) as file:
            yield file, files


def made_of(sequence: DerivedSequence, options: EncoderOptions, masker: object) -> dict[str, Any]:
    """Return all facts that the bytes of an encode depend on, except the surface of the frames."""
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
    }


def pack_interval(interval: Interval, groups: Sequence[EncodedGroup], head: Header) -> bytes:
    """Return the file of an interval, whose track has number 0 in it; `head` is that of the whole.

    What the metadata have no room to say of its groups is in a chunk of a kind that readers skip.
    """
    facts = list[list[Any]]()
    for group in groups:  # what its chunk lacks, for JSON, in which null is an infinite number
        values = [value if math.isfinite(value) else None for value in map(float, astuple(group.fidelity))]
        key = None if group.key is None else int(group.key)
        facts.append([*values, key, group.canonical, group.lost_colors, group.mended])
    metadata = json_of(head.metadata) | {"interval": place_of(interval), "groups": facts}
    is_long = len(json.dumps(metadata)) > _MOST
    metadata |= {"groups": None} if is_long else {}
    file, first = io.BytesIO(), 0
    with ReelWriter(file, replace(head, metadata=json.dumps(metadata)), named(interval)) as writer:
        for group in groups:
            write_group(writer, first, group)
            first += group.frame_count
        if is_long:
            writer.add_skipped(bytes([Form.EMPTY]) + json.dumps(facts).encode())
    return file.getvalue()


def unpack_interval(path: Path, reader: ReelReader) -> list[EncodedGroup]:
    """Return the groups of an interval's file. Raises KeyError, TypeError or ValueError where no encoder wrote it."""
    found = list[EncodedGroup]()
    facts = reader.metadata["groups"] or json_of(reader.read_chunk(len(reader.chunks) - 1)[1:])
    for chunk, (*values, key, canonical, lost_colors, mended) in zip(reader.groups, facts, strict=True):
        fidelity = Fidelity(*(math.inf if value is None else float(value) for value in values))
        own = (one for one in reader.chunks if one.kind in COMPANIONS and one.depends_on[0] == chunk.number)
        companions = tuple(Companion(ChunkKind(c.kind), Stored(path, c.offset, c.size), _ends(c)) for c in own)
        coded = (Form(chunk.form), chunk.frame_count, b"", _ends(chunk), fidelity, bool(chunk.depends_on))
        group = EncodedGroup(*coded, None if key is None else int(key), Stored(path, chunk.offset, chunk.size))
        found.append(replace(group, canonical=bool(canonical), companions=companions, lost_colors=bool(lost_colors)))
        found[-1] = replace(found[-1], mended=bool(mended))
    return found


def _ends(chunk: Chunk) -> tuple[int, ...]:
    return tuple(accumulate(layer.size for layer in chunk.layers))


def write_group(
    writer: ReelWriter, first_frame: int, group: EncodedGroup, track: int = 0, static: Sequence[int] = ()
) -> int:
    """Write a group of a track, shown with a chunk of the background, and what belongs to it; return its number."""
    last = writer.last_of(track) if group.predicted else None
    depends_on = (*static, *(() if last is None else (last,)))
    number = writer.add_group(
        first_frame, group.frame_count, group.stored or group.payload, group.layers, depends_on, track
    )
    write_companions(writer, number, group.companions, last)
    return number


def write_companions(writer: ReelWriter, of: int, companions: Sequence[Companion], before: int | None) -> None:
    """Write what belongs to a chunk, which may be predicted from what belongs to the group before."""
    for companion in companions:
        depends_on, last = [of], writer.companion_of(before, companion.kind)
        if companion.kind in (ChunkKind.PICTURES, ChunkKind.COMPATIBLE):
            depends_on.append(writer.atlas_of(of, before))
        writer.add_companion(companion, depends_on if last is None else [*depends_on, last])


def place_of(interval: Interval) -> dict[str, Any]:
    """Return the place of an interval and what its groups depend on, beyond what the whole does."""
    return {
        "first_frame": interval.first_frame,
        "frames": len(interval.frames),
        "track": interval.track,
        "noise": interval.noise,
        "surface": interval.surface,
    }


def named(interval: Interval) -> str:
    """Return the name of an interval in error messages."""
    return f"the interval of frame {interval.first_frame}, track {interval.track}"


def _name(interval: Interval) -> str:
    """Return the name of the file of an interval."""
    return f"{interval.first_frame:08}-{interval.track:03}.reel"


def _plain(made: dict[str, Any]) -> dict[str, Any]:
    """Return facts as JSON gives them back."""
    found: dict[str, Any] = json.loads(json.dumps(made, default=lambda array: array.tolist()))
    return found


def _digest(record: dict[str, Any]) -> str:
    return hashlib.sha256(json.dumps(record).encode()).hexdigest()
