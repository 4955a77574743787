"""A rig's recording as a sequence of meshes, each frame fused when it is read."""

from __future__ import annotations

import pickle
import tempfile
from collections.abc import Sequence
from contextlib import suppress
from copy import copy
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from pathlib import Path
from threading import Lock
from typing import Any

import numpy as np
from jaxtyping import Float64

from ..errors import InputError
from ..geometry.color_views import ColorViews, spread_colors
from ..geometry.depth import DepthPicture, apart
from ..geometry.derived_sequences import ChosenPictures
from ..geometry.reconstruct import GRAZING, SEEN, TRUNCATION, extract, integrate
from ..geometry.topology import vertex_normals, without_fragments
from ..io.file_names import Order
from ..io.sequence import SequenceOptions
from ..types import Mesh, MeshSequence, Up, evenly
from .calibration.colors import CalibrationOptions, Corrected, Corrections, corrections_of, remembered
from .rig.rig import RIG, SINGLE, Rig, read_rig
from .rig.steady import SteadyDepth

MOVED = 0.5  # share of pixels that differ from their usual depth, in the median frame, of a camera that moves (guess)
LEAST = 0.3  # share of pixels with a measurement below which a frame is ignored: it may show no background (guess)
LOOKED_AT = 12  # frames examined for what a sensor is off as a whole (guess)
_ONE_THREAD = Lock()  # at a time, at a file of meshes
FINER = 2  # times the rows and columns of the pictures, interpolated, that are fused (decision 28)


@dataclass(frozen=True, slots=True)
class FusionOptions:
    """Resolution of the fused surface and removal of fragments."""

    voxel: float = 0.02  # m, side of a voxel
    truncation: float | None = None  # voxels before and behind a depth that it constrains; None: by the cameras
    fragment: float = 0.002  # m^2: connected components with less area are dropped

    def __post_init__(self) -> None:
        if not 1e-4 <= self.voxel <= 1:
            raise InputError(f"voxel {self.voxel:g}: give metres, 0.0001 to 1; 0.02 suits a room")
        if not (self.truncation is None or 1 <= self.truncation <= 20) or not 0 <= self.fragment < np.inf:
            text = f"truncation {self.truncation}, fragment {self.fragment:g}"
            raise InputError(f"{text}: give 1 to 20 voxels and an area from 0 on")


def fuse_depths(pictures: Sequence[DepthPicture], options: FusionOptions) -> Mesh:
    """Fuse depth pictures into a mesh, which may be empty. Raises InputError beyond `reconstruct.MOST_BLOCKS`."""
    fine = [picture.finer(FINER) for picture in pictures if picture.depth.any()]
    if not fine:
        return Mesh.empty()
    # Surface seen at a grazing angle needs more voxels, limbs that are seen from both sides bear fewer.
    truncation = options.truncation or (GRAZING if len(pictures) == 1 else TRUNCATION)
    return without_fragments(extract(integrate(fine, options.voxel, truncation), SEEN), options.fragment)


class Recording(MeshSequence):
    """The frames of a rig as a MeshSequence, in world coordinates.

    A frame is fused when it is first read, and, unless `keep` is false, kept in a temporary file as long as this object
    lives and the disk has room (10 MB for half a million faces): encoding a scene reads it several times.
    """

    def __init__(self, rig: Rig, options: FusionOptions, frames: str = ":", keep: bool = True) -> None:
        numbers = rig.frames
        chosen = SequenceOptions(frames=frames).chosen(len(numbers))
        self.rig, self.options = rig, options
        self.numbers = [numbers[index] for index in chosen]  # of the frames, in the files' names
        self._kept, self._paints = Kept() if keep else None, bool(rig.color_cameras)
        self.steady = SteadyDepth(rig)

    is_shared = True  # threads may read frames at the same time

    @property
    def frame_rate(self) -> float:
        return self.rig.frame_rate

    def __len__(self) -> int:
        return len(self.numbers)

    def __getitem__(self, index: int) -> Mesh:
        number = self.numbers[index]
        kept = None if self._kept is None else self._kept.get(number)
        if kept is not None and (kept.is_colored or kept.is_empty or not self._paints):
            return kept if self._paints else replace(kept, colors=None)
        pictures = [picture for picture in self.steady.pictures(number) if picture is not None]
        try:
            mesh = fuse_depths(pictures, self.options) if kept is None else kept
        except InputError as error:
            raise InputError(f"{self.rig.folder}: frame {number}: {error}") from None
        mesh = self._colored(mesh, number, pictures) if self._paints else mesh
        if self._kept is not None and (kept is None or mesh.is_colored):
            self._kept.put(number, mesh)
        return mesh

    @property
    def uncolored(self) -> Recording:
        """The same frames without colours of their vertices, for which all pictures of a frame must be asked."""
        found = copy(self)
        found._paints = False
        return found

    def _colored(self, mesh: Mesh, number: int, depths: Sequence[DepthPicture]) -> Mesh:
        """Return a mesh, fused from these pictures, with colours of its vertices, where the rig has colour cameras."""
        pictures = [picture for picture in self.rig.color_pictures(number) if picture is not None]
        if not pictures or mesh.is_empty:
            return mesh
        colors, seen = ColorViews(pictures, mesh, depths=depths).at(mesh.vertices, vertex_normals(mesh))
        return replace(mesh, colors=spread_colors(mesh, colors, seen))

    @property
    def files(self) -> tuple[Path, ...]:
        """The files that the frames are made of: the rig's description, its pictures, and those of usual depths."""
        described = [path for path in (self.rig.folder / RIG, self.rig.folder / SINGLE) if path.exists()]
        pictures = (*self.rig.files, *(camera.files for camera in self.rig.color_cameras))
        frames = (*described, *(of[number] for number in self.numbers for of in pictures if number in of))
        return (*frames, *self.rig.paths.values(), *(path for path in self.steady.files if path not in set(frames)))

    @property
    def up(self) -> Up:
        """The axis that points up, as the rig is described."""
        return self.rig.up

    @property
    def pictures(self) -> ChosenPictures:
        """The colour pictures of the frames as they were recorded; vertices have their colours."""
        return ChosenPictures(self.rig.color_pictures, tuple(self.numbers))

    @cached_property
    def colors(self) -> Corrected | None:
        """The colour pictures with cameras that agree; None where the rig has no colour cameras."""
        return Corrected(self.pictures, self._corrections) if self.rig.color_cameras else None

    def _corrections(self) -> Corrections:
        """Return the corrections that all frames of the rig give, whichever were chosen."""
        if len(self.rig.color_cameras) < 2:
            return ()
        whole = self if self.numbers == self.rig.frames else Recording(self.rig, self.options, keep=False)
        options = CalibrationOptions()
        looked_at = [whole.numbers[index] for index in evenly(len(whole), options.frames)]
        depends_on = {"fusion": asdict(self.options), "calibration": asdict(options)}
        return remembered(self.rig, looked_at, depends_on, lambda: corrections_of(whole, whole.pictures, options))

    @property
    def depth(self) -> ChosenPictures:
        """The depth pictures that the frames are fused from."""
        return ChosenPictures(self.steady.pictures, tuple(self.numbers))


