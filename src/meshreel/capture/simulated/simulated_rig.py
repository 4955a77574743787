"""Simulation of a rig (paper, 4.1): what cameras, with errors, would see of known meshes, and the truth beside it."""

from __future__ import annotations

import math
import operator
import zipfile
import zlib
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Bool, Float64, Int64, UInt8

from ...errors import InputError
from ...geometry.cameras import Camera, CameraPose
from ...geometry.drawing import draw
from ...geometry.strict import products
from ...geometry.threads import ahead
from ...geometry.topology import concatenate, face_normals
from ...io.files import read_file
from ...io.meshes import read_mesh
from ...io.write import make_folder, replacing, write_mesh, write_picture
from ...types import Mesh
from ..rig.cameras import DepthCamera, at_frame, posed
from ..rig.rig import read_cameras, write_rig
from .sensors import Depth, Point, SensorOptions, measured, mounted

Pixels = UInt8[np.ndarray, "H W 3"]
# Colours, 0 to 255, of places and the faces that they are on.
Painter = Callable[[Float64[np.ndarray, "N 3"], Int64[np.ndarray, " N"]], Float64[np.ndarray, "N 3"]]

TRUTH = "truth"  # folder of the clean meshes
LABELS = "dynamic.npz"  # file in that folder: for each frame, a bit per face of its mesh
_DAMAGED = (OSError, ValueError, EOFError, zipfile.BadZipFile, zlib.error, NotImplementedError, RuntimeError)
AMBIENT = 0.8  # of the light that comes from everywhere (guess)
LIGHT = (0.3, 0.9, 0.3)  # where the rest comes from, at first; it turns about the second axis (guess)
TURNS = 0.02  # of the light a frame, rad (guess)


@dataclass(frozen=True, slots=True)
class SceneFrame:
    """Clean mesh of one moment, with the faces that move."""

    mesh: Mesh
    dynamic: Bool[np.ndarray, " F"]
    paint: Painter | None = None  # the colours of places on it, where they are known
    is_lit: bool = False  # whether the colours have light and shade in them

    @staticmethod
    def of(still: Sequence[Mesh], moving: Sequence[Mesh]) -> SceneFrame:
        """Join still and moving parts into one mesh."""
        parts = [*still, *moving]
        faces = [len(part.faces) for part in parts]
        return SceneFrame(concatenate(parts), np.repeat(np.arange(len(parts)) >= len(still), faces))


def corner_cameras(low: Point, high: Point, width: int = 640, count: int = 4) -> tuple[DepthCamera, ...]:
    """Return cameras with the paper's view (75 x 65 degrees, 640 x 576 pixels) high up around a box's middle."""
    view = Camera(640, 576, (417.0, 452.0), (320.0, 288.0)).resized(width, round(0.9 * width))
    return mounted(DepthCamera("corner", view, depth_range=(0.25, 8.0)), low, high, count)


def simulate_rig(
    folder: Path,
    frames: Iterable[SceneFrame],
    cameras: tuple[DepthCamera, ...],
    frame_rate: float,
    sensor: SensorOptions = SensorOptions(),
    progress: Callable[[int], None] = lambda _done: None,
    color: ColorSensorOptions | None = None,
) -> int:
    """Write what the cameras measure of each frame, and the truth; return the number of frames.

    With `color`, each has a colour camera beside it, which sees frames that have a `paint`. Cameras with a path move;
    the errors of their recorded poses grow with time. `rig.json` is written last: a folder without it is incomplete.
    `progress` gets the number of finished frames.
    """
    places = [folder / camera.name / "depth" for camera in cameras]  # where `rig.json` will name them
    for place in (*places, folder / TRUTH):
        make_folder(place)
    labels = {}
    drawn = np.random.default_rng([sensor.seed, 1 << 29])
    eyes = [] if color is None else [SimulatedColor.beside(camera, color, drawn) for camera in cameras]
    for camera in cameras[: len(eyes)]:
        make_folder(folder / camera.name / "color")

    def written(numbered: tuple[int, SceneFrame]) -> UInt8[np.ndarray, " N"]:
        number, frame = numbered
        normals = face_normals(frame.mesh)[0]
        for which, (one, place) in enumerate(zip(cameras, places, strict=True)):
            camera, eye = at_frame(one, number), eyes[which].at(number) if which < len(eyes) else None
            random = np.random.default_rng([sensor.seed, number, which])
            clean = _cut_grazing(frame.mesh, normals, camera.view, sensor.grazing)
            write_picture(measured(clean, camera, sensor, random), place / f"depth_{number:05}.png")
            if eye is not None and frame.paint is not None:
                picture = eye.picture(frame.mesh, frame.paint, None if frame.is_lit else number, random)
                write_picture(picture, folder / camera.name / "color" / f"color_{number:05}.png")
        write_mesh(frame.mesh, folder / TRUTH / f"frame_{number:05}.ply")
        return np.packbits(frame.dynamic)

    for number, bits in enumerate(ahead(written, enumerate(frames))):
        labels[f"frame_{number:05}"] = bits
        progress(number + 1)
    with replacing(folder / TRUTH / LABELS) as file:
        np.savez_compressed(file, **labels)  # type: ignore[arg-type]  # NumPy 2.1 stores `allow_pickle=` as an array
    write_rig(folder / TRUTH, cameras, frame_rate)
    random = np.random.default_rng([sensor.seed, 1 << 30])
    wrong = []  # cameras with the errors of their calibration
    for camera in cameras:
        pose = turned(camera.view.pose.to_world, sensor.pose_error[1], random)
        pose[:3, 3] += sensor.pose_error[0] * random.standard_normal(3)
        path = _drifted(camera, sensor.pose_error, random)
        wrong.append(replace(posed(camera, path[min(path)].to_world if path else pose), path=path))
    described = [eye.record(f"{camera.name}/color", random) for camera, eye in zip(cameras, eyes, strict=False)]
    write_rig(folder, tuple(wrong), frame_rate, described)
    return len(labels)


