"""Inputs of commands, and flags that several commands share: reading and comparing meshes, masks, audio, truth."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter, Token

from ..analysis.scene.masks import ImageMasks, Masker, read_view_file
from ..analysis.scene.sam3 import PromptBy, Sam3Masks
from ..analysis.scene.segmentation import Cameras
from ..capture.recording import open_recording
from ..capture.recordings import is_rig, is_take, open_take
from ..capture.recordings.takes import Take
from ..capture.recordings.to_rig import write_takes
from ..edit.audio import packed_audio
from ..errors import InputError
from ..geometry.topology import weld
from ..io.file_names import Order
from ..io.files import Remote, located
from ..io.sequence import SequenceOptions, capture_record, open_sequence
from ..metrics.comparison import ComparisonOptions
from ..metrics.mpeg import MpegOptions
from ..metrics.viewpoints import ViewOptions
from ..types import MeshSequence, Up
from .console import Common

_READ = SequenceOptions()
_VIEWS = ViewOptions()


def as_rate(_kind: object, tokens: Sequence[Token]) -> float:
    """Return a rate that is written as a number or as a fraction. Raises ValueError for other words."""
    return float(Fraction(tokens[0].value))


@dataclass(frozen=True, slots=True)
class Source:
    """A sequence and the warnings of its source."""

    sequence: MeshSequence
    remarks: tuple[str, ...] = ()
    scratch: tempfile.TemporaryDirectory[str] | None = None  # with the rig of recordings; deleted with the source

    @property
    def warnings(self) -> tuple[str, ...]:
        """Warnings, one line each; complete after the last frame was read."""
        return (*self.remarks, *getattr(self.sequence, "warnings", ()))


def open_source(inputs: Sequence[str], reading: Reading, common: Common = Common(quiet=True)) -> Source:
    """Open mesh files (as is the truth of a rig), or a rig or recordings, fused on access. Raises InputError."""
    folder = located(inputs[0])
    if isinstance(folder, Path) and is_take(folder):
        takes = [open_take(Path(name)) for name in inputs]
        scratch = tempfile.TemporaryDirectory(prefix="meshreel-")
        remarks = make_rig(takes, rig := Path(scratch.name, "rig"), common)
        opened = open_source([str(rig)], reading)
        return replace(opened, remarks=(*remarks, *opened.remarks), scratch=scratch)
    if len(inputs) > 1 and (rigs := [name for name in inputs if is_rig(Path(name))]):
        raise InputError(f"{rigs[0]}: is a rig, which no other input joins; give it alone")
    if isinstance(folder, Remote) or len(inputs) > 1 or not is_rig(folder) or any(folder.glob("frame_*.ply")):
        options, made = reading.options(), capture_record(folder) if len(inputs) == 1 else {}
        rate = made.get("frames_per_second")
        if reading.fps is None and isinstance(rate, (int, float)) and rate > 0:
            options = replace(options, frame_rate=float(rate))
        return Source(open_sequence(inputs[0] if len(inputs) == 1 else list(inputs), options))
    reading.options()  # raises InputError for invalid values
    if reading.scale != _READ.scale:
        raise InputError(f"--scale {reading.scale:g}: {folder} is a rig, whose poses are in metres; leave it out")
    recording, remarks = open_recording(folder, frames=reading.frames, order=reading.order)
    if reading.fps not in (None, recording.frame_rate):
        text = f"--fps {reading.fps:g}: {folder} is a rig of {recording.frame_rate:g} frames a second"
        raise InputError(f"{text}; leave it out, or mend the rig's description")
    return Source(recording, tuple(remarks))


def make_rig(takes: Sequence[Take], folder: Path, common: Common, depth_unit: float | None = None) -> list[str]:
    """Write the rig of recordings and show progress; return warnings for the user."""
    streams = [each for take in takes for sensor in take.sensors for each in (sensor.depth, sensor.color) if each]
    total = sum(stream.count for stream in streams)
    with common.stages("pictures") as progress:
        return write_takes(takes, folder, lambda done: progress("read", done, total), depth_unit)


@Parameter(name="*")
@dataclass(frozen=True, slots=True)
class Masking:
    """Flags for masks of moving surface; without them, geometric change over the sequence decides."""

    masks: Path | None = None
    """Masks of another tool: a folder with cameras.json, and view00/frame_00000.png ... of its cameras, 8-bit
    PNG of object numbers, 0 for what stands still. `segment --views-only` writes the pictures and cameras."""
    sam3: Path | None = None
    """Masks by SAM3 (extra `sam3`): a folder with its weights, such as those of facebook/sam3."""
    prompts: Annotated[tuple[str, ...], Parameter(consume_multiple=True, negative="")] = ()
    """Words for objects that SAM3 looks for, as --prompts person --prompts dog; only moving ones count. Common words
    if not given."""
    prompt_by: PromptBy = "words"
    """Prompts of objects for SAM3: words, or points on surface that moves in one view (motion)."""
    device: str = "cpu"
    """Device of SAM3 in torch's notation: cpu, cuda, cuda:1."""
    views: Path | None = None
    """File of Open3D pinhole cameras of one size that look at the scene, or a folder of view_00.json and so on. By
    default, masks are made of the pictures of a rig's colour cameras; without any, views are placed, and masks made of
    their normals."""
    up: Annotated[Up | None, Parameter(allow_leading_hyphen=True)] = None
    """Axis that points up, for players and for the pictures of placed views. By default the axis recorded with the
    cameras, or y."""

    def __post_init__(self) -> None:
        if self.masks is not None and self.sam3 is not None:
            raise InputError(f"--masks {self.masks} and --sam3 {self.sam3}: give one of both")
        if self.masks is not None and self.views is not None:
            raise InputError(f"--views {self.views}: the masks in {self.masks} have cameras of their own; leave it out")
        if self.sam3 is None and (self.prompts or self.device != "cpu" or self.prompt_by != "words"):
            raise InputError("--prompts, --prompt-by and --device are for SAM3; give --sam3, too")
        if self.prompts and self.prompt_by == "motion":
            raise InputError("--prompts are words and --prompt-by motion needs none; leave out one of both")

    @property
    def wanted(self) -> bool:
        """True if any flag except --up is given."""
        return replace(self, up=None) != Masking()

    @property
    def cameras(self) -> Cameras:
        """Cameras of --views, or none. Raises InputError if their file is wrong."""
        return () if self.views is None else read_view_file(self.views)

    def masker(self, frames: int) -> Masker | None:
        """Return the source of masks of `frames` frames, None for geometric change. Raises InputError."""
        if self.masks is not None:
            return ImageMasks(self.masks, frames)
        if self.sam3 is not None:
            return Sam3Masks(self.sam3, self.prompts or None, self.prompt_by, self.device)
        return None


@Parameter(name="*")
@dataclass(frozen=True, slots=True)
class Reading:
    """Flags for reading mesh files as a sequence."""

    fps: Annotated[float | None, Parameter(converter=as_rate)] = None
    """Frames per second, as 25 or 30000/1001; by default 30, or the rate of the recording for a folder that `capture`
    wrote."""
    frames: str = _READ.frames
    """Frames to use, as A:B with B excluded."""
    scale: float = _READ.scale
    """Factor from the unit of the files to metres."""
    order: Order = _READ.order
    """Order of files with several numbers in their names: by all of them, by the last one, or by letters (name). By
    default the one that all readings of the names agree on."""

    def options(self) -> SequenceOptions:
        """Return the options of `open_sequence`, which welds vertices that repeat a position."""
        return SequenceOptions(self.fps, self.frames, self.scale, self.order, weld)


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
