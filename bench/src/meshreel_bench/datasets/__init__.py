"""Sequences by name: bodies, two or four of them side by side, scenes, recordings; or any folder.

Benchmark data are compared with their checksums; other sequences have a digest, which rows carry.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from itertools import cycle, islice
from pathlib import Path

import numpy as np

from meshreel.analysis.scene.masks import VIEW_FILES, read_view_file
from meshreel.capture.clouds import Clouds, are_clouds, open_clouds
from meshreel.capture.recording import Recording, open_recording
from meshreel.capture.recordings import is_take, open_take
from meshreel.capture.recordings.to_rig import write_takes
from meshreel.capture.simulated.demo_room import RoomOptions, furnished_room
from meshreel.capture.simulated.procedural import SoftBodiesOptions, soft_bodies
from meshreel.capture.simulated.simulated_rig import SceneFrame
from meshreel.errors import InputError
from meshreel.geometry.cameras import Camera
from meshreel.geometry.color_views import ColorFrames
from meshreel.geometry.derived_sequences import picked
from meshreel.geometry.topology import weld
from meshreel.io.file_names import MESHES, is_pattern
from meshreel.io.sequence import FileSequence, SequenceOptions, open_sequence
from meshreel.types import MeshSequence

from .checksums import check_source, checksum, known_checksums
from .long_room import LongRoom
from .remesh import Place, RemeshOptions, SideBySide, gears, prism, remeshed
from .rooms import PROCEDURAL, ROOM, ROOM2, ROOM3, SENSED, WALKERS
from .scenes import PEOPLE, SCENES, Captured, SceneData, open_scene
from .walker import FRAMES, TrueLuma, Walker, true_luma

DEMO = "demo"  # procedural bodies: needs no benchmark data
# Neither do these.
SHAPES: dict[str, Callable[..., MeshSequence]] = {"gears": gears, "prism": prism, "long_room": LongRoom}
SYNTHETIC, WITH_CRANE = "synthetic4", "synthetic4-crane"  # the paper's; and the same with crane for thomas
_THREE: dict[str, Place] = {
    "dancer": (-1.39, 0.48, 0.0),
    "basketball_player": (-0.32, 0.48, 0.0),
    "mitch": (0.73, 0.0, 0.0),
}
FOURS: dict[str, dict[str, Place]] = {  # bodies and their places, m: on one floor, 30 cm apart
    SYNTHETIC: {**_THREE, "thomas": (1.96, 0.0, 0.0)},
    WITH_CRANE: {**_THREE, "crane": (0.81, 0.0, 0.0)},
}
SYNTHETIC_FRAMES = 10
RECORDINGS = ("living_room",)
WALKER = "procedural_walker"  # needs no benchmark data
PERFORMERS, RECORDED = "performers", "captures"  # folders of the benchmark data
SCALES = {"basketball_player": 0.1, "textured/basketball_player": 0.1}  # to metres; the others are in metres
# m, longest edges of the boxes of MPEG's whole sequences, which its D1 and D2 are relative to (V-DMC's conditions).
MPEG_EDGES = {"dancer": 2.06224, "basketball_player": 1.97783, "mitch": 1.82389, "thomas": 1.82497}
REMESHED = {  # new connectivity in every frame: of a body, its first frames
    "crane60": ("crane", 60, RemeshOptions()),
    "samba60": ("samba", 60, RemeshOptions()),
    "crane150": ("crane", 150, RemeshOptions()),
    "samba150": ("samba", 150, RemeshOptions()),
    "dancer160k": ("dancer", 4, RemeshOptions(vertices=160_000, levels=2)),
}
RELEASED = ("answering", "drinking", "arena", "sitting", "synthetic")  # folders of the data of TSMC's authors
LONG, LONG_FRAMES = "synthetic2x150", 150  # crane150, and samba150 that passes close by
FAR, NEAR = 2.2, 0.5  # m, of the second body's way: surfaces are 1.2 m apart first, 0.06 in the middle, 0.7 last
ROOMS = (*SCENES, ROOM3, PROCEDURAL, *SENSED, PEOPLE)
NAMES = (DEMO, *SHAPES, *FOURS, LONG, *ROOMS, WALKER, *RECORDINGS, *REMESHED)
PLAYED: dict[str, Callable[[int], Iterable[int]]] = {  # endings of names: the order of so many frames
    "-backwards": lambda count: reversed(range(count)),
    "-forth-and-back": lambda count: cycle([*range(count), *range(count - 2, 0, -1)]),  # ends are not repeated
}


@dataclass(frozen=True, slots=True, eq=False)
class Dataset:
    """Sequence with its cameras and, where it is simulated, its scene."""

    sequence: MeshSequence
    cameras: tuple[Camera, ...] = ()  # where it was seen from; none: look from around it
    scene: SceneData | None = None  # of a simulated scene
    pictures: ColorFrames | None = None  # of colour cameras: what decoded colours are compared with
    truth: TrueLuma | None = None  # what simulated colour cameras without errors would see
    edge: float | None = None  # m, of `MPEG_EDGES`
    painted: Callable[[int], SceneFrame] | None = None  # clean frames with their colours, of a room that is simulated


@dataclass(frozen=True, slots=True)
class Store:
    """Folders of the benchmark data and of generated sequences, and options of reading."""

    data: Path  # the folder of the benchmark data
    cache: Path | None = None  # scenes, recordings and remeshed bodies are kept here; scenes and recordings need it
    own: SequenceOptions = SequenceOptions()  # how files that are not the benchmark's become a sequence

    def open(self, name: str, frames: int | None = None) -> Dataset:
        """Return the first frames of a sequence by name or path. InputError where data are missing or others."""
        for ending, played in PLAYED.items():
            if name.endswith(ending):
                known = self.open(name.removesuffix(ending), None)
                numbers = tuple(islice(played(len(known.sequence)), frames or len(known.sequence)))
                return Dataset(picked(known.sequence, numbers), known.cameras)
        if name == DEMO:
            return Dataset(soft_bodies(SoftBodiesOptions(frames=frames or SoftBodiesOptions().frames)))
        if name in SHAPES:
            return Dataset(SHAPES[name](*([frames] if frames else [])))
        if name in ROOMS:
            return _scene(name, self.data, frames, self.cache)
        if name in RECORDINGS:
            known_as, chosen = Path(RECORDED, name), ":" if frames is None else f":{frames}"
            check_source(self.data / known_as, known_as)
            recording, _ = open_recording(self.data / known_as, frames=chosen, keep=False)
            return _captured(recording, _kept(name, self.cache) / name)
        if name in RELEASED and _is_published(self.data / name):
            return _published(self.data / name, _kept(name, self.cache) / name, frames)
        if name == WALKER:
            count = frames or FRAMES
            return Dataset(Walker(_kept(name, self.cache) / f"{name}-{count}", count), truth=true_luma)
        if name in FOURS:
            count = min(frames or SYNTHETIC_FRAMES, SYNTHETIC_FRAMES)
            bodies = [(_open_files(body, self.data, count), place) for body, place in FOURS[name].items()]
            return Dataset(SideBySide(bodies))
        if name == LONG:
            first, second = (self.open(body, frames).sequence for body in ("crane150", "samba150"))
            x = FAR - (FAR - NEAR) * np.sin(np.pi * np.arange(LONG_FRAMES) / (LONG_FRAMES - 1)) ** 2
            return Dataset(SideBySide([(first, (0.0, 0.0, 0.0)), (second, x[:, None] * [1.0, 0.0, 0.0])]))
        if name in REMESHED:
            body, most, options = REMESHED[name]
            source = _open_files(body, self.data, min(frames or most, most))
            return Dataset(remeshed(source, None if self.cache is None else self.cache / name, options))
        folder = _found(name, self.data)
        seen_from = read_view_file(folder) if folder.is_dir() and any(folder.glob(VIEW_FILES)) else ()
        return Dataset(_open_files(name, self.data, frames, self.own), seen_from, edge=MPEG_EDGES.get(name))

    def digest(self, name: str) -> str | None:
        """Return a digest of a user's sequence and its options of reading; None for benchmark data."""
        for ending in PLAYED:
            name = name.removesuffix(ending)
        if name in NAMES:
            return None
        path = _found(name, self.data)
        if _is_known(path, self.data):
            return None
        files = [path] if path.exists() else open_sequence(path).files
        read = (*map(checksum, files), self.own.frame_rate, self.own.frames, self.own.scale)
        return hashlib.sha256(repr(read).encode()).hexdigest()


