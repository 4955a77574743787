"""Sequences derived from another one, frame by frame on access, and the capabilities that a sequence may have.

A sequence may know which axis points up, and the depth and colour pictures behind its meshes. All that is derived from
it is one record, which keeps them; `captured` is the one adapter for sequences that lack these attributes.
"""

from __future__ import annotations

import copy
import hashlib
import operator
from collections import OrderedDict
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, replace
from pathlib import Path
from threading import Lock, RLock
from typing import Any, ClassVar, Generic, Protocol, TypeVar, runtime_checkable

import numpy as np
from jaxtyping import Bool

from ..errors import InputError
from ..types import Mesh, MeshSequence, Up, check_up, evenly, offset
from . import work
from .color_views import ColorFrames
from .depth import DepthFrames
from .topology import part_of, weld

# Bytes of frames that an encode keeps: the frames of a key interval, 120, with 20,000 vertices each take 115 MB.
MOST_KEPT = 1 << 27
_T = TypeVar("_T")
_ONE_READER = RLock()  # of sequences that are not said to be read by several threads at a time


@runtime_checkable
class CapturedSequence(MeshSequence, Protocol):
    """A MeshSequence that knows its up axis and, where cameras recorded it, their depth and colour pictures."""

    @property
    def up(self) -> Up:
        """The axis that points up."""

    @property
    def depth(self) -> DepthFrames | None:
        """The depth pictures from which the meshes were made; None if they are unknown."""

    @property
    def colors(self) -> ColorFrames | None:
        """The pictures of colour cameras; None if there are none."""


def captured(sequence: MeshSequence) -> CapturedSequence:
    """Return the sequence with its capabilities; without them, y points up and no depth is known.

    Raises InputError if the sequence names an up axis that does not exist.
    """
    known = sequence if isinstance(sequence, CapturedSequence) else DerivedSequence(sequence)
    check_up(known.up)
    return known


def only(sequence: MeshSequence, numbers: Sequence[int]) -> MeshSequence:
    """Return the sequence with these of its frames and no others, under the same numbers, to send to another process.

    Of frames in files, only the names are sent; others are read now.
    """
    found: MeshSequence = sequence.only(numbers) if hasattr(sequence, "only") else Held.of(sequence, numbers)
    return found


@dataclass(frozen=True, slots=True)
class Held(MeshSequence):
    """Some frames of a sequence in memory, under their numbers in it."""

    is_shared: ClassVar[bool] = True
    meshes: Mapping[int, Mesh]
    count: int  # frames of the whole sequence
    frame_rate: float  # 1/s
    up: Up = "y"

    @staticmethod
    def of(sequence: MeshSequence, numbers: Iterable[int]) -> Held:
        """Read these frames of a sequence."""
        up: Up = getattr(sequence, "up", "y")
        return Held({number: sequence[number] for number in numbers}, len(sequence), sequence.frame_rate, up)

    def __len__(self) -> int:
        return self.count

    def __getitem__(self, index: int) -> Mesh:
        return self.meshes[index]


class Recent(Generic[_T]):
    """Results for the frames that were asked for last, as many as fit into some bytes; threads may share them."""

    def __init__(self, most: int, nbytes: Callable[[_T], int]) -> None:
        """`nbytes` returns the memory that a frame's result takes, of which there are at most `most` bytes."""
        self._most, self._nbytes, self._free = most, nbytes, most
        self._kept, self._lock = OrderedDict[int, _T](), Lock()

    def get(self, number: int) -> _T | None:
        """Return the result for a frame, None where it is not kept."""
        with self._lock:
            if number in self._kept:
                self._kept.move_to_end(number)
            return self._kept.get(number)

    def keep(self, number: int, result: _T) -> None:
        """Keep the result for a frame in place of those that were not used for longest."""
        with self._lock:
            if number in self._kept:  # another thread has made it, too
                return
            self._kept[number] = result
            self._free -= self._nbytes(result)
            while self._free < 0:
                self._free += self._nbytes(self._kept.popitem(last=False)[1])

    def __reduce__(self) -> tuple[Any, ...]:
        """Go to other processes without results."""
        return Recent, (self._most, self._nbytes)


