"""A recording of a rig as a sequence of meshes: each frame fused when it is asked for.

In: a rig's folder. Out: a MeshSequence, and what a user must know of the recording. A camera that moves is found by
its own data: the pixels of one that stands still mostly see what they always see.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np
from jaxtyping import Float64

from ..errors import InputError
from ..geometry.depth import DepthPicture
from ..io.sequence import SequenceOptions
from ..types import Mesh, MeshSequence
from .fusion import FusionOptions, fuse_depths
from .rig import Rig, read_rig

LOOKED_AT = 12  # frames, spread over the recording
APART = (0.06, 0.02)  # m, and of the depth: measurements farther apart are of something else
MOVED = 0.5  # share of the pixels that see something else than usual, in the usual frame, of a camera that moves
LEAST = 0.3  # share of the pixels with a measurement below which nothing is said: there may be no background in view


class Recording(MeshSequence):
    """The frames of a rig as a MeshSequence, in world coordinates.

    A frame is fused when it is first asked for, and kept in a folder for temporary files as long as this object lives
    and there is room (10 MB for half a million faces): who encodes a scene asks for it several times. Who reads each
    frame once says `keep=False`.
    """

    def __init__(
        self, rig: Rig, options: FusionOptions = FusionOptions(), frames: str = ":", keep: bool = True
    ) -> None:
        numbers = rig.frames
        chosen = SequenceOptions(frames=frames).chosen(len(numbers))
        self.rig, self.options = rig, options
        self.numbers = [numbers[index] for index in chosen]  # of the frames, in the files' names
        self._kept = Kept() if keep else None

    @property
    def frame_rate(self) -> float:
        """Frames per second, 1/s."""
        return self.rig.frame_rate

    def __len__(self) -> int:
        return len(self.numbers)

    def __getitem__(self, index: int) -> Mesh:
        number = self.numbers[index]
        if self._kept is not None and (kept := self._kept.get(number)) is not None:
            return kept
        depths = self.rig.depths(number)
        try:
            mesh = fuse_depths(depths, self.options)
        except InputError as error:
            raise InputError(f"{self.rig.folder}: frame {number}: {error}") from None
        if self._kept is not None:
            self._kept.put(number, mesh)
        return mesh

    def pictures(self, index: int) -> list[DepthPicture | None]:
        """What each camera measured in a frame; None where it lacks it (`SeesDepth`)."""
        frame, files = self.numbers[index], self.rig.files
        cameras = enumerate(self.rig.cameras)
        return [camera.picture(self.rig.depth(k, frame)) if frame in files[k] else None for k, camera in cameras]


class Kept:
    """Meshes by number, in a folder of its own that goes when it does."""

    def __init__(self) -> None:
        self._folder: tempfile.TemporaryDirectory[str] | None = None
        self._files: dict[int, Path] = {}
        self._full = False

    def get(self, number: int) -> Mesh | None:
        """The mesh as it was put; None where it is not there."""
        if number not in self._files:
            return None
        with np.load(self._files[number], allow_pickle=False) as arrays:
            return Mesh(arrays["vertices"], arrays["faces"])

    def put(self, number: int, mesh: Mesh) -> None:
        """Keeps a mesh; from when there is no room for one on, none."""
        if self._full:
            return
        try:
            self._folder = self._folder or tempfile.TemporaryDirectory(prefix="meshreel-", ignore_cleanup_errors=True)
            path = Path(self._folder.name) / f"{number}.npz"
            np.savez(path, vertices=mesh.vertices, faces=mesh.faces)
            self._files[number] = path
        except OSError:  # what is asked for again is then made again
            self._full = True


def open_recording(
    folder: Path, options: FusionOptions = FusionOptions(), frames: str = ":", keep: bool = True
) -> tuple[Recording, list[str]]:
    """The recording in a rig's folder, and a line for each thing that a user must know of it.

    `frames` is a range of them, as A:B with B excluded; `keep` is that of the recording. Raises InputError where the
    rig is wrong or one of its cameras moves.
    """
    rig = read_rig(folder)
    warnings = [*rig.remarks, *rig.missing()]
    for number, camera in enumerate(rig.cameras):
        seen = _looked_at(rig, number)
        blind = sum(not depth.any() for depth in seen)
        if blind:
            warnings.append(f"camera {camera.name} measures nothing in {blind} of {len(seen)} frames looked at")
        if (share := moved_share(seen)) > MOVED:
            raise InputError(
                f"{folder}: camera {camera.name} seems to move: {100 * share:.0f} % of its pixels see something else "
                "than usual; record with cameras that stand still, or cut the recording where it was moved"
            )
    return Recording(rig, options, frames, keep), warnings


def moved_share(depths: list[Float64[np.ndarray, "H W"]]) -> float:
    """The share of the pixels that see something else than they usually do, in the median frame; depths in m.

    Usual is the median over the frames; pixels without a measurement say nothing. 0 where there is too little to say.
    """
    seen = [depth for depth in depths if (depth > 0).mean() >= LEAST]
    if len(seen) < 3:
        return 0.0
    stack = np.where(np.stack(seen) > 0, np.stack(seen), np.nan)
    known = np.isfinite(stack).sum(axis=0) >= 3
    usual = np.nanmedian(stack[:, known], axis=0)
    apart = np.abs(stack[:, known] - usual) > np.maximum(APART[0], APART[1] * usual)
    valid = np.isfinite(stack[:, known])
    return float(np.median((apart & valid).sum(axis=1) / np.maximum(valid.sum(axis=1), 1)))


def _looked_at(rig: Rig, number: int) -> list[Float64[np.ndarray, "H W"]]:
    """Some depths of a camera, m, evenly spread over its frames; 0 where nothing counts."""
    frames = sorted(rig.files[number])
    chosen = sorted({frames[int(k)] for k in np.linspace(0, len(frames) - 1, LOOKED_AT)})
    return [rig.depth(number, frame) * rig.cameras[number].depth_unit for frame in chosen]
