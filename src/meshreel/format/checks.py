"""Rules that the records of a head obey beyond their layout; breaking one raises FormatError."""

from __future__ import annotations

import json
import math
import re
from itertools import accumulate
from typing import Any, NoReturn

from ..errors import FormatError
from .budget import LIMITS, CostlyError, check_frames
from .edit import Edit, parse_edit
from .kinds import EXACT
from .layout import AudioFile, ChunkKind, Form, Header, Index, IndexEntry
from .records import unpack_all

# Limits of the format, stated in FORMAT.md, with room to spare; scripts/generate copies them to C++ and TypeScript.
LARGEST = 1e15  # of the numbers in a header: keeps everything computed from them finite (guess)
SMALLEST = 1e-15  # of a rate or scale (guess)
MOST_TRACKS = 256  # a frame needs a group of each track (guess)
MOST_CHANGES = 255  # patches on one background: random access decodes all of them (guess)
MOST_NESTED = 100  # objects and lists in each other, the metadata among them, so that no stack ends (guess)
# Kinds of chunks that belong to a group or a background, with their forms.
COMPANIONS = {
    ChunkKind.COLORS: Form.VERTEX_COLORS,
    ChunkKind.ATLAS: Form.PLACES,
    ChunkKind.PICTURES: Form.VIDEO,
    ChunkKind.COMPATIBLE: Form.VIDEO,
    ChunkKind.SPLATS: Form.GAUSSIANS,
}
GROUP_FORMS = (Form.LAPLACIAN, Form.LAYERS, Form.DRACO, Form.EMPTY)
_TOKENS = re.compile(r'"(?:[^"\\]|\\.)*"|[\[\]{}]')  # strings and brackets of JSON
_DEEPER = {"[": 1, "{": 1, "]": -1, "}": -1}


def check_header(header: Header, frame_count: int) -> None:
    """Check that rate and scale are positive, corners ordered, and intervals absent or one between each two frames."""
    for name in ("frame_rate", "scale"):
        value = getattr(header, name)
        if not SMALLEST <= value <= LARGEST:
            raise FormatError(f"Header.{name}: {value} is not within {SMALLEST} .. {LARGEST}")
    for name in ("origin", "minimum", "maximum"):
        value = getattr(header, name)
        if any(abs(number) > LARGEST for number in value):
            raise FormatError(f"Header.{name}: {value} is beyond {LARGEST}")
    if any(low > high for low, high in zip(header.minimum, header.maximum, strict=True)):
        raise FormatError(f"Header.minimum: {header.minimum} is above maximum {header.maximum}")
    if header.intervals and len(header.intervals) != frame_count - 1:
        raise FormatError(f"Header.intervals: {len(header.intervals)} for {frame_count} frames")
    if 0 in header.intervals:
        raise FormatError("Header.intervals: one is 0, two frames at the same time")
    last = header.first_time + sum(header.intervals)
    if header.first_time < -EXACT or last > EXACT:
        raise FormatError(f"Header.first_time: times {header.first_time} to {last} are beyond 53 bits")