def is_scene(name: str) -> bool:
    """Return whether a sequence is a capture by cameras, with a background."""
    for ending in PLAYED:
        name = name.removesuffix(ending)
    return name in (*ROOMS, *RECORDINGS, *RELEASED)


def _captured(recording: Recording | Clouds, kept: Path) -> Dataset:
    captured = Captured(recording, kept / "meshes")
    return Dataset(captured, captured.cameras, pictures=captured.colors)


def _is_published(folder: Path) -> bool:
    """Return whether a scene is as SceneHub4D and FSVVD publish theirs: recordings of cameras, or point clouds."""
    return folder.is_dir() and not any((folder / MESHES).glob("*")) and (is_take(folder) or are_clouds([folder]))


def _published(folder: Path, kept: Path, frames: int | None) -> Dataset:
    """Return a scene of others as `meshreel capture` makes it; the rig of cameras is kept, too."""
    chosen = ":" if frames is None else f":{frames}"
    if not is_take(folder):
        return _captured(open_clouds([folder], frames=chosen)[0], kept)
    if not (kept / "rig").exists():
        write_takes([open_take(folder)], kept / "rig")
    return _captured(open_recording(kept / "rig", frames=chosen, keep=False)[0], kept)


def released_in(data: Path) -> tuple[str, ...]:
    """Return the names of the sequences of TSMC's authors, or of whom they took them from, in a folder."""
    return tuple(name for name in RELEASED if any((data / name / MESHES).glob("*")) or _is_published(data / name))


