"""Sequences of meshes from files, read lazily: one frame in memory at a time."""

from __future__ import annotations

import copy
import operator
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from threading import Lock
from typing import Any

import numpy as np

from ..errors import InputError
from ..texts import json_of
from ..types import Mesh, MeshSequence, Up, known_up
from .file_names import Order, find_frames
from .files import Place, Remote, located, read_file
from .meshes import MOVING, Loaded, animation_of, read_animated, read_mesh
from .npz import Archive
from .unity import mirrored, pictures_of, record_of

CAPTURED = "capture.json"  # record of the capture, in a folder that `meshreel capture` wrote
MOST_FRAMES = 10_000_000  # of an animation: four days at 30/s (guess)
RATE = 30.0  # frames a second, where neither the user nor the source says another
_FRAMES = re.compile(r"(-?\d{1,18})?:(-?\d{1,18})?")
_SIZES = 0.02, 100.0  # m, usual diagonals of recordings; outside this range the unit is doubtful (guess)
_SUSPICIOUS_RATIO = 20.0  # of two frames' diagonals; a person who crouches or enters changes it less (guess)


@dataclass(frozen=True, slots=True)
class SequenceOptions:
    """Frame rate, range, unit and welding of a sequence from files."""

    frame_rate: float | None = None  # 1/s; None: that of the source, or 30
    frames: str = ":"  # frames to use, "a:b" as Python slices
    scale: float = 1.0  # multiplies every coordinate: 0.001 for files in millimetres
    order: Order = "auto"  # of the files, by the numbers in their names
    weld: Callable[[Mesh], Mesh] | None = None  # merges equal positions (geometry.topology.weld); None: no welding

    def __post_init__(self) -> None:
        for name, value in (("frame rate", self.frame_rate), ("scale", self.scale)):
            if value is not None and not 1e-9 <= value <= 1e9:  # also refuses NaN
                raise InputError(f"{name} {value} is not between 1e-9 and 1e9; give such a number, as 30 or 0.001")
        if not _FRAMES.fullmatch(str(self.frames)):
            raise InputError(f"frames {self.frames!r} is not a range; give A:B, A: or :B, as 0:10")

    def chosen(self, count: int) -> range:
        """Return the numbers of the frames to use out of `count`. Raises InputError if there are none."""
        begin, end = (int(part) if part else None for part in self.frames.split(":"))
        numbers = range(count)[begin:end]
        if len(numbers) == 0:
            raise InputError(f"frames {self.frames!r} of {count} frames leave 0; choose at least one")
        return numbers


_ONE_THREAD = Lock()  # at a time, at the counts of a sequence


@dataclass(frozen=True, slots=True)
class Files:
    """Frames stored as one file each."""

    named: Sequence[Place] | Mapping[int, Place]  # by number

    @property
    def paths(self) -> tuple[Path, ...]:
        """The files on this machine."""
        named = self.named.values() if isinstance(self.named, Mapping) else self.named
        return tuple(path for path in named if isinstance(path, Path))

    def __len__(self) -> int:
        return len(self.named)

    def only(self, numbers: Sequence[int]) -> Files:
        """Return these files by absolute paths, for another process with another working directory."""
        return replace(self, named={number: self.named[number].absolute() for number in numbers})

    def name(self, index: int) -> str:
        return str(self.named[index])

    def load(self, index: int, where: str) -> Loaded:
        return read_mesh(self.named[index], where)


@dataclass(frozen=True, slots=True)
class UnityFiles(Files):
    """Frames of a folder of Unity's player of geometry sequences."""

    pictures: tuple[str, ...] = ()  # beside the frames, a name for each, or none

    def load(self, index: int, where: str) -> Loaded:
        loaded = read_mesh(self.named[index], where, self.pictures[index : index + 1])
        return replace(loaded, mesh=mirrored(loaded.mesh))


@dataclass(frozen=True, slots=True)
class Animation:
    """Frames of one GLB, USD or Alembic file, whose animation is sampled at a frame rate."""

    path: Place
    frame_rate: float  # 1/s
    count: int

    @property
    def paths(self) -> tuple[Path, ...]:
        """The file, if it is on this machine."""
        return (self.path,) if isinstance(self.path, Path) else ()

    def __len__(self) -> int:
        return self.count

    def only(self, _numbers: Sequence[int]) -> Animation:
        """Return the animation with an absolute path: it is one file, whatever frames are read."""
        return replace(self, path=self.path.absolute())

    def name(self, index: int) -> str:
        return f"{self.path} at {index / self.frame_rate:.4g} s"

    def load(self, index: int, where: str) -> Loaded:
        return read_animated(self.path, index / self.frame_rate, where)


