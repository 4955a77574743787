"""The demo's scene: a woman and a child in a room of three walls that is open at the front; y up, m, the floor at 0."""

from __future__ import annotations

import operator
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
from jaxtyping import Float64, Int64

from ...geometry.topology import blend, concatenate, vertex_normals
from ...types import Mesh
from ..rig.cameras import DepthCamera
from .acting import at
from .parlour import Thing, things
from .procedural import check_frames
from .dress import CHILD, WOMAN, Look, dressed_colors
from .person import Build, parts
from .sculpture import depths, meshed
from .simulated_rig import ColorSensorOptions, SceneFrame, SensorOptions, corner_cameras, simulate_rig
from .skeleton import Stance, carried, weights
from .solid_colors import Colors, Points

WIDTH = 256  # pixels of a depth picture (guess)
VOXEL = 0.03  # m, for the fusion of such pictures (guess)
FACES = 24_000  # of a person's surface (guess)
SPACING = 0.005  # m, of the lattice of an adult's surface (guess)
BUILDS = (Build(0.97), Build(0.68, 1.27, True, False, 0.17, 0.55))
LOOKS = (WOMAN, CHILD)
KEY = np.array([0.46, 0.60, 0.66])  # where the light comes from


@dataclass(frozen=True)
class Actor:
    """A person in the still pose, and what stays the same in every pose."""

    build: Build
    look: Look
    mesh: Mesh
    shares: np.ndarray
    open: np.ndarray  # "V": share of the sky that a vertex sees

    @staticmethod
    def of(build: Build, look: Look) -> Actor:
        solid = parts(build)
        mesh = meshed(solid, SPACING, FACES)
        normals = vertex_normals(mesh)
        dark = np.zeros(len(mesh.vertices))
        for far, share in ((0.006, 0.9), (0.012, 0.6), (0.018, 0.4)):
            reached = depths(solid, (mesh.vertices + far * normals).astype(np.float32)).astype(float)
            dark += share * np.clip(1 - reached / far, 0, 1)
        return Actor(build, look, mesh, weights(build, mesh), 1 - np.clip(0.33 * dark, 0, 0.6))

    def posed(self, stance: Stance) -> Mesh:
        return carried(self.mesh, self.shares, self.build, stance)

    def colors(self, posed: Mesh, points: Points, faces: np.ndarray) -> Colors:
        """Return the lit colours of places on the posed mesh."""
        corners = self.mesh.faces[faces]
        inside = barycentric(posed, corners, points)
        still = blend(self.mesh.vertices, corners, inside)
        normals = blend(vertex_normals(posed), corners, inside)
        normals /= np.maximum(np.sqrt((normals * normals).sum(axis=1)), 1e-9)[:, None]
        sky = np.einsum("nk,nk->n", self.open[corners], inside)
        colors = dressed_colors(self.build, self.look, still)
        return lit(colors, normals, sky)


def barycentric(mesh: Mesh, corners: np.ndarray, points: Points) -> np.ndarray:
    a, b, c = (mesh.vertices[corners[:, k]] for k in range(3))
    normal = np.cross(b - a, c - a)
    area = np.maximum((normal * normal).sum(axis=1), 1e-18)
    v = (np.cross(points - a, c - a) * normal).sum(axis=1) / area
    w = (np.cross(b - a, points - a) * normal).sum(axis=1) / area
    found = np.clip(np.stack([1 - v - w, v, w], axis=1), 0, 1)
    return found / found.sum(axis=1)[:, None]


def lit(colors: Colors, normals: np.ndarray, sky: np.ndarray) -> Colors:
    """Return colours under a soft, warm light from the front, the right and above, and cooler light from the sky."""
    key = KEY / np.sqrt((KEY * KEY).sum())
    direct = np.clip(0.35 + 0.65 * (normals @ key), 0, 1)
    light = 0.62 * sky * (0.8 + 0.2 * normals[:, 1])
    return colors * (light[:, None] * (0.97, 0.99, 1.04) + 0.42 * (direct * (0.5 + 0.5 * sky))[:, None] * (1.04, 1.0, 0.94))