def views_missing(data: Path, names: Iterable[str]) -> tuple[str, ...]:
    """Return a line for each sequence of the authors without the views that its pictures are to be seen from."""
    released = (name for name in released_in(data) if name in names and not _is_published(data / name))
    lacking = [name for name in released if not any((data / name).glob(VIEW_FILES))]
    return tuple(f"{data / name}: no {VIEW_FILES}; pictures are seen from views around the meshes" for name in lacking)


def _scene(name: str, data: Path, frames: int | None, cache: Path | None) -> Dataset:
    if name in SCENES or name.endswith(ROOM2):
        for source in (ROOM, *(Path(PERFORMERS, f"{body}.npz") for body in WALKERS)):
            check_source(data / source, source)
    try:
        scene = open_scene(name, data, _kept(name, cache), frames)
    except InputError as error:
        if not (data / ROOM).exists():
            error.add_note("--data is the folder of the benchmark's data, or of answering/meshes ... of TSMC's authors")
        raise
    painted = furnished_room(RoomOptions(len(scene.meshes))).__getitem__ if name == PROCEDURAL else None
    return Dataset(scene.meshes, scene.meshes.cameras, scene, scene.meshes.colors, painted=painted)


def _kept(name: str, cache: Path | None) -> Path:
    if cache is None:
        raise InputError(f"{name} is captured into a folder that is kept: give one")
    return cache


def _open_files(name: str, data: Path, frames: int | None, own: SequenceOptions | None = None) -> FileSequence:
    path = _found(name, data)
    if path.is_relative_to(data):
        check_source(path, path.relative_to(data))
    options = SequenceOptions(scale=SCALES.get(name, 1.0)) if own is None or _is_known(path, data) else own
    chosen = options.frames if frames is None else f":{frames}"
    return open_sequence(path, replace(options, frames=chosen, weld=weld))


def _found(name: str, data: Path) -> Path:
    """Return the path of a sequence's file, folder or pattern of files."""
    below = data / PERFORMERS
    known = (below / name, below / f"{name}.npz", data / name, data / f"{name}.npz")
    places = (Path(name), *known) if _is_path(name) else (*known, Path(name))
    path = next((place for place in places if place.exists() or is_pattern(name)), None)
    if path is None:
        text = f"no sequence {name!r} {'at that path or ' * _is_path(name)}below {data}"
        raise InputError(f"{text}; give its path, or the folder of the benchmark data with --data")
    return path


def _is_path(name: str) -> bool:
    """Return whether a text is meant as a path rather than a name."""
    return name.startswith(".") or any(sign in name for sign in {"/", os.sep})


def _is_known(path: Path, data: Path) -> bool:
    """Return whether a path is among the benchmark data with checksums."""
    return path.is_relative_to(data) and path.relative_to(data).as_posix() in known_checksums()
