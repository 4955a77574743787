"""Sequences by name: the captured performers where they are present, the procedural demo, or any folder.

A sequence is cut to its first `frames` frames where that is asked for; every loader welds duplicate positions.
"""

from __future__ import annotations

from pathlib import Path

from ..capture.procedural import SoftBodiesOptions, soft_bodies
from ..errors import InputError
from ..geometry.topology import weld
from ..io.sequence import FileSequence, SequenceOptions, open_sequence
from ..types import MeshSequence
from .remesh import RemeshedSequence

SCALES = {"basketball_player": 0.1}  # to metres; the others are in metres
REMESHED = {"crane60": "crane", "samba60": "samba"}  # new connectivity in every frame, from a body that has one
REMESHED_FRAMES = 60


def open_dataset(name: str, data: Path, frames: int | None = None, cache: Path | None = None) -> MeshSequence:
    """The sequence called `name` below `data`, or a path, at 30 frames a second; InputError where it is missing.

    What takes long to make (`REMESHED`) is kept below `cache`, where that is given.
    """
    if name == "demo":
        return soft_bodies(SoftBodiesOptions(frames=frames or SoftBodiesOptions().frames))
    if name in REMESHED:
        source = _open_files(REMESHED[name], data, min(frames or REMESHED_FRAMES, REMESHED_FRAMES))
        return RemeshedSequence(source, None if cache is None else cache / name)
    return _open_files(name, data, frames)


def _open_files(name: str, data: Path, frames: int | None) -> FileSequence:
    path = next((p for p in (data / name, data / f"{name}.npz", Path(name)) if p.exists()), None)
    if path is None:
        raise InputError(f"no sequence {name!r} below {data}; give the folder of the benchmark data with --data")
    chosen = ":" if frames is None else f":{frames}"
    return open_sequence(path, SequenceOptions(frames=chosen, scale=SCALES.get(name, 1.0), weld=weld))
