"""Simulation of a rig: depths that cameras would measure of known meshes, with sensor errors (paper, section 4.1).

Meshes of a scene frame by frame, and cameras -> a rig's folder, which `rig.py` reads, and beside it the truth: the
clean mesh of each frame and which of its faces move. Everything follows from the seed.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Bool, Float64, UInt16

from ...errors import InputError
from ...geometry.cameras import Camera, CameraPose, looking_at
from ...geometry.depth import depth_noise
from ...geometry.raycast import Rays
from ...geometry.topology import concatenate, face_normals
from ...io.depth_pictures import write_depth
from ...io.write import make_folder, replacing, write_mesh, write_picture
from ...types import Mesh
from ..rig.cameras import DepthCamera, posed
from ..rig.rig import RIG, write_rig
from .simulated_color import ColorSensorOptions, Painter, SimulatedColor, turned

TRUTH = "truth"  # folder of the clean meshes
LABELS = "dynamic.npz"  # file in that folder: for each frame, a bit per face of its mesh
DEEPEST = 65_535  # units, largest value of a 16-bit depth picture
JUMP = 0.05  # m between neighbouring pixels: where they are farther apart, flying pixels come up (guess)


@dataclass(frozen=True, slots=True)
class SensorOptions:
    """Errors of a depth camera."""

    noise: float = 0.4  # times `depth_noise`, standard deviation
    grazing: float = 80.0  # degrees between ray and normal above which nothing is measured
    holes: float = 0.002  # share of the pixels that measure nothing
    flying: float = 0.3  # share of the pixels beside a jump that measure a depth between both sides
    pose_error: tuple[float, float] = (0.0, 0.0)  # m, degrees: standard deviations of the errors in the rig's file
    seed: int = 0

    def __post_init__(self) -> None:
        good = all(math.isfinite(value) and value >= 0 for value in (self.noise, *self.pose_error))
        if not (good and 0 < self.grazing <= 90 and 0 <= self.holes <= 1 and 0 <= self.flying <= 1):
            raise InputError(f"{self}: give numbers from 0 on, degrees up to 90 and shares up to 1")


@dataclass(frozen=True, slots=True)
class SceneFrame:
    """Clean mesh of one moment, with the faces that move."""

    mesh: Mesh
    dynamic: Bool[np.ndarray, " F"]
    paint: Painter | None = None  # the colours of places on it, where they are known

    @staticmethod
    def of(still: Sequence[Mesh], moving: Sequence[Mesh]) -> SceneFrame:
        """Join still and moving parts into one mesh."""
        parts = [*still, *moving]
        faces = [len(part.faces) for part in parts]
        return SceneFrame(concatenate(parts), np.repeat(np.arange(len(parts)) >= len(still), faces))


def corner_cameras(
    low: Float64[np.ndarray, " 3"], high: Float64[np.ndarray, " 3"], width: int = 640, count: int = 4
) -> tuple[DepthCamera, ...]:
    """Return cameras with the paper's field of view (75 x 65 degrees) high up around a box, looking down at its middle.

    Pictures are 0.9 times as high as wide; those of the paper have 640 x 576 pixels.

    `low` and `high` are the box's corners, m; the cameras stand on an ellipse through its vertical edges, the first at
    45 degrees; y is up.
    """
    middle, half = (low + high) / 2, (high - low) / 2
    target = np.array([middle[0], low[1] + 0.4 * (high[1] - low[1]), middle[2]])
    cameras = []
    for number in range(count):
        angle = math.pi / 4 + 2 * math.pi * number / count
        across = math.sqrt(2) * half * (math.sin(angle), 0.0, math.cos(angle))
        eye = np.array([middle[0], low[1] + 0.9 * (high[1] - low[1]), middle[2]]) + across
        view = Camera(640, 576, (417.0, 452.0), (320.0, 288.0), CameraPose.of_camera(looking_at(eye, target)))
        resized = view.resized(width, round(0.9 * width))
        cameras.append(DepthCamera(f"corner{number}", resized, depth_range=(0.25, 8.0)))
    return tuple(cameras)


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

    With `color`, each has a colour camera beside it, which sees frames that have a `paint`.

    `rig.json` is written last: a folder without it is incomplete. `progress` gets the number of finished frames.
    """
    places = [folder / camera.name / "depth" for camera in cameras]  # where `rig.json` will name them
    for place in (*places, folder / TRUTH):
        make_folder(place)
    labels, count = {}, 0
    drawn = np.random.default_rng([sensor.seed, 1 << 29])
    eyes = [] if color is None else [SimulatedColor.beside(camera, color, drawn) for camera in cameras]
    for camera in cameras[: len(eyes)]:
        make_folder(folder / camera.name / "color")
    for number, frame in enumerate(frames):
        scene = _Rays(frame.mesh)
        for which, (camera, place) in enumerate(zip(cameras, places, strict=True)):
            random = np.random.default_rng([sensor.seed, number, which])
            write_depth(_measured(scene, camera, sensor, random), place / f"depth_{number:05}.png")
            if which < len(eyes) and frame.paint is not None:
                picture = eyes[which].picture(frame.mesh, frame.paint, number, random)
                path = folder / camera.name / "color" / f"color_{number:05}.png"
                write_picture(picture, path)
        write_mesh(frame.mesh, folder / TRUTH / f"frame_{number:05}.ply")
        labels[f"frame_{number:05}"] = np.packbits(frame.dynamic)
        count = number + 1
        progress(count)
    with replacing(folder / TRUTH / LABELS) as file:
        np.savez_compressed(file, **labels)  # type: ignore[arg-type]  # NumPy 2.1 stores `allow_pickle=` as an array
    with replacing(folder / TRUTH / RIG) as file:
        record = {"frames_per_second": frame_rate, "cameras": [camera.record() for camera in cameras]}
        file.write((json.dumps(record, indent=1) + "\n").encode())
    random = np.random.default_rng([sensor.seed, 1 << 30])
    wrong = tuple(_mistaken(camera, sensor, random) for camera in cameras)
    described = [eye.record(f"{camera.name}/color", random) for camera, eye in zip(cameras, eyes, strict=False)]
    write_rig(folder, wrong, frame_rate, described)
    return count


