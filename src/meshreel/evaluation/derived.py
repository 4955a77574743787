"""Sequences made of another one, frame by frame, when a frame is asked for: as many frames, as fast."""

from __future__ import annotations

from ..types import Mesh, MeshSequence


class DerivedSequence(MeshSequence):
    """A MeshSequence of as many frames as its source; a subclass says what a frame is."""

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