class IndexChecks:
    """Rules of an index, checked entry by entry, so that the writer and the reader share them."""

    def __init__(self) -> None:
        self.frames: list[int] = []  # of each track so far
        self.groups: list[int] = []  # number of the newest group of each track
        self._changes: dict[int, int] = {}  # number of patches that lead to each STATIC chunk
        self._place = (0, -1)  # first frame and track of the newest group
        # Frames and track of each STATIC and GROUP, and the group that it is predicted from.
        self._whole: dict[int, tuple[int, int, int | None]] = {}
        self._bases: set[int] = set()  # chunks that may have an atlas: those that begin with a base mesh
        self._bearers: set[int] = set()  # groups that may have splats: those that begin with a mesh of all frames
        # Number of the chunk with the colours, atlas or pictures of a chunk, by that chunk's number and the kind.
        self.companions: dict[tuple[int, int], int] = {}
        self.atlases: dict[int, int] = {}  # of each group with pictures, the number of its atlas
        self._has_audio = False
        self._count = 0

    def add(self, entry: IndexEntry) -> int:
        """Add the next entry and return its number. Raises FormatError, and changes nothing, if it breaks a rule."""
        number = self._count
        if entry.kind in (ChunkKind.STATIC, ChunkKind.GROUP):
            if (entry.kind == ChunkKind.STATIC) != (entry.frames == 0):
                raise FormatError(f"chunk {number}: {ChunkKind(entry.kind).name} of {entry.frames} frames")
            if entry.form not in (*GROUP_FORMS, Form.PATCH):
                raise FormatError(f"chunk {number}: {ChunkKind(entry.kind).name} of form {entry.form}")
        if not entry.layers or any(layer.size == 0 for layer in entry.layers):
            raise FormatError(f"chunk {number}: a chunk or a layer without bytes")
        if len(set(entry.depends_on)) != len(entry.depends_on):
            raise FormatError(f"chunk {number}: depends on {entry.depends_on}, on one of them twice")
        if entry.kind == ChunkKind.STATIC:
            self._changes[number] = self._changes_of(entry)
            self._whole[number] = (0, 0, None)
            if entry.form == Form.DRACO:
                self._bases.add(number)
        elif entry.kind == ChunkKind.GROUP:
            self._add_group(entry)
            before = next((other for other in entry.depends_on if other not in self._changes), None)
            self._whole[number] = (entry.frames, entry.track, before)
            if entry.form == Form.LAYERS and before is None:
                self._bases.add(number)
            if number in self._bases or entry.form == Form.LAPLACIAN:
                self._bearers.add(number)
        elif entry.kind in COMPANIONS:
            self._add_companion(entry)
        elif entry.kind == ChunkKind.AUDIO:
            self._add_audio(entry)
        self._count += 1
        return number

    def finish(self) -> None:
        """Raise FormatError if there are no frames, or if a track has another number of frames than the first."""
        if not self.frames:
            raise FormatError("no frames: the index names no group")
        for track, frames in enumerate(self.frames):
            if frames != self.frames[0]:
                raise FormatError(f"track {track} has {frames} frames, track 0 has {self.frames[0]}")

    def _changes_of(self, entry: IndexEntry) -> int:
        """Return the number of patches that lead to a STATIC chunk: 0 for a mesh, 1 + those of its base for a patch."""
        number = self._count
        what = f"chunk {number}: a static chunk of form {Form(entry.form).name}"
        if entry.form not in (Form.DRACO, Form.PATCH) or entry.track:
            raise FormatError(f"{what} and track {entry.track}")
        if len(entry.depends_on) != (entry.form == Form.PATCH):
            raise FormatError(f"{what} depends on {entry.depends_on}")
        if entry.form == Form.DRACO:
            return 0
        [before] = entry.depends_on
        if before not in self._changes:
            raise FormatError(f"chunk {number}: a patch that depends on {before}, which is no static chunk before it")
        if self._changes[before] == MOST_CHANGES:
            raise FormatError(f"chunk {number}: patch {MOST_CHANGES + 1} of one background, at most {MOST_CHANGES}")
        return self._changes[before] + 1

    def _add_companion(self, entry: IndexEntry) -> None:
        """Add a companion, whose first dependency is the chunk that it belongs to; its kind decides the others."""
        number, kind, of = self._count, ChunkKind(entry.kind), next(iter(entry.depends_on), -1)
        if of not in self._whole or (of, kind) in self.companions:
            raise FormatError(f"chunk {number}: {kind.name} of {of}, which is no chunk before it, or has others")
        frames, track, before = self._whole[of]
        if entry.form != COMPANIONS[kind] or (entry.frames, entry.track) != (frames, track):
            text = f"{kind.name} of {entry.frames} frames, form {entry.form} and track {entry.track}"
            raise FormatError(f"chunk {number}: {text}, which are not those of chunk {of}")
        if entry.depends_on[1:] not in self._needed(kind, of, before):
            raise FormatError(f"chunk {number}: {kind.name} of {of} that depend on {entry.depends_on[1:]}")
        self.companions[of, kind] = number
        if entry.form == Form.VIDEO:
            self.atlases[of] = entry.depends_on[1]

    def _needed(self, kind: ChunkKind, of: int, before: int | None) -> tuple[tuple[int, ...], ...]:
        """Return the allowed dependencies of a companion of chunk `of`, beside `of`; `before` predicts that chunk."""
        if kind == ChunkKind.COLORS:
            predicting = None if before is None else self.companions.get((before, kind))
            return ((),) if predicting is None else ((), (predicting,))
        if kind == ChunkKind.ATLAS:
            return ((),) if of in self._bases else ()
        if kind == ChunkKind.SPLATS:
            return ((),) if of in self._bearers else ()
        atlas = self.companions.get((of, ChunkKind.ATLAS))
        if atlas is not None:
            return ((atlas,),)
        last = None if before is None else self.companions.get((before, kind))
        return () if last is None or before is None else ((self.atlases[before], last),)

    def _add_audio(self, entry: IndexEntry) -> None:
        size = sum(layer.size for layer in entry.layers)
        if self._has_audio or entry.form != Form.AUDIO_FILE or entry.frames or entry.track or entry.depends_on:
            raise FormatError(f"chunk {self._count}: audio besides other audio, or not on its own")
        if size > LIMITS.audio:
            raise CostlyError(f"chunk {self._count}: {size} bytes of audio, over {LIMITS.audio}")
        self._has_audio = True

    def _add_group(self, entry: IndexEntry) -> None:
        number, track = self._count, entry.track
        if entry.form == Form.PATCH:
            raise FormatError(f"chunk {number}: a group of form PATCH")
        if track > len(self.frames) or track >= MOST_TRACKS:
            raise FormatError(f"chunk {number}: track {track} after {len(self.frames)}, at most {MOST_TRACKS}")
        begun = track < len(self.frames)
        place = (self.frames[track] if begun else 0, track)
        if place <= self._place:
            raise FormatError(
                f"chunk {number}: track {track} from frame {place[0]} behind track {self._place[1]} from frame "
                f"{self._place[0]}; groups are in order of first frame and track"
            )
        groups = [other for other in entry.depends_on if other not in self._changes]
        if groups and (not begun or groups != [self.groups[track]]):
            text = "neither a static chunk before it nor the last group of its track"
            raise FormatError(f"chunk {number}: depends on {groups}, {text}")
        if len(entry.depends_on) - len(groups) > 1:
            raise FormatError(f"chunk {number}: depends on {entry.depends_on}, on several static chunks")
        if not begun:
            self.frames.append(0)
            self.groups.append(number)
        self.frames[track] += entry.frames
        self.groups[track] = number
        self._place = place


