"""Sequences by name: the captured performers where they are present, the procedural demo, or any folder.

A sequence is cut to its first `frames` frames where that is asked for; every loader welds duplicate positions.
"""

from __future__ import annotations

from pathlib import Path

from ..capture.procedural import SoftBodiesOptions, soft_bodies
from ..errors import InputError
from ..geometry.topology import weld
from ..io.sequence import SequenceOptions, open_sequence
from ..types import MeshSequence

SCALES = {"basketball_player": 0.1}  # to metres; the others are in metres


def open_dataset(name: str, data: Path, frames: int | None = None) -> MeshSequence:
    """The sequence called `name` below `data`, or a path, at 30 frames a second; InputError where it is missing."""
    if name == "demo":
        return soft_bodies(SoftBodiesOptions(frames=frames or SoftBodiesOptions().frames))
    path = next((p for p in (data / name, data / f"{name}.npz", Path(name)) if p.exists()), None)
    if path is None:
        raise InputError(f"no sequence {name!r} below {data}; give the folder of the benchmark data with --data")
    chosen = ":" if frames is None else f":{frames}"
    return open_sequence(path, SequenceOptions(frames=chosen, scale=SCALES.get(name, 1.0), weld=weld))
