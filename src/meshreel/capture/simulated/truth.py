"""The truth beside a simulated rig: clean meshes, which of their faces move, true cameras (see `simulated_rig.py`).

The folder `truth` of a rig -> one SceneFrame per frame, read on demand.
"""

from __future__ import annotations

import operator
import zipfile
import zlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from io import BytesIO
from pathlib import Path

import numpy as np

from ...errors import InputError
from ...io.meshes import read_mesh
from ...io.read import read_file
from ..rig.cameras import DepthCamera
from ..rig.rig import read_cameras
from .simulated_rig import LABELS, SceneFrame

_DAMAGED = (OSError, ValueError, EOFError, zipfile.BadZipFile, zlib.error, NotImplementedError, RuntimeError)


@dataclass(frozen=True, slots=True)
class Truth:
    """Clean frames of a simulated rig, with its true cameras."""

    paths: tuple[Path, ...]  # of the clean meshes
    packed: tuple[np.ndarray, ...]  # a bit per face, set if it moves; untrusted, checked frame by frame
    cameras: tuple[DepthCamera, ...]  # with their true poses
    frame_rate: float  # 1/s

    def only(self, numbers: Sequence[int]) -> Truth:
        """Return the truth of some of its frames, which are numbered anew."""
        return replace(self, paths=tuple(self.paths[k] for k in numbers), packed=tuple(self.packed[k] for k in numbers))

    def __len__(self) -> int:
        return len(self.paths)

    def __getitem__(self, index: int) -> SceneFrame:
        number = range(len(self))[operator.index(index)]
        mesh = read_mesh(self.paths[number]).mesh
        bits, faces = self.packed[number], len(mesh.faces)
        if bits.dtype != np.uint8 or bits.shape != ((faces + 7) // 8,):
            text = f"{bits.dtype} {bits.shape} for {faces} faces"
            raise InputError(f"{self.paths[number]}: {LABELS} has {text}, not a bit a face; simulate the rig again")
        return SceneFrame(mesh, np.unpackbits(bits, count=faces).astype(bool))


def read_truth(folder: Path) -> Truth:
    """Read the truth in a folder. Raises InputError where a part of it is missing, damaged or inconsistent."""
    cameras, rate = read_cameras(folder)
    paths = {path.stem: path for path in sorted(folder.glob("frame_*.ply"))}
    if not paths:
        raise InputError(f"{folder}: has no clean meshes (frame_00000.ply); give the folder `truth` of a simulated rig")
    labels = _labels(folder / LABELS)
    if unlike := sorted(labels.keys() ^ paths.keys()):
        text = f"{len(paths)} clean meshes and labels of {len(labels)} frames, unlike in {unlike[0]}"
        raise InputError(f"{folder}: {text}; simulate the rig again")
    return Truth(tuple(paths.values()), tuple(labels[name] for name in paths), cameras, rate)


def _labels(path: Path) -> dict[str, np.ndarray]:
    """Return packed labels by frame name."""
    try:
        with np.load(BytesIO(read_file(path)), allow_pickle=False) as archive:
            return {name: archive[name] for name in archive.files}
    except _DAMAGED as error:
        raise InputError(f"{path}: labels cannot be read ({error}); simulate the rig again") from None
