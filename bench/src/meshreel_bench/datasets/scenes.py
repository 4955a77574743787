"""The benchmark scenes, captured: noisy fused meshes, the truth, and labels of the faces that move; all are kept."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
from jaxtyping import Bool

from meshreel import geometry
from meshreel.analysis import scene as segmenter
from meshreel.analysis.scene.background import FRAMES, Moment, fuse_still_depth
from meshreel.analysis.scene.segmentation import segment
from meshreel.capture.clouds import Clouds
from meshreel.capture.recording import FusionOptions, Recording, open_recording
from meshreel.capture.rig.rig import RIG
from meshreel.capture.simulated import demo_room
from meshreel.capture.simulated.simulated_rig import TRUTH, Truth, read_truth, simulate_rig
from meshreel.geometry.closest_points import Surface, carried_labels
from meshreel.geometry.decimate import decimate_faces
from meshreel.geometry.derived_sequences import DerivedSequence
from meshreel.io.meshes import read_mesh
from meshreel.io.sequence import open_sequence
from meshreel.io.write import frame_names, make_folder, replacing, write_mesh
from meshreel.metrics.scene_accuracy import Scene, Sight
from meshreel.types import Mesh, evenly

from . import people, rooms
from .rooms import PROCEDURAL, ROOM3, SENSED


class Captured(DerivedSequence):
    """The frames of a recording or of point clouds, made as `meshreel capture` makes them where a folder lacks them."""

    def __init__(self, recording: Recording | Clouds, folder: Path) -> None:
        super().__init__(recording)
        make_folder(folder)
        for number, name in enumerate(frame_names(len(recording), "ply")):
            if not (folder / name).exists():
                write_mesh(recording[number], folder / name)
        self._meshes = open_sequence(folder)
        rig = recording.rig if isinstance(recording, Recording) else None
        self.cameras = () if rig is None else tuple(camera.view for camera in rig.cameras)

    def __getitem__(self, index: int) -> Mesh:
        return self._meshes[range(len(self))[index]]


SCENES = tuple(rooms.SPEEDS)
PEOPLE = "people"  # needs the extra of that name, and no benchmark data
TRUE, FOUND = "truth", "found"  # labels: those of the nearest clean faces, and those that the encoder finds
VOXEL = 0.03  # m, for the fusion of the procedural room, whose pictures are small (guess)
SPACING = 0.015  # m, of the grid of people in the procedural room, where sensors of full size see it


@dataclass(frozen=True, slots=True, eq=False)
class SceneData:
    """A captured scene with its truth."""

    name: str
    folder: Path  # where everything about it is kept
    meshes: Captured
    truth: Truth
    parts: rooms.Parts | None = None  # of the truth, where it has them by name

    def true(self, number: int) -> Scene:
        """Prepare a clean frame for measurements of other meshes; people are what moves, but for things with a name."""
        people = None if self.parts is None else self.parts.of_faces(number) > len(rooms.THINGS)
        frame, sights = self.truth[number], [Sight(c.view, *c.depth_range) for c in self.truth.cameras]
        return Scene(frame.mesh, frame.dynamic if people is None else people, sights, complete=True)

    def judged(self, number: int, source: str) -> Bool[np.ndarray, " F"]:
        """Return the labels of a frame without those of things at rest, which may be room already, or not yet."""
        if self.parts is None:
            return self.labels(number, source)
        parts, counts = self.parts.of_faces(number), rooms.moving_parts(self.parts.poses)[number]
        counts[0] = True  # the room
        counted = self._kept_labels(f"judged-{number:05}", self.truth[number].mesh, counts[parts], number)
        return self.labels(number, source)[counted]

    def labels(self, number: int, source: str = TRUE) -> Bool[np.ndarray, " F"]:
        """Return a mask of moving faces: those nearest to moving clean faces (`TRUE`), or found by the encoder."""
        if source == TRUE:
            clean = self.truth[number]
            return self._kept_labels(f"{TRUE}-{number:05}", clean.mesh, clean.dynamic, number)
        path = self.folder / "labels" / f"{_kept_as(source)}.npz"
        if not path.exists():
            found = segment(self.meshes)
            moving = {f"frame_{k:05}": np.packbits(found.moving(k, mesh)) for k, mesh in enumerate(self.meshes)}
            make_folder(path.parent)
            with replacing(path) as file:
                np.savez_compressed(file, allow_pickle=False, **moving)  # a bit a face
        with np.load(path, allow_pickle=False) as archive:
            bits = archive[f"frame_{number:05}"]
        return np.unpackbits(bits, count=len(self.meshes[number].faces)).astype(bool)

    def _kept_labels(self, name: str, clean: Mesh, labels: Bool[np.ndarray, " F"], number: int) -> np.ndarray:
        """Label the faces of a frame: each takes the label of the clean face nearest to its middle."""
        path = self.folder / "labels" / f"{name}.npy"
        if not path.exists():
            mesh = self.meshes[number]
            none = np.zeros(len(mesh.faces), bool)
            make_folder(path.parent)
            with replacing(path) as file:
                np.save(file, none if clean.is_empty else carried_labels(Surface(clean), labels, mesh))
        found: np.ndarray = np.load(path)
        return found

    def background(self, source: str = TRUE) -> Mesh:
        """Background fused over time from the rig's depth, as the encoder fuses it."""
        path = self.folder / "background" / f"depth-{_kept_as(source)}.ply"
        return _kept_mesh(path, lambda: self._fused(source))

    def decimated(self, number: int, share: float) -> Mesh:
        """A whole frame with this share of its faces."""
        path = self.folder / "decimated" / f"{share:g}-{number:05}.ply"
        mesh = self.meshes[number]
        return _kept_mesh(path, lambda: decimate_faces(mesh, round(share * len(mesh.faces))))

    def _fused(self, source: str) -> Mesh:
        depth, numbers = self.meshes.depth, evenly(len(self.meshes), FRAMES)
        assert depth is not None, "recordings have depth pictures"
        moments = (Moment(depth[k], self.meshes[k], ~self.labels(k, source)) for k in numbers)
        return fuse_still_depth(moments, FusionOptions().voxel)


