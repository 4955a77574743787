"""Sequences derived from another one, frame by frame on access, and the capabilities that a sequence may have.

A sequence may know which axis points up, and the depth and colour pictures behind its meshes. Every wrapper keeps them;
`captured` is the one adapter for sequences that lack these attributes.
"""

from __future__ import annotations

import copy
import hashlib
from collections import OrderedDict
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Protocol, runtime_checkable

import numpy as np
from jaxtyping import Bool

from ..errors import InputError
from ..types import Mesh, MeshSequence, Up, check_up
from . import work
from .color_views import ColorFrames
from .depth import DepthFrames
from .topology import part_of, weld

# Bytes of frames that an encode keeps: the frames of a key interval, 120, with 20,000 vertices each take 115 MB.
MOST_KEPT = 1 << 27


@runtime_checkable
class CapturedSequence(MeshSequence, Protocol):
    """A MeshSequence that knows its up axis and, where cameras recorded it, their depth and colour pictures."""

    @property
    def up(self) -> Up:
        """The axis that points up."""

    @property
    def depth(self) -> DepthFrames | None:
        """The depth pictures from which the meshes were made; None where they are not known."""

    @property
    def colors(self) -> ColorFrames | None:
        """The pictures of colour cameras; None where there are none."""


def captured(sequence: MeshSequence) -> CapturedSequence:
    """Return the sequence with its capabilities; without them, y points up and no depth is known.

    Raises InputError where the sequence names an up axis that there is not.
    """
    known = sequence if isinstance(sequence, CapturedSequence) else DerivedSequence(sequence)
    check_up(known.up)
    return known


def only(sequence: MeshSequence, numbers: Sequence[int]) -> MeshSequence:
    """Return the sequence with these of its frames and no others, under the same numbers, to send to another process.

    Frames that are in files stay there, and what is sent is their names; others are read now.
    """
    cut = getattr(sequence, "only", None)
    found: MeshSequence = Held.of(sequence, numbers) if cut is None else cut(numbers)
    return found


@dataclass(frozen=True, slots=True)
class Held(MeshSequence):
    """Some frames of a sequence in memory, under their numbers in it."""

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


class DerivedSequence(MeshSequence):
    """Base class of sequences derived frame by frame; by itself, the source with all capabilities."""

    def __init__(self, source: MeshSequence) -> None:
        self._source = source

    @property
    def frame_rate(self) -> float:
        return self._source.frame_rate

    @property
    def up(self) -> Up:
        """The axis that points up; y where the source does not know it."""
        return getattr(self._source, "up", "y")

    @property
    def depth(self) -> DepthFrames | None:
        """The depth pictures of the frames; None where the source knows none."""
        return getattr(self._source, "depth", None)

    @property
    def colors(self) -> ColorFrames | None:
        """The pictures of colour cameras; None where the source has none."""
        return getattr(self._source, "colors", None)

    @property
    def files(self) -> tuple[Path, ...]:
        """The files that the frames are read from; none where the source names none."""
        return getattr(self._source, "files", ())

    @property
    def is_stored(self) -> bool:
        """True if the frames are in files, which other processes can read."""
        return getattr(self._source, "is_stored", False)

    def only(self, numbers: Sequence[int]) -> DerivedSequence:
        """Return the sequence with these of its frames, as the function `only` does."""
        part = copy.copy(self)
        part._source = only(self._source, numbers)
        return part

    @property
    def observed(self) -> Any:
        """Observations from the frames that were read, for `learn` of the sequence that this one is a part of."""
        return getattr(self._source, "observed", None)

    def learn(self, observed: Any) -> None:
        """Take what another process observed when it read frames of this sequence."""
        if observed is not None and (learn := getattr(self._source, "learn", None)) is not None:
            learn(observed)

    def name(self, index: int) -> str:
        """Return the name of a frame in error messages."""
        named = getattr(self._source, "name", None)
        return f"frame {index}" if named is None else named(index)

    def __len__(self) -> int:
        return len(self._source)

    def __getitem__(self, index: int) -> Mesh:
        return self._source[index]


class Recent:
    """Frames that were used last, by number, as many as fit into `most` bytes."""

    def __init__(self, most: int) -> None:
        self._meshes, self._free = OrderedDict[int, Mesh](), most

    def get(self, number: int) -> Mesh | None:
        """Return a frame, None where it is not kept."""
        if number in self._meshes:
            self._meshes.move_to_end(number)
        return self._meshes.get(number)

    def keep(self, number: int, mesh: Mesh) -> None:
        """Keep a frame that is not kept yet, in place of those that were not used for longest."""
        self._meshes[number] = mesh
        self._free -= _nbytes(mesh)
        while self._free < 0:
            self._free += _nbytes(self._meshes.popitem(last=False)[1])


def _nbytes(mesh: Mesh) -> int:
    arrays = (mesh.vertices, mesh.faces, mesh.colors, mesh.uv)
    return sum(array.nbytes for array in arrays if array is not None)


