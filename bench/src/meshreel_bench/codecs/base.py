"""Bases of the codecs here, which are frozen dataclasses whose fields are the operating point, and of their frames."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any, cast

from meshreel.types import Mesh, MeshSequence

from ..codec import Progress


class Options:
    """A codec whose fields are its options."""

    __slots__ = ()

    @property
    def options(self) -> dict[str, Any]:
        """The operating point, ready for JSON."""
        return asdict(cast(Any, self))


class TwoSteps(Options):
    """A codec that first finds what does not depend on the rate; see `TwoStepCodec`."""

    __slots__ = ()

    def analyse(self, sequence: MeshSequence, progress: Progress | None = None) -> Any:
        """Return what operating points share. Raises InputError for frames that cannot be used."""
        raise NotImplementedError

    def code(self, analysis: Any, progress: Progress | None = None) -> bytes:
        """Return the stream; the analysis stays as it was."""
        raise NotImplementedError

    def encode(self, sequence: MeshSequence, progress: Progress | None = None) -> bytes:
        """Return the stream. Raises InputError for frames that cannot be used."""
        return self.code(self.analyse(sequence, progress), progress)


class DecodedFrames(Sequence[Mesh]):
    """Frames of a stream, each decoded on access."""

    __slots__ = ()

    def frame(self, number: int) -> Mesh:
        """Return frame `number`, which is in range, in metres. Raises FormatError where its bytes are damaged."""
        raise NotImplementedError

    def __getitem__(self, index: Any) -> Any:
        numbers = range(len(self))[index]
        return [self.frame(number) for number in numbers] if isinstance(numbers, range) else self.frame(numbers)