class _Rays:
    """A mesh prepared for ray casting."""

    def __init__(self, mesh: Mesh) -> None:
        self._normals = face_normals(mesh)[0]
        self._rays = Rays(mesh)

    def cast(self, camera: DepthCamera) -> tuple[Float64[np.ndarray, "H W"], Float64[np.ndarray, "H W"]]:
        """Return the depth along the optical axis, m, infinite for a miss, and the cosine between ray and normal."""
        to_world = camera.view.pose.to_world
        directions = camera.view.ahead @ to_world[:3, :3].T
        answer = self._rays.cast(to_world[None, :3, 3], directions.reshape(-1, 3))
        depth = answer.distances.reshape(directions.shape[:2])  # directions go one metre along the axis
        cosines = np.zeros(depth.shape)
        hit = np.isfinite(depth)
        faces = answer.faces.reshape(depth.shape)[hit]
        along = directions[hit] / np.linalg.norm(directions[hit], axis=1)[:, None]
        cosines[hit] = np.abs((self._normals[faces] * along).sum(axis=1))
        return depth, cosines


def _measured(
    scene: _Rays, camera: DepthCamera, sensor: SensorOptions, random: np.random.Generator
) -> UInt16[np.ndarray, "H W"]:
    depth, cosines = scene.cast(camera)
    depth = np.where(cosines >= math.cos(math.radians(sensor.grazing)), depth, np.inf)
    depth = _flown(depth, sensor, random)
    seen = np.isfinite(depth) & (random.random(depth.shape) >= sensor.holes)
    depth = np.where(seen, depth, 0.0)
    depth += sensor.noise * depth_noise(depth) * random.standard_normal(depth.shape)
    units = np.rint(depth / camera.depth_unit)
    return camera.in_range(np.where(seen & (units > 0) & (units <= DEEPEST), units, 0).astype(np.uint16))


def _flown(
    depth: Float64[np.ndarray, "H W"], sensor: SensorOptions, random: np.random.Generator
) -> Float64[np.ndarray, "H W"]:
    """Mix the depths of both sides at some pixels beside a jump (flying pixels)."""
    found = depth.copy()
    for axis in (0, 1):
        beside = np.roll(depth, 1, axis=axis)
        with np.errstate(invalid="ignore"):  # two misses side by side
            jumps = np.isfinite(depth) & np.isfinite(beside) & (np.abs(depth - beside) > JUMP)
        np.moveaxis(jumps, axis, 0)[0] = False  # the first row has no neighbour
        mixed = jumps & (random.random(depth.shape) < sensor.flying)
        share = random.random(depth.shape)
        found[mixed] = share[mixed] * depth[mixed] + (1 - share[mixed]) * beside[mixed]
    return found


def _mistaken(camera: DepthCamera, sensor: SensorOptions, random: np.random.Generator) -> DepthCamera:
    """Return the camera with the errors of its calibration."""
    apart, degrees = sensor.pose_error
    pose = turned(camera.view.pose.to_world, degrees, random)
    pose[:3, 3] += apart * random.standard_normal(3)
    return posed(camera, pose)
