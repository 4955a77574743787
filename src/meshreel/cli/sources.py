"""What the commands that take scenes share: inputs that may be a rig, and flags for who says what moves."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from ..analysis.scene.masks import ImageMasks, Masker, one_size
from ..analysis.scene.sam3 import Sam3Masks, Sam3Options
from ..analysis.scene.segmentation import SegmentOptions
from ..capture.recording import open_recording
from ..capture.rig import RIG, SINGLE
from ..errors import InputError
from ..geometry.cameras import unpack_cameras
from ..io.sequence import open_sequence
from ..types import MeshSequence, Up, known_up
from .capture import MADE
from .flags import Reading

_READ = Reading()


@dataclass(frozen=True, slots=True)
class Source:
    """A sequence, and what a user must know of where it comes from."""

    sequence: MeshSequence
    remarks: tuple[str, ...] = ()
    up: Up = "y"  # as the cameras have it, where they are known

    @property
    def warnings(self) -> tuple[str, ...]:
        """A line each; complete once the sequence has been read."""
        return (*self.remarks, *getattr(self.sequence, "warnings", ()))


def open_source(inputs: Sequence[str], reading: Reading) -> Source:
    """The frames of mesh files, or of a rig's folder, fused when they are asked for. Raises InputError.

    A simulated rig's truth describes its cameras, too, but has the frames themselves.
    """
    folder = Path(inputs[0])
    described = any((folder / name).is_file() for name in (RIG, SINGLE))
    if len(inputs) > 1 or not described or any(folder.glob("frame_*.ply")):
        options, made = reading.options(), captured(folder) if len(inputs) == 1 else {}
        rate = made.get("frames_per_second")
        if reading.fps == _READ.fps and isinstance(rate, (int, float)) and rate > 0:
            options = replace(options, frame_rate=float(rate))
        sequence = open_sequence(inputs[0] if len(inputs) == 1 else list(inputs), options)
        return Source(sequence, up=known_up(made.get("up")))
    reading.options()  # refuses what no sequence can have
    if reading.scale != _READ.scale:
        raise InputError(f"--scale {reading.scale:g}: {folder} is a rig, whose poses are in metres; leave it out")
    recording, remarks = open_recording(folder, frames=reading.frames)
    if reading.fps not in (_READ.fps, recording.frame_rate):
        text = f"--fps {reading.fps:g}: {folder} is a rig of {recording.frame_rate:g} frames a second"
        raise InputError(f"{text}; leave it out, or mend the rig's description")
    return Source(recording, tuple(remarks), recording.rig.up)


def captured(folder: Path) -> dict[str, Any]:
    """What `capture` has written of a recording beside its meshes; nothing where it has not."""
    try:
        made = json.loads((folder / MADE).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    return made if isinstance(made, dict) else {}


@Parameter(name="*")
@dataclass(frozen=True, slots=True)
class Masking:
    """Who says what moves in a scene; geometric change over the sequence where nobody else does."""

    masks: Path | None = None
    """Masks of another tool: a folder with cameras.json, and view00/frame_00000.png ... of its cameras, 8-bit
    PNG of object numbers, 0 for what stands still. `segment --views-only` makes pictures and cameras for it."""
    sam3: Path | None = None
    """Masks by SAM3 (extra `sam3`): a folder with its weights, as of facebook/sam3."""
    prompts: Annotated[tuple[str, ...], Parameter(consume_multiple=True, negative="")] = ()
    """What SAM3 looks for, in words, as --prompts person --prompts dog; of it counts what moves. Common words where
    none is given."""
    device: str = "cpu"
    """Where SAM3 runs, as torch names it: cpu, cuda, cuda:1."""
    views: Path | None = None
    """A file of Open3D pinhole cameras, all of one size, that look at the scene; placed where it is not given."""
    up: Annotated[Up | None, Parameter(allow_leading_hyphen=True)] = None
    """The axis that points up: players stand the recording on it, and pictures of placed views are upright. That of
    the cameras, where they are known, else y."""

    def __post_init__(self) -> None:
        if self.masks is not None and self.sam3 is not None:
            raise InputError(f"--masks {self.masks} and --sam3 {self.sam3}: give one of both")
        if self.masks is not None and self.views is not None:
            raise InputError(f"--views {self.views}: the masks in {self.masks} have cameras of their own; leave it out")
        if self.sam3 is None and (self.prompts or self.device != "cpu"):
            raise InputError("--prompts and --device are for SAM3; give --sam3, too")

    @property
    def wanted(self) -> bool:
        """True where any flag says something."""
        return replace(self, up=None) != Masking()

    def options(self, options: SegmentOptions, source: Source) -> SegmentOptions:
        """The same with the views that were asked for. Raises InputError where their file is wrong."""
        options = replace(options, views=replace(options.views, up=self.up or source.up))
        if self.views is None:
            return options
        try:
            data = self.views.read_bytes()
        except OSError as error:
            text = f"{self.views}: cannot be read ({error.strerror})"
            raise InputError(f"{text}; give Open3D pinhole camera JSON") from None
        return replace(options, cameras=one_size(unpack_cameras(data, str(self.views)), str(self.views)))

    def masker(self, frames: int) -> Masker | None:
        """Who has masks of so many frames; None: geometric change. Raises InputError where masks are wrong."""
        if self.masks is not None:
            return ImageMasks(self.masks, frames)
        if self.sam3 is not None:
            return Sam3Masks(self.sam3, self.prompts or None, Sam3Options(device=self.device))
        return None
