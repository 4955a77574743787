"""Sequences derived lazily from another sequence: each frame is made when it is read."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from jaxtyping import Bool

from ..types import Mesh, MeshSequence
from .topology import part_of


class DerivedSequence(MeshSequence):
    """Base of sequences with the length and frame rate of their source; a subclass makes the frames."""

    def __init__(self, source: MeshSequence) -> None:
        self._source = source

    @property
    def frame_rate(self) -> float:
        """Frames per second, 1/s."""
        return self._source.frame_rate

    def __len__(self) -> int:
        return len(self._source)


class Backwards(DerivedSequence):
    """The frames from the last to the first."""

    def __getitem__(self, index: int) -> Mesh:
        return self._source[range(len(self))[::-1][index]]


class TurnedOver(DerivedSequence):
    """The same frames with the fronts of all faces where their backs were."""

    def __getitem__(self, index: int) -> Mesh:
        mesh = self._source[index]
        return Mesh(mesh.vertices, np.ascontiguousarray(mesh.faces[:, ::-1]))


class Chosen(DerivedSequence):
    """Some frames of a sequence, by their numbers."""

    def __init__(self, source: MeshSequence, numbers: Sequence[int]) -> None:
        super().__init__(source)
        self._numbers = tuple(numbers)

    def __len__(self) -> int:
        return len(self._numbers)

    def __getitem__(self, index: int) -> Mesh:
        return self._source[self._numbers[index]]


class ChosenParts(Chosen):
    """Chosen faces of some frames: `choose` says which, of a frame's number in the source and its mesh."""

    def __init__(
        self, source: MeshSequence, numbers: Sequence[int], choose: Callable[[int, Mesh], Bool[np.ndarray, " F"]]
    ) -> None:
        super().__init__(source, numbers)
        self._choose = choose

    def __getitem__(self, index: int) -> Mesh:
        mesh = super().__getitem__(index)
        return part_of(mesh, self._choose(self._numbers[index], mesh))


def forth_and_back(source: MeshSequence, count: int) -> Chosen:
    """As many frames of a sequence that is played forth and back, over and over; ends are not repeated."""
    once = [*range(len(source)), *range(len(source) - 2, 0, -1)]
    return Chosen(source, [once[number % len(once)] for number in range(count)])