@dataclass(slots=True)
class _Seen:
    """Counts for warnings, from the frames read so far; a frame read twice counts once."""

    merged: dict[int, tuple[int, int, int]] = field(default_factory=dict)  # by frame: merged, all vertices, lost faces
    empty: set[int] = field(default_factory=set)  # frames without a surface
    dropped: dict[str, int] = field(default_factory=dict)  # kind of dropped data: first frame that has it
    smallest: tuple[float, int] | None = None  # diagonal, frame
    largest: tuple[float, int] | None = None

    def add(self, other: _Seen) -> None:
        """Add the counts of other frames, or of the same frames."""
        self.merged |= other.merged
        self.empty |= other.empty
        for what, first in other.dropped.items():
            self.dropped[what] = min(first, self.dropped.get(what, first))
        if other.smallest is not None and other.largest is not None:
            self.smallest = min(self.smallest or other.smallest, other.smallest)
            self.largest = max(self.largest or other.largest, other.largest)


class FileSequence(MeshSequence):
    """Frames read from files on access; only counts are kept of them."""

    def __init__(
        self, frames: Files | Archive | Animation, options: SequenceOptions, remarks: tuple[str, ...] = (), up: Up = "y"
    ) -> None:
        """Read `frames` with `options`; `remarks` are warnings known already, `up` is the axis that points up."""
        self._frames, self._options, self._remarks, self._seen = frames, options, remarks, _Seen()
        self._chosen = options.chosen(len(frames))
        self.up: Up = up

    @property
    def frame_rate(self) -> float:
        return RATE if self._options.frame_rate is None else self._options.frame_rate

    @property
    def warnings(self) -> tuple[str, ...]:
        """Warnings about the frames read so far, one line each; complete after the last frame."""
        return tuple(_warnings(self._seen, self._remarks, self._frames))

    @property
    def files(self) -> tuple[Path, ...]:
        return self._frames.paths

    is_stored = is_shared = True  # other processes can read the frames, and threads at the same time

    def only(self, numbers: Sequence[int]) -> FileSequence:
        """Return the sequence restricted to these frames, under the same numbers; it pickles as their file names."""
        part = copy.copy(self)
        part._frames, part._seen = self._frames.only([self._chosen[number] for number in numbers]), _Seen()
        return part

    @property
    def observed(self) -> _Seen:
        """Counts for `warnings`, to pass to `learn` of the sequence that this one is a part of."""
        return self._seen

    def learn(self, observed: _Seen) -> None:
        """Add the counts of frames that another process read."""
        self._seen.add(observed)

    def __len__(self) -> int:
        return len(self._chosen)

    def __getitem__(self, index: int) -> Mesh:
        number = self._chosen[operator.index(index)]
        loaded = self._frames.load(number, self.name(index))
        mesh = loaded.mesh
        if self._options.scale != 1:
            mesh = mesh.at(mesh.vertices * self._options.scale)
        if self._options.weld is not None:
            loaded_mesh, mesh = mesh, self._options.weld(mesh)
            merged = len(loaded_mesh.vertices) - len(mesh.vertices)
            self._seen.merged[number] = (merged, len(loaded_mesh.vertices), len(loaded_mesh.faces) - len(mesh.faces))
        sized = (mesh.diagonal, number) if mesh.diagonal > 0 else None
        empty = {number} if mesh.is_empty else set[int]()
        with _ONE_THREAD:
            self._seen.add(_Seen({}, empty, dict.fromkeys(loaded.dropped, number), sized, sized))
        return mesh

    def name(self, index: int) -> str:
        """Return the name of a frame in error messages: its number in the source and its file."""
        number = self._chosen[operator.index(index)]
        return f"frame {number} ({self._frames.name(number)})"


