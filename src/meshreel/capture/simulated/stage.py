"""The demo's scene: a woman walks into a room of three walls and waves, a child jumps; y is up, m, the floor at 0."""

from __future__ import annotations

import operator
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cache, partial
from pathlib import Path

import numpy as np
from jaxtyping import Float64, Int32, Int64

from ...geometry.threads import mapped
from ...geometry.topology import blend, vertex_normals
from ...types import Mesh
from ..rig.cameras import DepthCamera
from .acting import stances
from .dress import CHILD, WOMAN, Look, dressed_colors
from .parlour import Thing, furniture
from .person import Build, person
from .procedural import check_length
from .sculpture import depths, meshed
from .simulated_rig import ColorSensorOptions, SceneFrame, SensorOptions, corner_cameras, simulate_rig
from .skeleton import Shares, Stance, carried, weights
from .solid_colors import Colors, Points

WIDTH = 256  # pixels of a depth picture: the demo takes a minute or two (guess)
COLOR_SCALE = 1.5  # of a colour picture's width to that of depth (guess)
NOISE, COLOR_NOISE = 0.3, 1.0  # of the sensors, see `SensorOptions` and `ColorSensorOptions` (guess)
VOXEL = 0.02  # m, for the fusion of such pictures: with 0.03, fingers and folds are lost (seen)
BOX = np.array([[-1.6, 0.0, -1.3], [1.6, 2.45, 1.75]])  # m, of the cameras: inside the walls (guess)
SPACING, FACES = 0.005, 24_000  # m, of the lattice of a person of an adult's size, and faces that are left (guess)
# The woman and the child: build and colours (guess).
CAST = ((Build(size=0.97), WOMAN), (Build(0.68, head=1.27, is_child=True, sleeve=0.17, trouser=0.55), CHILD))
KEY = np.array([0.458, 0.598, 0.658])  # where a lamp is, a unit vector (guess)
# Distances, m, and weights by which what is near a place hides the sky there (guess).
HIDDEN = ((0.006, 0.30), (0.012, 0.20), (0.018, 0.13))

Faces = Int64[np.ndarray, " N"]
Amounts = Float64[np.ndarray, " N"]


@dataclass(frozen=True, slots=True)
class StageOptions:
    """Length of the demo's scene, and the seed of what its sensors measure."""

    frames: int = 40
    frame_rate: float = 20.0  # 1/s
    seed: int = 0  # of the sensors' errors

    def __post_init__(self) -> None:
        check_length(self.frames, self.frame_rate)


@dataclass(frozen=True, slots=True)
class Actor:
    """A person in the still pose, and what stays the same in every stance."""

    build: Build
    look: Look
    mesh: Mesh
    shares: Shares
    sky: Float64[np.ndarray, " V"]  # share of the light from everywhere that reaches a vertex

    @staticmethod
    def of(build: Build, look: Look) -> Actor:
        """Return a person as meshed from its parts."""
        parts = person(build)
        mesh = meshed(parts, SPACING, FACES)
        normals, sky = vertex_normals(mesh), np.ones(len(mesh.vertices))
        for far, weight in HIDDEN:
            sky -= weight * np.clip(1 - depths(parts, mesh.vertices + far * normals) / far, 0, 1)
        return Actor(build, look, mesh, weights(mesh), sky)

    def posed(self, stance: Stance) -> Mesh:
        """Return the person in a stance."""
        return carried(self.mesh, self.shares, self.build, stance)

    def colors(self, posed: Mesh, points: Points, faces: Faces) -> Colors:
        """Return the colours, in the light, of places on faces of the posed mesh."""
        corners = self.mesh.faces[faces]
        inside = _barycentric(posed, corners, points)
        normals = blend(vertex_normals(posed), corners, inside)
        normals /= np.maximum(np.sqrt((normals * normals).sum(axis=1)), 1e-9)[:, None]
        colors = dressed_colors(self.build, self.look, blend(self.mesh.vertices, corners, inside))
        return _lit(colors, normals, (self.sky[corners] * inside).sum(axis=1))