@dataclass(frozen=True, slots=True)
class StageOptions:
    """Length of the demo's scene."""

    frames: int = 40
    frame_rate: float = 20.0  # 1/s
    seed: int = 0  # of the sensors' noise

    def __post_init__(self) -> None:
        check_frames(self.frames, self.frame_rate, 0.03)


@dataclass(frozen=True, slots=True)
class Stage:
    """Clean frames of the demo's scene."""

    options: StageOptions
    still: tuple[Thing, ...]
    actors: tuple[Actor, ...]

    @staticmethod
    def of(options: StageOptions) -> Stage:
        return Stage(options, tuple(things()), tuple(map(Actor.of, BUILDS, LOOKS)))

    def __len__(self) -> int:
        return self.options.frames

    def __iter__(self) -> Iterator[SceneFrame]:
        return (self[number] for number in range(len(self)))

    def __getitem__(self, index: int) -> SceneFrame:
        number = range(len(self))[operator.index(index)]
        people = self.people(number)
        still = [thing.mesh for thing in self.still]
        firsts = np.cumsum([0, *(len(mesh.faces) for mesh in (*still, *people))])
        frame = SceneFrame.of(still, people)
        return replace(frame, paint=partial(self._colors, people, firsts), is_lit=True)

    def people(self, number: int) -> list[Mesh]:
        """Return the closed meshes of a frame's people."""
        stances = at(number / self.options.frame_rate)
        return [actor.posed(stance) for actor, stance in zip(self.actors, stances, strict=True)]

    def _colors(self, people: list[Mesh], firsts: np.ndarray, points: Points, faces: np.ndarray) -> Colors:
        colors, part = np.empty((len(points), 3)), np.searchsorted(firsts, faces, side="right") - 1
        for number, thing in enumerate(self.still):
            some = part == number
            colors[some] = thing.paint(points[some])
        ground = part == 0
        for mesh in people:
            colors[ground] *= shadow(mesh, points[ground])[:, None]
        for number, (actor, mesh) in enumerate(zip(self.actors, people, strict=True), len(self.still)):
            some = part == number
            colors[some] = actor.colors(mesh, points[some], faces[some] - firsts[number])
        return np.clip(colors, 0, 250)


def shadow(mesh: Mesh, points: Points) -> np.ndarray:
    """Return the share of light that a person leaves to places on the floor: soft round the feet and behind the body."""
    share = np.ones(len(points))
    floor = points[:, 1] < 0.004
    low = mesh.vertices[:, 1] < mesh.vertices[:, 1].min() + 0.10
    height = float(mesh.vertices[:, 1].min())
    places = [(mesh.vertices.mean(axis=0) - 0.25 * KEY, 0.16, 0.34)]
    middle = np.median(mesh.vertices[low, 0])
    del middle
    feet = mesh.vertices[low]
    places += [(feet[:: max(len(feet) // 24, 1)], 0.5 / (1 + 8 * max(height, 0)), 0.055 + height)]
    near = points[floor][:, [0, 2]]
    body, strength, wide = places[0]
    dark = strength * np.exp(-(((near - body[[0, 2]]) ** 2).sum(axis=1)) / wide**2)
    soles, strength, wide = places[1]
    gaps = ((near[:, None] - soles[None][:, :, [0, 2]]) ** 2).sum(axis=2).min(axis=1)
    share[floor] = (1 - dark) * (1 - strength * np.exp(-gaps / wide**2))
    return share


BOX = np.array([[-1.6, 0.0, -1.3], [1.6, 2.45, 1.75]])  # m, of the cameras (guess)


def stage_cameras(width: int = 320) -> tuple[DepthCamera, ...]:
    return corner_cameras(BOX[0], BOX[1], width)


def record_stage(
    folder: Path, options: StageOptions, width: int = WIDTH, progress: Callable[[int], None] = lambda _done: None
) -> None:
    """Write what four depth cameras measure, and the truth; `progress` gets the number of finished frames."""
    sensor, cameras = SensorOptions(noise=0.3, seed=options.seed), stage_cameras(width)
    color = ColorSensorOptions(scale=1.5, noise=1.0)
    simulate_rig(folder, Stage.of(options), cameras, options.frame_rate, sensor, progress, color)