def _drifted(camera: DepthCamera, error: tuple[float, float], random: np.random.Generator) -> dict[int, CameraPose]:
    """Return a camera's path as a tracker records it, with errors that grow to these deviations (m, degrees)."""
    count, turn, shift = len(camera.path), np.eye(4), np.zeros(3)
    found = dict[int, CameraPose]()
    for frame in sorted(camera.path):
        turn = turned(turn, error[1] / math.sqrt(count), random)
        shift = shift + error[0] / math.sqrt(count) * random.standard_normal(3)
        pose = camera.path[frame].to_world.copy()
        pose[:3, :3] = products(turn[:3, :3], pose[:3, :3])
        pose[:3, 3] += shift
        found[frame] = CameraPose.of_camera(pose)
    return found


def _cut_grazing(mesh: Mesh, normals: Float64[np.ndarray, "F 3"], camera: Camera, grazing: float) -> Depth:
    """Return the depth along the optical axis, infinite for a miss, and `grazing` degrees or more from the normal."""
    directions = camera.ahead @ camera.pose.to_world[:3, :3].T
    seen = draw(mesh, camera)
    depth, hit = seen.depth.astype(np.float64), seen.faces >= 0
    cosines, faces = np.zeros(depth.shape), seen.faces[hit]
    along = directions[hit] / np.linalg.norm(directions[hit], axis=1)[:, None]
    cosines[hit] = np.abs((normals[faces] * along).sum(axis=1))
    return np.where(cosines >= math.cos(math.radians(grazing)), depth, np.inf)


@dataclass(frozen=True, slots=True)
class Truth:
    """Clean frames of a simulated rig, with its true cameras."""

    paths: tuple[Path, ...]  # of the clean meshes
    packed: tuple[np.ndarray, ...]  # a bit per face, set if it moves; untrusted, checked frame by frame
    cameras: tuple[DepthCamera, ...]  # with their true poses
    frame_rate: float  # 1/s

    def only(self, numbers: Sequence[int]) -> Truth:
        """Return the truth of some of its frames, which are numbered anew."""
        cameras = tuple(
            replace(one, path={new: one.path[k] for new, k in enumerate(numbers)}) if one.path else one
            for one in self.cameras
        )
        return Truth(
            tuple(self.paths[k] for k in numbers), tuple(self.packed[k] for k in numbers), cameras, self.frame_rate
        )

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
    try:
        with np.load(BytesIO(read_file(folder / LABELS)), allow_pickle=False) as archive:
            labels = {name: archive[name] for name in archive.files}
    except _DAMAGED as error:
        raise InputError(f"{folder / LABELS}: labels cannot be read ({error}); simulate the rig again") from None
    if unlike := sorted(labels.keys() ^ paths.keys()):
        text = f"{len(paths)} clean meshes and labels of {len(labels)} frames, unlike in {unlike[0]}"
        raise InputError(f"{folder}: {text}; simulate the rig again")
    return Truth(tuple(paths.values()), tuple(labels[name] for name in paths), cameras, rate)


