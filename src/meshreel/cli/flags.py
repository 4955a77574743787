"""Flags that several commands share: reading meshes, comparing them, and the truth of simulated rigs."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from ..edit.audio import packed_audio
from ..errors import InputError
from ..geometry.topology import weld
from ..io.sequence import SequenceOptions
from ..metrics.comparison import ComparisonOptions
from ..metrics.mpeg import MpegOptions
from ..metrics.viewpoints import ViewOptions
from ..types import Up

_READ = SequenceOptions()
_VIEWS = ViewOptions()


@Parameter(name="*")
@dataclass(frozen=True, slots=True)
class Reading:
    """Flags for reading mesh files as a sequence."""

    fps: float = _READ.frame_rate
    """Frames per second; by default 30, or the rate of the recording for a folder that `capture` wrote."""
    frames: str = _READ.frames
    """Frames to use, as A:B with B excluded."""
    scale: float = _READ.scale
    """Factor from the unit of the files to metres."""

    def options(self) -> SequenceOptions:
        """Return the options of `open_sequence`, which welds vertices that repeat a position."""
        return SequenceOptions(self.fps, self.frames, self.scale, weld)


@Parameter(name="*")
@dataclass(frozen=True, slots=True)
class Looking:
    """Flags for the metrics, cameras and key frames of a comparison."""

    ssim: bool | None = None
    """Also render pictures and compare them by SSIM (some seconds per frame, half a minute of a room). By default not
    where a rig's depth pictures judge the frames."""
    cameras: Path | None = None
    """File of Open3D pinhole cameras for SSIM; by default four views around the sequence."""
    width: int = _VIEWS.width
    """Size of the rendered pictures, pixels."""
    height: int = _VIEWS.height
    """Size of the rendered pictures, pixels."""
    up: Annotated[Up, Parameter(allow_leading_hyphen=True)] = "y"
    """The axis that points up."""
    keys: Annotated[tuple[int, ...], Parameter(consume_multiple=True, negative="")] = ()
    """Key frames: means without them are printed, too. By default those that the .reel file names."""
    mpeg: Annotated[bool, Parameter(negative="")] = False
    """Also compare by MPEG's measures, as mmetric and V-DMC's conditions have them: D1, D2 and IBSM (some 20 seconds
    per frame)."""

    def options(self, ssim: bool) -> ComparisonOptions:
        """Return the options of `compare_sequences`; `ssim` decides if no flag requests or excludes SSIM."""
        ssim = (ssim or self.cameras is not None) if self.ssim is None else self.ssim
        views, mpeg = ViewOptions(self.width, self.height, up=self.up), MpegOptions() if self.mpeg else None
        return ComparisonOptions(self.cameras, views, ssim, self.keys, mpeg)


@Parameter(name="*")
@dataclass(frozen=True, slots=True)
class Knowing:
    """Flags for a comparison with the truth of a simulated rig."""

    truth: Path | None = None
    """Folder `truth` of the simulated rig from which the originals were captured: both are also compared with it."""
    truth_every: int = 1
    """Compare each Nth frame with the truth, from the first (seconds per frame of half a million faces)."""

    def __post_init__(self) -> None:
        if self.truth_every < 1:
            raise InputError(f"--truth-every {self.truth_every}: give 1 for all frames, 6 for every sixth")


@Parameter(name="*")
@dataclass(frozen=True, slots=True)
class Hearing:
    """Flags for the audio file of the frames."""

    audio: str | None = None
    """An audio file that players play with the frames: Opus (.opus, .webm), AAC (.m4a, .aac) or MP3, kept as it is."""
    audio_start: float = 0.0
    """Seconds from the first frame to the beginning of --audio; below 0, that much of it is left out."""

    def payload(self) -> bytes:
        """Return the payload of an audio chunk, empty without audio. Raises InputError for files of other types."""
        if self.audio is None and self.audio_start:
            raise InputError(f"--audio-start {self.audio_start:g}: needs --audio, the file that begins then")
        return b"" if self.audio is None else packed_audio(self.audio, self.audio_start)