class Memory:
    """Digests of the frames that were read, and those used last, as many as fit into `most` bytes."""

    def __init__(self, most: int) -> None:
        self.digests: dict[int, str] = {}
        self.recent = Recent(most, _nbytes)

    def check(self, number: int, now: str, name: str) -> None:
        """Raise InputError if a frame is not what it was when it was read first."""
        if self.digests.setdefault(number, now) != now:
            text = f"{name}: has changed while it was encoded, or since its survey"
            raise InputError(f"{text}; encode again when nothing writes to it any more, with the survey's flags")


def _nbytes(mesh: Mesh) -> int:
    return sum(array.nbytes for array in (mesh.vertices, mesh.faces, mesh.colors, mesh.uv) if array is not None)


@dataclass(eq=False, repr=False)
class DerivedSequence(MeshSequence):
    """Frames derived from those of a source on access, with its capabilities; by itself, the source with all of them.

    Goes to other processes where its source and `frame` do.
    """

    source: MeshSequence
    frame: Callable[[MeshSequence, int], Mesh] = operator.getitem  # of the source and the number of a frame in it
    numbers: tuple[int, ...] | None = None  # of its frames in the source; None: all
    axis: Up | None = None  # that points up; None: the source's
    memory: Memory | None = None  # for frames that must not change

    @property
    def frame_rate(self) -> float:
        return self.source.frame_rate

    @property
    def up(self) -> Up:
        """The axis that points up; y if the source does not know it."""
        known: Up = getattr(self.source, "up", "y")
        return self.axis or known

    @property
    def depth(self) -> DepthFrames | None:
        """The depth pictures of the frames; None if the source has none."""
        return self._of_frames(getattr(self.source, "depth", None))

    @property
    def colors(self) -> ColorFrames | None:
        """The pictures of colour cameras; None if the source has none."""
        return self._of_frames(getattr(self.source, "colors", None))

    def _of_frames(self, pictures: Any) -> Any:
        if pictures is None or self.numbers is None:
            return pictures
        return ChosenPictures(pictures.__getitem__, self.numbers)

    @property
    def files(self) -> tuple[Path, ...]:
        """The files that the frames are read from; none if the source names none."""
        return getattr(self.source, "files", ())

    @property
    def is_stored(self) -> bool:
        """True if the frames are in files, which other processes can read."""
        return self.numbers is None and getattr(self.source, "is_stored", False)

    @property
    def is_shared(self) -> bool:
        """True if threads may read frames of the source at the same time."""
        return getattr(self.source, "is_shared", False)

    def only(self, numbers: Sequence[int]) -> DerivedSequence:
        """Return the sequence with these of its frames, as the function `only` does; picked ones are read now."""
        if self.numbers is not None:  # what chooses among faces cannot always be sent
            return DerivedSequence(Held.of(self, numbers))
        part = copy.copy(self)
        part.source, part.memory = only(self.source, numbers), self.memory and Memory(MOST_KEPT)
        return part

    @property
    def observed(self) -> Any:
        """Observations from the frames that were read, for `learn` of the sequence that this one is a part of."""
        of_source = getattr(self.source, "observed", None)
        return of_source if self.memory is None else (self.memory.digests, of_source)

    def learn(self, observed: Any) -> None:
        """Take what another process observed; raises InputError for a frame that has changed since."""
        if self.memory is not None:
            digests, observed = observed
            for number, now in digests.items():
                self.memory.check(number, now, self.name(number))
        if observed is not None and (learn := getattr(self.source, "learn", None)) is not None:
            learn(observed)

    @property
    def digests(self) -> list[str]:
        """The digest of each frame that has been read, of a sequence with a memory."""
        assert self.memory is not None
        return [self.memory.digests[number] for number in sorted(self.memory.digests)]

    def name(self, index: int) -> str:
        """Return the name of a frame in error messages."""
        named, number = getattr(self.source, "name", None), self._number(index)
        return f"frame {number}" if named is None else named(number)

    def _number(self, index: int) -> int:
        number = offset(index, range(len(self)))
        return number if self.numbers is None else self.numbers[number]

    def __len__(self) -> int:
        return len(self.source) if self.numbers is None else len(self.numbers)

    def __getitem__(self, index: int) -> Mesh:
        number, memory = self._number(index), self.memory
        if memory is None:
            return self.frame(self.source, number)
        if (mesh := memory.recent.get(number)) is None:
            work.count("frames read")
            with nullcontext() if self.is_shared else _ONE_READER:
                mesh = self.frame(self.source, number)
            memory.check(number, digest([mesh]), self.name(number))
            memory.recent.keep(number, mesh)
        return mesh


