"""Flags that several commands share: how meshes are read, and how SSIM looks at them."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from ..errors import InputError
from ..geometry.topology import weld
from ..io.sequence import SequenceOptions
from ..metrics.comparison import ComparisonOptions
from ..metrics.viewpoints import ViewOptions
from ..types import Up

_READ = SequenceOptions()
_VIEWS = ViewOptions()


@Parameter(name="*")
@dataclass(frozen=True, slots=True)
class Reading:
    """How mesh files become a sequence."""

    fps: float = _READ.frame_rate
    """Frames per second of the meshes; of a folder that `capture` wrote, those of the recording."""
    frames: str = _READ.frames
    """Which frames, as A:B with B excluded."""
    scale: float = _READ.scale
    """Factor on all coordinates, to metres."""

    def options(self) -> SequenceOptions:
        """The same for `open_sequence`; vertices that repeat a position are welded."""
        return SequenceOptions(self.fps, self.frames, self.scale, weld)


@Parameter(name="*")
@dataclass(frozen=True, slots=True)
class Looking:
    """What is compared, and from where."""

    ssim: bool = True
    """Render and compare pictures too (some seconds a frame)."""
    cameras: Path | None = None
    """A file of Open3D pinhole cameras for SSIM; four views around the sequence where it is not given."""
    width: int = _VIEWS.width
    """Of the rendered pictures, pixels."""
    height: int = _VIEWS.height
    """Of the rendered pictures, pixels."""
    up: Annotated[Up, Parameter(allow_leading_hyphen=True)] = "y"
    """The axis that points up."""
    keys: Annotated[tuple[int, ...], Parameter(consume_multiple=True, negative="")] = ()
    """Key frames: means are also given without them. Those that a .reel file names where none is given."""

    def options(self) -> ComparisonOptions:
        """The same for `compare_sequences`."""
        return ComparisonOptions(self.cameras, ViewOptions(self.width, self.height, up=self.up), self.ssim, self.keys)


@Parameter(name="*")
@dataclass(frozen=True, slots=True)
class Knowing:
    """The truth, where it is known."""

    truth: Path | None = None
    """The folder `truth` of the simulated rig that the originals were captured from: both are compared with it, too."""
    truth_every: int = 1
    """Compare the first frame with the truth and every so many after it (seconds for half a million faces)."""

    def __post_init__(self) -> None:
        if self.truth_every < 1:
            raise InputError(f"--truth-every {self.truth_every}: give 1 for all frames, 6 for every sixth")