class Kept:
    """Meshes by number in a temporary file without a name, which ends with this object or its process."""

    def __init__(self) -> None:
        self._file: Any = None  # io.FileIO
        self._places: dict[int, tuple[int, int]] = {}  # offset in the file, and size, bytes

    def get(self, number: int) -> Mesh | None:
        """Return a kept mesh, or None."""
        if number not in self._places:
            return None
        offset, size = self._places[number]
        with _ONE_THREAD:
            self._file.seek(offset)
            data = self._file.read(size)
        return pickle.loads(data)

    def put(self, number: int, mesh: Mesh) -> None:
        """Keep a mesh, unless the disk has no room: it is fused again, then."""
        data = pickle.dumps(mesh)
        with suppress(OSError), _ONE_THREAD:
            if self._file is None:  # without a buffer: one that could not be written would fail again when it is read
                self._file = tempfile.TemporaryFile(prefix="meshreel-", buffering=0)  # noqa: SIM115
            offset = self._file.seek(0, 2)
            if self._file.write(data) == len(data):
                self._places[number] = (offset, len(data))


def open_recording(
    folder: Path, options: FusionOptions = FusionOptions(), frames: str = ":", keep: bool = True, order: Order = "auto"
) -> tuple[Recording, list[str]]:
    """Open the recording in a rig's folder, frames A:B, with warnings.

    Raises InputError, also for a camera that moves and has no path.
    """
    rig = read_rig(folder, order)
    warnings = [*rig.remarks, *rig.missing()]
    for number, camera in enumerate(rig.cameras):
        seen = rig.looked_at(number)
        warnings += rig.blind(number, seen)
        if not camera.path and (share := moved_share(seen)) > MOVED:
            text = f"{folder}: camera {camera.name} seems to move: {100 * share:.0f} % of its pixels see something else"
            remedy = "say where it was in each frame (`poses`), or cut the recording where it was moved"
            raise InputError(f"{text} than usual; {remedy}")
    recording = Recording(rig, options, frames, keep)
    return recording, warnings + unsteady(recording)


def unsteady(recording: Recording) -> list[str]:
    """Return a warning for each camera whose sensor is off in some frames as a whole, which is corrected."""
    numbers, found = recording.numbers, list[str]()
    looked_at = [numbers[index] for index in evenly(len(numbers), LOOKED_AT)]
    for camera, errors in zip(recording.rig.cameras, recording.steady.errors(looked_at), strict=True):
        if worst := max(map(abs, errors), default=0.0):
            off = sum(map(bool, errors))
            text = f"camera {camera.name} measures {off} of {len(looked_at)} frames looked at too far or too near"
            found.append(f"{text} as a whole, by up to {100 * worst:.1f} % of the depth: that is corrected")
    return found


def moved_share(depths: list[Float64[np.ndarray, "H W"]]) -> float:
    """Return the share of measured pixels that differ from their usual depth, m, in the median of 3 frames or more."""
    seen = [depth for depth in depths if (depth > 0).mean() >= LEAST]
    if len(seen) < 3:
        return 0.0
    stack = np.where(np.stack(seen) > 0, np.stack(seen), np.nan)
    known = np.isfinite(stack).sum(axis=0) >= 3
    usual = np.nanmedian(stack[:, known], axis=0)
    other = np.abs(stack[:, known] - usual) > apart(usual)
    valid = np.isfinite(stack[:, known])
    return float(np.median((other & valid).sum(axis=1) / np.maximum(valid.sum(axis=1), 1)))