class SceneFrames(DerivedSequence):
    """Some frames of a captured scene, which anchors may ask for its labels."""

    def __init__(self, scene: SceneData, numbers: Sequence[int]) -> None:
        super().__init__(scene.meshes, numbers=tuple(numbers))
        self.scene, self.in_scene = scene, tuple(numbers)


def open_scene(name: str, data: Path, cache: Path, frames: int | None = None) -> SceneData:
    """The first frames of a scene, made below `cache` where it is not there. InputError for missing data."""
    folder = cache / (name if frames is None else f"{name}-{frames}")
    rig, meshes = folder / "rig", folder / "meshes"
    if not (rig / RIG).exists():
        count = (people.FRAMES if name == PEOPLE else rooms.FRAMES) if frames is None else frames
        setting, room = SENSED.get(name, (rooms.PAPER, name))
        if name == PROCEDURAL:
            rooms.record_procedural(rig, demo_room.RoomOptions(count))
        elif name == PEOPLE:
            people.record_people(rig, count)
        elif room == PROCEDURAL:
            moments = demo_room.furnished_room(demo_room.RoomOptions(count, setting.rate, SPACING))
            simulate_rig(rig, moments, setting.cameras(*demo_room.BOX), setting.rate, setting.errors)
        elif room == ROOM3:
            rooms.Room3(count, setting=setting).record(rig)
        else:
            rooms.simulate_room(rig, data, room, count, setting)
    fusion = FusionOptions(VOXEL) if name == PROCEDURAL else FusionOptions()
    recording, _ = open_recording(rig, fusion, keep=False)
    return SceneData(name, folder, Captured(recording, meshes), read_truth(rig / TRUTH), rooms.read_parts(rig))


@cache
def _kept_as(source: str) -> str:
    """Cache name of the labels; for those that the encoder finds, it depends on the code of the segmentation."""
    if source != FOUND:
        return source
    digest = hashlib.sha256()
    for package in (segmenter, geometry):
        for path in sorted(path for folder in package.__path__ for path in Path(folder).glob("*.py")):
            digest.update(path.read_bytes())
    return f"{FOUND}-{digest.hexdigest()[:12]}"


def _kept_mesh(path: Path, make: Callable[[], Mesh]) -> Mesh:
    if not path.exists():
        make_folder(path.parent)
        write_mesh(make(), path)
    return read_mesh(path).mesh
