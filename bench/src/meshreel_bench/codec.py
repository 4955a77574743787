"""The protocol of everything that is compared: a sequence becomes bytes, and bytes a sequence; nothing else passes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Protocol, runtime_checkable

from meshreel.types import Mesh, MeshSequence

Progress = Callable[[str, int, int], None]  # stage, frames done, frames of the sequence


@runtime_checkable
class Codec(Protocol):
    """A codec at one operating point."""

    @property
    def name(self) -> str:
        """What rows and plots call it."""
        ...

    @property
    def options(self) -> dict[str, Any]:
        """The operating point, ready for JSON."""
        ...

    def encode(self, sequence: MeshSequence, progress: Progress | None = None) -> bytes:
        """All that a decoder needs; its length is the rate."""
        ...

    def decode(self, data: bytes) -> Sequence[Mesh]:
        """The frames, from the bytes alone; may decode lazily, frame by frame."""
        ...


@runtime_checkable
class TwoStepCodec(Codec, Protocol):
    """A codec whose encoder first finds out what does not depend on the rate: a sweep does that once for its points.

    `encode` is `code` of what `analyse` gives.
    """

    @property
    def analysis_key(self) -> str:
        """Equal for operating points that share an analysis, of one codec or of several."""
        ...

    def analyse(self, sequence: MeshSequence, progress: Progress | None = None) -> Any:
        """What several operating points share."""
        ...

    def code(self, analysis: Any, progress: Progress | None = None) -> bytes:
        """The bytes; the analysis stays as it was."""
        ...
