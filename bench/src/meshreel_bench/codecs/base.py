"""Base classes of the codecs here (frozen dataclasses whose fields are the operating point) and of decoded frames."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any, cast

from meshreel.decoder.video import open as open_video
from meshreel.types import Mesh, MeshSequence

from ..codec import Progress, TwoStepCodec


class Options:
    """A codec whose fields are its options, and whose streams are .reel files unless it has a decoder of its own."""

    __slots__ = ()

    @property
    def options(self) -> dict[str, Any]:
        """The operating point, ready for JSON."""
        return asdict(cast(Any, self))

    def decode(self, data: bytes) -> Sequence[Mesh]:
        """Return the frames, from the bytes alone."""
        return open_video(data)


class TwoSteps(Options):
    """A `TwoStepCodec` whose `encode` is its analysis followed by its coding."""

    __slots__ = ()

    def encode(self: TwoStepCodec, sequence: MeshSequence, progress: Progress | None = None) -> bytes:
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