@dataclass(frozen=True, slots=True)
class Stage:
    """Clean frames of the demo's scene, each made when it is asked for."""

    options: StageOptions
    still: tuple[Thing, ...]
    cast: tuple[Actor, ...]

    def __len__(self) -> int:
        return self.options.frames

    def __iter__(self) -> Iterator[SceneFrame]:
        return (self[number] for number in range(len(self)))

    def __getitem__(self, index: int) -> SceneFrame:
        people = self.people(range(len(self))[operator.index(index)])
        still = [thing.mesh for thing in self.still]
        parts = np.repeat(np.arange(len(still) + len(people)), [len(mesh.faces) for mesh in (*still, *people)])
        return replace(SceneFrame.of(still, people), paint=partial(self._colors, people, parts), is_lit=True)

    def people(self, number: int) -> list[Mesh]:
        """Return the closed meshes of a frame's people; faces stay from frame to frame."""
        now = stances(number / self.options.frame_rate)
        return [actor.posed(stance) for actor, stance in zip(self.cast, now, strict=True)]

    def _colors(self, people: list[Mesh], parts: Int64[np.ndarray, " F"], points: Points, faces: Faces) -> Colors:
        """Return the colours of places on faces of a frame, of which `parts` are things or, after these, people."""
        colors, part = np.empty((len(points), 3)), parts[faces]
        for number, thing in enumerate(self.still):
            colors[part == number] = thing.paint(points[part == number])
        on_floor = (part == 0) & (points[:, 1] < 1e-3)
        for number, (actor, mesh) in enumerate(zip(self.cast, people, strict=True), len(self.still)):
            colors[on_floor] *= _shadow(mesh, points[on_floor])[:, None]
            first = int(np.searchsorted(parts, number))
            some = part == number
            colors[some] = actor.colors(mesh, points[some], faces[some] - first)
        return np.clip(colors, 0, 255)


def stage(options: StageOptions | None = None) -> Stage:
    """Return the demo's scene; the same options give the same frames."""
    return Stage(options or StageOptions(), furniture(), _cast())


def record_stage(
    folder: Path, options: StageOptions, width: int = WIDTH, progress: Callable[[int], None] = lambda _done: None
) -> None:
    """Write what four depth cameras measure, and the truth; `progress` gets the number of finished frames."""
    sensor, cameras = SensorOptions(noise=NOISE, seed=options.seed), stage_cameras(width)
    color = ColorSensorOptions(scale=COLOR_SCALE, noise=COLOR_NOISE)
    simulate_rig(folder, stage(options), cameras, options.frame_rate, sensor, progress, color)


def stage_cameras(width: int = WIDTH) -> tuple[DepthCamera, ...]:
    """Return depth cameras in the corners that look down at the middle; pictures of `width` x 0.9 `width` pixels."""
    return corner_cameras(BOX[0], BOX[1], width)


@cache
def _cast() -> tuple[Actor, ...]:
    return tuple(mapped(Actor.of, *zip(*CAST, strict=True)))


def _barycentric(mesh: Mesh, corners: Int32[np.ndarray, "N 3"], points: Points) -> Float64[np.ndarray, "N 3"]:
    """Return the weights of a face's corners at a place on it."""
    a, b, c = (mesh.vertices[corners[:, k]] for k in range(3))
    normal = np.cross(b - a, c - a)
    area = np.maximum((normal * normal).sum(axis=1), 1e-18)
    second = (np.cross(points - a, c - a) * normal).sum(axis=1) / area
    third = (np.cross(b - a, points - a) * normal).sum(axis=1) / area
    found = np.clip(np.stack([1 - second - third, second, third], axis=1), 0, 1)
    return found / found.sum(axis=1)[:, None]


def _lit(colors: Colors, normals: Points, sky: Amounts) -> Colors:
    """Return colours in the warm light of a soft lamp, and in cooler light from everywhere, most from above."""
    lamp = 0.42 * np.clip(0.35 + 0.65 * np.einsum("nd,d->n", normals, KEY), 0, 1) * (0.5 + 0.5 * sky)
    around = 0.62 * sky * (0.8 + 0.2 * normals[:, 1])
    return colors * (around[:, None] * (0.97, 0.99, 1.04) + lamp[:, None] * (1.04, 1.0, 0.94))


def _shadow(mesh: Mesh, points: Points) -> Amounts:
    """Return the share of light that a person leaves to the floor: less where the body stands and close to feet."""
    heights = mesh.vertices[:, 1]
    lowest = float(heights.min())
    soles = mesh.vertices[heights < lowest + 0.10]
    body = mesh.vertices.mean(axis=0) - 0.25 * KEY
    away = ((points - body)[:, [0, 2]] ** 2).sum(axis=1)
    some = soles[:: max(len(soles) // 24, 1), [0, 2]]
    gaps = ((points[:, None, [0, 2]] - some) ** 2).sum(axis=2).min(axis=1)
    near = np.exp(-gaps / (0.055 + lowest) ** 2) / (2 + 16 * max(lowest, 0.0))
    return (1 - 0.16 * np.exp(-away / 0.34**2)) * (1 - near)
