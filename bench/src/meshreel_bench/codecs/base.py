"""Bases of the codecs here, which are frozen dataclasses: their fields are the operating point."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any, cast

from meshreel.types import MeshSequence

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
