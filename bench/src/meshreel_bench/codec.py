"""Protocol of a codec: a sequence becomes bytes, and bytes alone become a sequence."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import asdict
from typing import Any, Protocol, TypeVar, cast, runtime_checkable

from meshreel.decoder.video import open as open_video
from meshreel.encoder.group.progress import Report
from meshreel.types import Mesh, MeshSequence

from .rows import ColorBytes

Progress = Callable[[str, int, int], None]  # stage, frames done, frames of the sequence
Item = TypeVar("Item")


def reported(items: Iterable[Item], progress: Progress | None, stage: str, count: int) -> Iterator[Item]:
    """Yield items, of which there are `count`, and report each when the next one is asked for."""
    for number, item in enumerate(items, 1):
        yield item
        if progress is not None:
            progress(stage, number, count)


def of_encoder(progress: Progress | None) -> Report | None:
    """Return the callback for an encoder of meshreel."""
    return None if progress is None else lambda now: progress(now.stage, now.done, now.total)


@runtime_checkable
class Codec(Protocol):
    """A codec at one operating point."""

    @property
    def name(self) -> str:
        """Name in rows and plots."""

    @property
    def options(self) -> dict[str, Any]:
        """The operating point, ready for JSON."""

    def encode(self, sequence: MeshSequence, progress: Progress | None = None) -> bytes:
        """Return the complete stream; its length is the rate."""

    def decode(self, data: bytes) -> Sequence[Mesh]:
        """Return the frames, from the bytes alone; may decode lazily, frame by frame."""


@runtime_checkable
class TwoStepCodec(Codec, Protocol):
    """A codec whose encoder starts with an analysis that operating points share, so that a sweep runs it once."""

    @property
    def analysis_key(self) -> str:
        """Equal for operating points that share an analysis, of one codec or of several."""

    def analyse(self, sequence: MeshSequence, progress: Progress | None = None) -> Any:
        """Return the analysis that several operating points share."""

    def code(self, analysis: Any, progress: Progress | None = None) -> bytes:
        """Return the bytes; the analysis stays as it was."""


@runtime_checkable
class BackgroundCodec(Codec, Protocol):
    """A codec that sends a static background separately."""

    def background_bytes(self, data: bytes) -> int:
        """Return the share of the bytes that is sent once."""


@runtime_checkable
class ColorCodec(Codec, Protocol):
    """A codec that stores colours in a container other than .reel."""

    def color_bytes(self, data: bytes) -> ColorBytes | None:
        """Return the share of the bytes that colours take; None where there are none."""


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
