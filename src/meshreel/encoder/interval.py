"""Intervals: frames of one track that need no others to be encoded, with the noise that they have."""

from __future__ import annotations

from dataclasses import dataclass, field

from ..analysis.survey import Survey
from ..types import Frames, Mesh, MeshSequence
from .digests import Digests


@dataclass(frozen=True, slots=True)
class Interval:
    """Frames that are encoded together and need no others; all are empty or none is."""

    frames: Frames  # normalised
    noise: float = 0.0  # RMS distance of the frames from the truth, normalised; 0: a clean capture
    first_frame: int = 0  # its number in the sequence
    track: int = 0
    digests: Digests | None = field(default=None, kw_only=True)  # of what its stages compute; None: nobody asks
    # Digest of the frames; empty where they are whole frames of the sequence, which has their digests.
    surface: str = ""

    @property
    def stop(self) -> int:
        """The number of the frame that follows."""
        return self.first_frame + len(self.frames)

    def in_memory(self) -> Interval:
        """Return the interval with its frames in a list, which a worker process can receive."""
        return Interval(list(self.frames), self.noise, self.first_frame, self.track, digests=self.digests)


class NormalisedFrames(Frames):
    """Frames of a sequence in normalised coordinates, computed on access."""

    def __init__(self, sequence: MeshSequence, seen: Survey, numbers: range) -> None:
        self._sequence, self._seen, self._numbers = sequence, seen, numbers

    def __len__(self) -> int:
        return len(self._numbers)

    def __getitem__(self, index: int) -> Mesh:
        return self._seen.normalise(self._sequence[self._numbers[index]])
