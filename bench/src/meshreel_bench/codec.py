"""Protocol of a codec: a sequence becomes bytes, and bytes alone become a sequence."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Protocol, runtime_checkable

from meshreel.types import Mesh, MeshSequence

from .rows import ColorBytes

Progress = Callable[[str, int, int], None]  # stage, frames done, frames of the sequence


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
