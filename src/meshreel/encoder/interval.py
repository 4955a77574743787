"""Intervals: frames of one track that need no others to be encoded, with the noise that they have."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from fractions import Fraction
from typing import Any

from ..analysis.survey import Survey
from ..geometry.derived_sequences import DerivedSequence
from ..types import Frames, Mesh
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
    weight: Fraction = field(default=Fraction(1), kw_only=True)  # of each frame in progress: bodies share a frame

    @property
    def stop(self) -> int:
        """The number of the frame that follows."""
        return self.first_frame + len(self.frames)

    def to_send(self) -> Interval:
        """Return the interval for a worker process, which reads those of its frames that are in files."""
        return replace(self, frames=self.frames.only() if isinstance(self.frames, NormalisedFrames) else self.frames)

    @property
    def observed(self) -> Any:
        """What reading the frames has shown, for `learn` of the interval that was sent."""
        return self.frames.observed if isinstance(self.frames, NormalisedFrames) else None

    def learn(self, observed: Any) -> None:
        """Take what a worker observed. Raises InputError for a frame that has changed since it was read first."""
        if isinstance(self.frames, NormalisedFrames):
            self.frames.learn(observed)


class NormalisedFrames(Frames):
    """Frames of a sequence in normalised coordinates, computed on access."""

    def __init__(self, sequence: DerivedSequence, seen: Survey, numbers: range) -> None:
        self._sequence, self._seen, self._numbers = sequence, seen, numbers

    def __len__(self) -> int:
        return len(self._numbers)

    def __getitem__(self, index: int) -> Mesh:
        return self._seen.normalise(self._sequence[self._numbers[index]])

    def only(self) -> NormalisedFrames:
        """Return the same frames, with nothing else of their sequence."""
        return NormalisedFrames(self._sequence.only(self._numbers), self._seen.without_frames(), self._numbers)

    @property
    def observed(self) -> Any:
        """What the sequence observed."""
        return self._sequence.observed

    def learn(self, observed: Any) -> None:
        """Take what the same frames observed in another process."""
        self._sequence.learn(observed)
