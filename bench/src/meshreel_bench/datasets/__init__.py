"""Sequences by name: bodies, four of them side by side, scenes, recordings; or any folder.

In: a name, the folder of the benchmark data, a folder to keep things in. Out: a MeshSequence. What is known by a name
is what it was when its checksum was taken (`checksums`); of anything else `own_digest` tells what it is. Sequences of
files are welded: seams count as one surface.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from meshreel.capture.procedural import SoftBodiesOptions, soft_bodies
from meshreel.capture.recording import open_recording
from meshreel.capture.truth import Truth
from meshreel.errors import InputError
from meshreel.geometry.cameras import PinholeCamera
from meshreel.geometry.topology import weld
from meshreel.io.file_names import find_frames, is_pattern
from meshreel.io.sequence import FileSequence, SequenceOptions, open_sequence
from meshreel.types import MeshSequence

from .captured import Captured
from .checksums import check_source, checksum, known_checksums
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


def open_dataset(
    name: str, data: Path, frames: int | None = None, cache: Path | None = None, own: SequenceOptions | None = None
) -> MeshSequence:
    """The sequence called `name` below `data`, or a path; its first `frames` frames where that is asked for.

    What takes long to make is kept below `cache`, where that is given; scenes and recordings need it. `own` says how
    files that are not the benchmark's become a sequence. Raises InputError where data are missing or are not what the
    name means.
    """
    return open_known(name, data, frames, cache, own).sequence


def open_known(
    name: str, data: Path, frames: int | None = None, cache: Path | None = None, own: SequenceOptions | None = None
) -> Dataset:
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
    return Dataset(_open_files(name, data, frames, own))


def own_digest(name: str, data: Path, own: SequenceOptions | None = None) -> str | None:
    """What a sequence that has no name here consists of, and how it is read; None for those of the benchmark.

    Raises InputError where it is missing.
    """
    if name in (DEMO, SYNTHETIC, *SCENES, PROCEDURAL, *RECORDINGS, *REMESHED):
        return None
    path, options = _found(name, data), own or SequenceOptions()
    if _is_known(path, data):
        return None
    files = [path] if path.exists() else find_frames(path)[0]
    told = (*map(checksum, files), options.frame_rate, options.frames, options.scale)
    return hashlib.sha256(repr(told).encode()).hexdigest()


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


def _open_files(name: str, data: Path, frames: int | None, own: SequenceOptions | None = None) -> FileSequence:
    path = _found(name, data)
    if path.parent == data / PERFORMERS:
        check_source(path, Path(PERFORMERS, path.name))
    options = SequenceOptions(scale=SCALES.get(name, 1.0)) if own is None or _is_known(path, data) else own
    chosen = options.frames if frames is None else f":{frames}"
    return open_sequence(path, replace(options, frames=chosen, weld=weld))


def _found(name: str, data: Path) -> Path:
    """Where the files of a sequence are."""
    path = next((p for p in _places(name, data) if p.exists() or is_pattern(name)), None)
    if path is None:
        where = f"at that path or below {data}" if _is_path(name) else f"below {data}"
        raise InputError(
            f"no sequence {name!r} {where}; give its path, or the folder of the benchmark data with --data"
        )
    return path


def _places(name: str, data: Path) -> Sequence[Path]:
    below = data / PERFORMERS
    known = (below / name, below / f"{name}.npz", data / name, data / f"{name}.npz")
    return (Path(name), *known) if _is_path(name) else (*known, Path(name))


def _is_path(name: str) -> bool:
    """Whether somebody means a path, and no name that they know."""
    return name.startswith(".") or any(sign in name for sign in {"/", os.sep})


def _is_known(path: Path, data: Path) -> bool:
    """Whether a path is of the benchmark data, which have checksums."""
    return path.parent == data / PERFORMERS and Path(PERFORMERS, path.name).as_posix() in known_checksums()