def is_colored(source: MeshSequence) -> bool:
    """Return whether some frames of a sequence have colours."""
    return any(source[number].is_colored for number in evenly(len(source), 3))


def unchanging(source: MeshSequence) -> DerivedSequence:
    """Return the same frames, of which those used last are not read again.

    It raises InputError for a frame that is read again and is not what it was when it was read first.
    """
    return DerivedSequence(source, memory=Memory(MOST_KEPT))


def uncolored(source: MeshSequence) -> MeshSequence:
    """Return the same frames without the colours that they have from cameras' pictures, where the source has those."""
    if not isinstance(source, DerivedSequence):
        bare: MeshSequence = getattr(source, "uncolored", source)
        return bare
    found = copy.copy(source)
    found.source = uncolored(source.source)
    return found


def upright(source: MeshSequence, up: Up | None) -> DerivedSequence:
    """Return the same frames with a given axis that points up; None keeps the source's."""
    return DerivedSequence(source, axis=up)


def welded(source: MeshSequence) -> DerivedSequence:
    """Return the same frames with vertices at equal positions merged: UV seams would pass for open borders."""
    return DerivedSequence(source, _welded)


def picked(
    source: MeshSequence, numbers: Sequence[int], choose: Callable[[int, Mesh], Bool[np.ndarray, " F"]] | None = None
) -> DerivedSequence:
    """Return some frames, by their numbers, or faces of them that `choose` selects by a frame's number and mesh."""
    if choose is None:
        return DerivedSequence(source, numbers=tuple(numbers))

    def part(frames: MeshSequence, number: int) -> Mesh:
        return part_of(mesh := frames[number], choose(number, mesh))

    return DerivedSequence(source, part, tuple(numbers))


def digest(meshes: Iterable[Mesh]) -> str:
    """Return a digest of a mesh, 16 characters."""
    found = hashlib.sha256()
    for mesh in meshes:
        for array in (mesh.vertices, mesh.faces, mesh.colors, mesh.uv):
            if array is not None:
                found.update(f"{array.shape}".encode())
                found.update(np.ascontiguousarray(array).data)
        if mesh.texture is not None:
            found.update(mesh.texture.pixels.data)
    return found.hexdigest()[:16]


def _welded(source: MeshSequence, number: int) -> Mesh:
    mesh = source[number]
    if mesh.faces.size and (mesh.faces.min() < 0 or mesh.faces.max() >= len(mesh.vertices)):
        return mesh  # the survey refuses it with the number of its frame
    return weld(mesh)


def turned_over(source: MeshSequence, number: int) -> Mesh:
    """Return a frame with the fronts of all faces where their backs were, for `DerivedSequence`."""
    mesh = source[number]
    uv = None if mesh.uv is None else np.ascontiguousarray(mesh.uv[:, ::-1])
    return replace(mesh, faces=np.ascontiguousarray(mesh.faces[:, ::-1]), uv=uv)


@dataclass(frozen=True, slots=True)
class ChosenPictures:
    """The depth or colour pictures of some frames (`DepthFrames`, `ColorFrames`), by their numbers."""

    read: Callable[[int], Any]  # reads those of a frame, one for each camera
    numbers: tuple[int, ...]

    def __getitem__(self, index: int) -> Any:
        return self.read(self.numbers[offset(index, range(len(self.numbers)))])