class Unchanging(DerivedSequence):
    """The same frames, of which the `Recent` ones are not read again.

    Raises InputError for a frame that is read again and is not what it was when it was read first.
    """

    def __init__(self, source: MeshSequence) -> None:
        super().__init__(source)
        self._digests: dict[int, str] = {}
        self._recent = Recent(MOST_KEPT)

    def __getitem__(self, index: int) -> Mesh:
        mesh = self._recent.get(index)
        if mesh is None:
            work.count("frames read")
            mesh = super().__getitem__(index)
            self._check(index, digest([mesh]))
            self._recent.keep(index, mesh)
        return mesh

    def only(self, numbers: Sequence[int]) -> Unchanging:
        """Return the sequence with these of its frames, of which none has been read."""
        return Unchanging(only(self._source, numbers))

    @property
    def observed(self) -> tuple[dict[int, str], Any]:
        """The digests of the frames that were read, and what the source observed."""
        return self._digests, super().observed

    def learn(self, observed: tuple[dict[int, str], Any]) -> None:
        """Take what another process observed; raises InputError for a frame that was another when it was read first."""
        digests, of_source = observed
        for index, now in digests.items():
            self._check(index, now)
        super().learn(of_source)

    def _check(self, index: int, now: str) -> None:
        if self._digests.setdefault(index, now) != now:
            text = f"{self.name(index)}: has changed while it was encoded, or since its survey"
            raise InputError(f"{text}; encode again when nothing writes to it any more, with the survey's flags")

    @property
    def digests(self) -> list[str]:
        """The digest of each frame that has been read."""
        return [self._digests[index] for index in sorted(self._digests)]


def digest(meshes: Iterable[Mesh]) -> str:
    """Return a text of 16 characters that differs where meshes do."""
    found = hashlib.sha256()
    for mesh in meshes:
        for array in (mesh.vertices, mesh.faces, mesh.colors, mesh.uv):
            if array is not None:
                found.update(f"{array.shape}".encode())
                found.update(np.ascontiguousarray(array).data)
        if mesh.texture is not None:
            found.update(mesh.texture.pixels.data)
    return found.hexdigest()[:16]


class Upright(DerivedSequence):
    """The same frames with a given axis that points up; None keeps the source's."""

    def __init__(self, source: MeshSequence, up: Up | None) -> None:
        super().__init__(source)
        self._up = up

    @property
    def up(self) -> Up:
        """The axis that points up."""
        return self._up or super().up


class Welded(DerivedSequence):
    """The same frames with vertices at equal positions merged: UV seams would pass for open borders."""

    def __getitem__(self, index: int) -> Mesh:
        mesh = self._source[index]
        faces = mesh.faces
        if faces.size and (faces.min() < 0 or faces.max() >= len(mesh.vertices)):
            return mesh  # the survey refuses it with the number of its frame
        return weld(mesh)


class TurnedOver(DerivedSequence):
    """The same frames with the fronts of all faces where their backs were."""

    def __getitem__(self, index: int) -> Mesh:
        mesh = self._source[index]
        uv = None if mesh.uv is None else np.ascontiguousarray(mesh.uv[:, ::-1])
        return replace(mesh, faces=np.ascontiguousarray(mesh.faces[:, ::-1]), uv=uv)


class Chosen(DerivedSequence):
    """Some frames of a sequence, by their numbers."""

    def __init__(self, source: MeshSequence, numbers: Sequence[int]) -> None:
        super().__init__(source)
        self._numbers = tuple(numbers)

    is_stored = False  # it is what it chooses from that may be

    @property
    def depth(self) -> DepthFrames | None:
        """The depth pictures of the chosen frames; None where the source knows none."""
        known = super().depth
        return None if known is None else _ChosenPictures(known, self._numbers)

    @property
    def colors(self) -> ColorFrames | None:
        """The colour pictures of the chosen frames; None where the source has none."""
        known = super().colors
        return None if known is None else _ChosenPictures(known, self._numbers)

    def only(self, numbers: Sequence[int]) -> DerivedSequence:
        """Return these of the chosen frames, which are read now: what chooses among faces cannot always be sent."""
        return DerivedSequence(Held.of(self, numbers))

    def name(self, index: int) -> str:
        """Return the name of a frame in error messages."""
        return super().name(self._numbers[index])

    def __len__(self) -> int:
        return len(self._numbers)

    def __getitem__(self, index: int) -> Mesh:
        return self._source[self._numbers[index]]


class ChosenParts(Chosen):
    """Chosen faces of some frames; `choose` selects them by a frame's number in the source and its mesh."""

    def __init__(
        self, source: MeshSequence, numbers: Sequence[int], choose: Callable[[int, Mesh], Bool[np.ndarray, " F"]]
    ) -> None:
        super().__init__(source, numbers)
        self._choose = choose

    def __getitem__(self, index: int) -> Mesh:
        mesh = super().__getitem__(index)
        return part_of(mesh, self._choose(self._numbers[index], mesh))


@dataclass(frozen=True, slots=True)
class _ChosenPictures:
    """The depth or colour pictures of some frames, by their numbers."""

    source: Any  # DepthFrames or ColorFrames
    numbers: tuple[int, ...]

    def __getitem__(self, index: int) -> Any:
        return self.source[self.numbers[index]]