@dataclass(frozen=True, slots=True)
class ColorSensorOptions:
    """Errors of colour cameras."""

    scale: float = 2.0  # pixels of a colour picture's width for each of a depth picture's
    gain: float = 0.0  # standard deviation of a camera's exposure, as a share
    balance: float = 0.0  # the same of each channel's
    blur: float = 0.5  # pixels, standard deviation
    noise: float = 1.5  # levels of 255, standard deviation
    pose_error: float = 0.0  # degrees, standard deviation of the error in the rig's file

    def __post_init__(self) -> None:
        numbers = (self.gain, self.balance, self.blur, self.noise, self.pose_error)
        if not all(math.isfinite(value) and value >= 0 for value in numbers) or not 0.1 <= self.scale <= 16:
            raise InputError(f"color sensor {numbers}, scale {self.scale:g}: give numbers from 0 on, scale 0.1 to 16")


@dataclass(frozen=True, slots=True)
class SimulatedColor:
    """A colour camera with the eyes of a depth camera."""

    camera: DepthCamera  # with the size and the numbers of the colour pictures
    gains: Float64[np.ndarray, "3"]  # of the channels
    sensor: ColorSensorOptions

    @staticmethod
    def beside(depth: DepthCamera, sensor: ColorSensorOptions, random: np.random.Generator) -> SimulatedColor:
        """Return a camera in the place of a depth camera, with errors of its own."""
        width, height = (round(side * sensor.scale) for side in (depth.view.width, depth.view.height))
        camera = replace(depth, view=depth.view.resized(width, height))
        gains = np.exp(sensor.gain * random.standard_normal() + sensor.balance * random.standard_normal(3))
        return SimulatedColor(camera, gains, sensor)

    def at(self, frame: int) -> SimulatedColor:
        """Return the camera where it is in a frame."""
        return replace(self, camera=at_frame(self.camera, frame))

    def record(self, folder: str, random: np.random.Generator) -> dict[str, Any]:
        """Return the object of `rig.json` that describes it, with the error of its pose."""
        known = posed(self.camera, turned(self.camera.view.pose.to_world, self.sensor.pose_error, random)).record()
        names = ["width", "height", "fx", "fy", "cx", "cy"]
        names += [] if self.camera.path else ["camera_to_world"]  # else it moves as the depth camera beside it
        return {"folder": folder} | {name: known[name] for name in names}

    def picture(self, mesh: Mesh, paint: Painter, frame: int | None, random: np.random.Generator) -> Pixels:
        """Render a mesh as the camera sees it, on black, in the light of a frame, or None: paint is lit."""
        from scipy.ndimage import gaussian_filter

        camera = self.camera.view
        seen = draw(mesh, camera)
        rows, columns = np.nonzero(seen.faces >= 0)
        depth, faces = seen.depth[rows, columns].astype(np.float64), seen.faces[rows, columns].astype(np.int64)
        ahead = np.linalg.solve(camera.intrinsic, np.stack([columns + 0.5, rows + 0.5, np.ones(len(rows))])).T
        to_world = camera.pose.to_world
        points = products(ahead * depth[:, None], to_world[:3, :3].T) + to_world[:3, 3]
        image = np.zeros((*seen.faces.shape, 3))
        light = np.ones(len(faces)) if frame is None else shade_of(mesh, faces, frame)
        image[rows, columns] = paint(points, faces) * light[:, None] * self.gains
        image = np.stack([gaussian_filter(image[..., k], self.sensor.blur) for k in range(3)], axis=2)
        image += self.sensor.noise * random.standard_normal(image.shape)
        return np.clip(np.rint(image), 0, 255).astype(np.uint8)


def turned(pose: Float64[np.ndarray, "4 4"], degrees: float, random: np.random.Generator) -> Float64[np.ndarray, "4 4"]:
    """Return a pose that is wrong by a turn with this standard deviation."""
    from scipy.spatial.transform import Rotation

    wrong = pose.copy()
    wrong[:3, :3] = Rotation.from_rotvec(degrees * random.standard_normal(3), degrees=True).as_matrix() @ pose[:3, :3]
    return wrong


def shade_of(mesh: Mesh, faces: Int64[np.ndarray, " N"], frame: int) -> Float64[np.ndarray, " N"]:
    """Return the share of light that faces have in a frame; part of it turns about the second axis."""
    x, y, z = np.array(LIGHT) / np.linalg.norm(LIGHT)
    c, s = math.cos(TURNS * frame), math.sin(TURNS * frame)
    light = np.array([c * x + s * z, y, c * z - s * x])
    return AMBIENT + (1 - AMBIENT) * np.abs(face_normals(mesh)[0][faces] @ light)
