"""Sequences by name: bodies, four of them side by side, scenes, recordings; or any folder.

In: a name, the folder of the benchmark data, a folder to keep things in. Out: a MeshSequence. What is known by a name
is what it was when its checksum was taken (`checksums`). Sequences of files are welded: seams count as one surface.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from ..capture.procedural import SoftBodiesOptions, soft_bodies
from ..capture.record import open_recording
from ..capture.truth import Truth
from ..errors import InputError
from ..geometry.cameras import PinholeCamera
from ..geometry.topology import weld
from ..io.sequence import FileSequence, SequenceOptions, open_sequence
from ..types import MeshSequence
from .captured import Captured
from .checksums import check_source
from .remesh import RemeshedSequence
from .rooms import PEOPLE, ROOM
from .scenes import PROCEDURAL, SCENES, open_scene
from .side_by_side import Place, SideBySide

DEMO = "demo"  # procedural bodies: needs no benchmark data
SYNTHETIC = "synthetic4"
BODIES: dict[str, Place] = {  # of SYNTHETIC, m: on one floor, 30 cm apart
    "dancer": (-1.39, 0.48, 0.0),
    "basketball_player": (-0.32, 0.48, 0.0),
    "mitch": (0.73, 0.0, 0.0),
    "crane": (0.81, 0.0, 0.0),
}
SYNTHETIC_FRAMES = 10
RECORDINGS = ("living_room",)
MADE = (*SCENES, PROCEDURAL, *RECORDINGS)  # simulated or fused, and kept: minutes
PERFORMERS, RECORDED = "performers", "captures"  # folders of the benchmark data
SCALES = {"basketball_player": 0.1}  # to metres; the others are in metres
REMESHED = {"crane60": "crane", "samba60": "samba"}  # new connectivity in every frame, from a body that has one
REMESHED_FRAMES = 60


@dataclass(frozen=True, slots=True, eq=False)
class Dataset:
    """A sequence and what is known of it."""

    sequence: MeshSequence
    cameras: tuple[PinholeCamera, ...] = ()  # where it was seen from; none: look from around it
    truth: Truth | None = None


def open_dataset(name: str, data: Path, frames: int | None = None, cache: Path | None = None) -> MeshSequence:
    """The sequence called `name` below `data`, or a path; its first `frames` frames where that is asked for.

    What takes long to make is kept below `cache`, where that is given; scenes and recordings need it. Raises
    InputError where data are missing or are not what the name means.
    """
    return open_known(name, data, frames, cache).sequence


def open_known(name: str, data: Path, frames: int | None = None, cache: Path | None = None) -> Dataset:
    """As `open_dataset`, with what is known of the sequence."""
    if name == DEMO:
        return Dataset(soft_bodies(SoftBodiesOptions(frames=frames or SoftBodiesOptions().frames)))
    if name in (*SCENES, PROCEDURAL):
        return _scene(name, data, frames, cache)
    if name in RECORDINGS:
        return _recording(name, data, frames, cache)
    if name == SYNTHETIC:
        count = min(frames or SYNTHETIC_FRAMES, SYNTHETIC_FRAMES)
        bodies = [(_open_files(body, data, count), place) for body, place in BODIES.items()]
        return Dataset(SideBySide(bodies))
    if name in REMESHED:
        source = _open_files(REMESHED[name], data, min(frames or REMESHED_FRAMES, REMESHED_FRAMES))
        return Dataset(RemeshedSequence(source, None if cache is None else cache / name))
    return Dataset(_open_files(name, data, frames))


def _scene(name: str, data: Path, frames: int | None, cache: Path | None) -> Dataset:
    if name in SCENES:
        for source in (ROOM, *(Path(PERFORMERS, f"{body}.npz") for body in PEOPLE)):
            check_source(data / source, source)
    scene = open_scene(name, data, _kept(name, cache), frames)
    return Dataset(scene.meshes, scene.meshes.cameras, scene.truth)


def _recording(name: str, data: Path, frames: int | None, cache: Path | None) -> Dataset:
    source = Path(RECORDED, name)
    check_source(data / source, source)
    recording, _ = open_recording(data / source, frames=":" if frames is None else f":{frames}", keep=False)
    captured = Captured(recording, _kept(name, cache) / name / "meshes")
    return Dataset(captured, captured.cameras)


def _kept(name: str, cache: Path | None) -> Path:
    if cache is None:
        raise InputError(f"{name} is captured into a folder that is kept: give one")
    return cache


def _open_files(name: str, data: Path, frames: int | None) -> FileSequence:
    path = next((p for p in _places(name, data) if p.exists()), None)
    if path is None:
        raise InputError(f"no sequence {name!r} below {data}; give the folder of the benchmark data with --data")
    if path.parent == data / PERFORMERS:
        check_source(path, Path(PERFORMERS, path.name))
    chosen = ":" if frames is None else f":{frames}"
    return open_sequence(path, SequenceOptions(frames=chosen, scale=SCALES.get(name, 1.0), weld=weld))


def _places(name: str, data: Path) -> Sequence[Path]:
    below = data / PERFORMERS
    return (below / name, below / f"{name}.npz", data / name, data / f"{name}.npz", Path(name))