def check_index(index: Index) -> None:
    """Check a whole index; a FormatError names the chunk whose entry breaks a rule of IndexChecks."""
    checks = IndexChecks()
    for entry in index.chunks:
        checks.add(entry)
    checks.finish()


def check_file(header: Header, index: Index, flags: int, head_size: int) -> tuple[dict[str, Any], Edit, int]:
    """Check the records of a head of `head_size` bytes; return its metadata, its edit, and the file's size in bytes."""
    check_index(index)
    metadata = parse_metadata(header.metadata)
    groups = [entry for entry in index.chunks if entry.kind == ChunkKind.GROUP]
    edit = parse_edit(metadata, flags, sum(entry.frames for entry in groups if entry.track == 0))
    check_header(header, edit.frame_count)
    size = head_size + sum(layer.size for entry in index.chunks for layer in entry.layers)
    if size > EXACT:
        raise FormatError(f"Index.chunks: a file of {size} bytes, beyond 53 bits")
    check_frames(sum(entry.frames for entry in groups), size)
    return metadata, edit, size


def unpack_audio(payload: bytes) -> AudioFile:
    """Unpack the payload of an AUDIO chunk. Raises FormatError if it has no file, or an absurd start."""
    record = unpack_all(AudioFile, payload)
    if record.form != Form.AUDIO_FILE or not record.data or abs(record.start) > LARGEST:
        raise FormatError(f"audio of {len(record.data)} bytes that begins at {record.start} microseconds")
    return record


def parse_metadata(text: str) -> dict[str, Any]:
    """Parse Header.metadata, which must be a JSON object."""
    try:
        if max(accumulate(_DEEPER.get(token, 0) for token in _TOKENS.findall(text)), default=0) > MOST_NESTED:
            raise ValueError(f"over {MOST_NESTED} lists and objects in each other")
        metadata = json.loads(text, parse_constant=_refuse, parse_int=_whole, object_pairs_hook=_object)
    except (ValueError, RecursionError) as error:
        raise FormatError(f"Header.metadata: not JSON: {text!r:.40}") from error
    if not isinstance(metadata, dict):
        raise FormatError(f"Header.metadata: not a JSON object: {text!r:.40}")
    return metadata


def _object(members: list[tuple[str, Any]]) -> dict[str, Any]:
    """Return an object, of whose equal names the last counts; 1e999 and half a surrogate cannot be written."""
    json.dumps(members, allow_nan=False, ensure_ascii=False).encode()
    return dict(members)


def _whole(digits: str) -> int:
    if math.isinf(float(digits)):
        _refuse(digits)
    return int(digits)


def _refuse(constant: str) -> NoReturn:
    raise ValueError(constant)  # NaN and Infinity, which are not JSON, and numbers beyond doubles