def open_sequence(source: str | Path | Sequence[str | Path], options: SequenceOptions | None = None) -> FileSequence:
    """Return the frames of a folder, a glob pattern, a list of files, one file or an .npz; none is read yet.

    An animated GLB, USD or Alembic file alone has a frame for each moment of its animation at the frame rate, which the
    last two tell. All but .npz, USD and Alembic may be URLs, such as s3:// and https:// (extra `remote`). The up axis
    is that of a USD file, that of `meshreel capture` in the folder, or y.
    """
    options = options or SequenceOptions()
    place = located(source) if isinstance(source, str | Path) else None
    if isinstance(place, Remote) and place.suffix.lower() == ".npz":
        raise InputError(f"{source}: an .npz is not read by URL; copy it here, or write a mesh file for each frame")
    if isinstance(place, Path) and place.suffix.lower() == ".npz" and place.is_file():
        archive = Archive(place)
        if len(archive) == 0:
            raise InputError(f"{source}: has 0 frames; save at least one")
        return FileSequence(archive, options)
    paths, remarks = find_frames(source, options.order)
    if not paths:
        raise InputError("the list of files has 0 frames; give at least one")
    first = paths[0]
    if isinstance(first, Path) and first.suffix.lower() == ".ply" and (record := record_of(first.parent)) is not None:
        pictures, warnings = pictures_of(first.parent, record, len(paths), options.order)
        options = replace(options, frame_rate=options.frame_rate or record.get("fps"))
        return FileSequence(UnityFiles(paths, pictures), options, (*remarks, *warnings))
    if len(paths) == 1 and paths[0].suffix.lower() in MOVING and (scene := animation_of(paths[0])) is not None:
        rate = options.frame_rate or scene.frame_rate or RATE
        if (count := scene.count(rate)) > MOST_FRAMES:
            raise InputError(f"{paths[0]}: has {count} frames by its times; mend these, or give a lower --fps")
        if count > 1:
            moving = Animation(paths[0], rate, count)
            return FileSequence(moving, replace(options, frame_rate=rate), remarks, scene.up)
        return FileSequence(Files(paths), options, remarks, scene.up)
    up = "y" if place is None else known_up(capture_record(place).get("up"))
    if len(paths) > 1 and paths[0].suffix.lower() in MOVING and (scene := animation_of(paths[0])) is not None:
        up = scene.up
    return FileSequence(Files(paths), options, remarks, up)


def capture_record(folder: Place) -> dict[str, Any]:
    """Return the record that `meshreel capture` wrote beside its meshes; empty for other folders and files."""
    try:
        record = json_of(read_file(folder / CAPTURED))
    except (OSError, ValueError):
        return {}
    return record if isinstance(record, dict) else {}


def _warnings(seen: _Seen, remarks: tuple[str, ...], frames: Files | Archive | Animation) -> Iterator[str]:
    yield from remarks
    loose = "vertices without faces"
    if loose in seen.dropped:
        yield f"frame {seen.dropped[loose]} has vertices but no faces: it counts as empty"
    extras = {what: first for what, first in seen.dropped.items() if what != loose}
    if extras:
        first = min(extras.values())
        what = f"not kept: {', '.join(sorted(extras))} (first in frame {first}, {Path(frames.name(first)).name})"
        yield f"{what}; bake what should be seen into colours or one texture"
    merged, positions, faces = np.array([*seen.merged.values()], dtype=np.int64).reshape(-1, 3).sum(axis=0).tolist()
    if merged:
        lost = f", and {faces} faces that collapsed with them" if faces else ""
        yield f"welded {merged} of {positions} vertices that repeat a position{lost}, in {len(seen.merged)} frames"
    if seen.empty:
        number = "1 frame is" if len(seen.empty) == 1 else f"{len(seen.empty)} frames are"
        yield f"{number} empty (the first: frame {min(seen.empty)}): nothing is shown there"
    if seen.smallest and seen.largest and (seen.largest[0] < _SIZES[0] or seen.smallest[0] > _SIZES[1]):
        size, units = seen.largest[0], "--scale 0.001 if it is in millimetres, 0.01 in centimetres"
        if size < _SIZES[0]:
            units = "--scale 1000 if it is in kilometres, or was scaled from millimetres twice"
        yield f"frame {seen.largest[1]} is {size:.3g} m from corner to corner: meshreel counts in metres; give {units}"
    if seen.smallest and seen.largest and seen.largest[0] > _SUSPICIOUS_RATIO * seen.smallest[0]:
        text = f"frame {seen.largest[1]} is {seen.largest[0] / seen.smallest[0]:.3g} times as large as frame"
        yield f"{text} {seen.smallest[1]}: are they in the same unit?"
