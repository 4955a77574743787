"""Sequences with new connectivity in every frame, as captures have it, or side by side; shapes that move rigidly.

Remeshing, with the frame's number as the seed: midpoint subdivision, vertices moved along the surface, QEM, vertices
and faces in a random order.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float64, Int64

from meshreel.geometry.closest_points import Surface
from meshreel.geometry.decimate import decimate
from meshreel.geometry.derived_sequences import DerivedSequence
from meshreel.geometry.topology import concatenate, edge_lengths, subdivide_midpoint, unique_edges, vertex_normals
from meshreel.io.meshes import read_mesh
from meshreel.io.write import write_mesh
from meshreel.types import Frames, Mesh, MeshList, MeshSequence

# m, added to the coordinates; a row for each frame, where it moves
Place = tuple[float, float, float] | Float64[np.ndarray, "T 3"]


@dataclass(frozen=True, slots=True)
class RemeshOptions:
    """Options of remeshing a frame."""

    vertices: int = 10_000  # about this number is kept
    levels: int = 1  # midpoint subdivisions before the jitter
    jitter: float = 0.35  # largest move of a vertex along the surface, of its shortest edge


def remeshed(source: MeshSequence, folder: Path | None, options: RemeshOptions) -> DerivedSequence:
    """Return the frames, remeshed when they are asked for; a folder keeps them as PLY files."""
    if folder is not None:
        folder.mkdir(parents=True, exist_ok=True)

    def frame(frames: MeshSequence, number: int) -> Mesh:
        if folder is None:
            return remesh(frames[number], number, options)
        path = folder / f"{options.vertices}-{options.levels}-{options.jitter:g}-{number:05}.ply"
        if not path.exists():
            write_mesh(remesh(frames[number], number, options), path)
        return read_mesh(path, str(path)).mesh

    return DerivedSequence(source, frame)


class SideBySide(Frames):
    """A frame has the frames of all bodies, each at its place, as long as the shortest; the rate is the first one's."""

    def __init__(self, bodies: Sequence[tuple[MeshSequence, Place]]) -> None:
        """At least one."""
        self._bodies = tuple(bodies)
        self.frame_rate = bodies[0][0].frame_rate

    def __len__(self) -> int:
        return min(len(body) for body, _ in self._bodies)

    def __getitem__(self, index: int) -> Mesh:
        number = range(len(self))[index]
        frames = ((body[number], np.atleast_2d(place)) for body, place in self._bodies)
        return concatenate([Mesh.of(mesh.vertices + way[number % len(way)], mesh.faces) for mesh, way in frames])


def remesh(mesh: Mesh, seed: int, options: RemeshOptions) -> Mesh:
    """The same surface with other vertices and faces; coordinates are float32 numbers, so that files keep them."""
    if mesh.is_empty:
        return mesh
    random = np.random.default_rng(seed)
    middle = mesh.vertices.mean(axis=0)
    local = Mesh.of(mesh.vertices - middle, mesh.faces)  # closest points are found in float32
    fine = subdivide_midpoint(local, options.levels)
    moved = fine.vertices + _tangential(fine, random) * options.jitter
    small = decimate(Mesh.of(Surface(local).closest(moved).points, fine.faces), options.vertices)
    mesh = _shuffled(Mesh.of(small.vertices + middle, small.faces), random)
    return Mesh.of(mesh.vertices.astype(np.float32), mesh.faces)


def _tangential(mesh: Mesh, random: np.random.Generator) -> Float64[np.ndarray, "V 3"]:
    """A random vector in the tangent plane of each vertex, as long as its shortest edge at most."""
    edges, lengths = unique_edges(mesh.faces)[0], edge_lengths(mesh)
    shortest = np.full(len(mesh.vertices), np.inf)
    np.minimum.at(shortest, edges.ravel(), np.repeat(lengths, 2))
    shortest[np.isinf(shortest)] = 0  # no face uses it
    offsets = random.uniform(-1, 1, (len(mesh.vertices), 3))
    normals = vertex_normals(mesh)
    offsets -= np.einsum("vd,vd->v", offsets, normals)[:, None] * normals
    return offsets / np.maximum(np.linalg.norm(offsets, axis=1), 1)[:, None] * shortest[:, None]


def _shuffled(mesh: Mesh, random: np.random.Generator) -> Mesh:
    """Vertices, faces and each face's first corner in a random order; faces keep their orientation."""
    order = random.permutation(len(mesh.vertices))
    faces = np.argsort(order)[mesh.faces][random.permutation(len(mesh.faces))]
    first = random.integers(0, 3, (len(faces), 1))
    return Mesh.of(mesh.vertices[order], np.take_along_axis(faces, (first + np.arange(3)) % 3, axis=1))


FRAMES = 24
TEETH = (24, 16)  # of the two gears
MODULE = 0.01  # m: diameter of the pitch circle over the number of teeth
PRESSURE = np.radians(20)  # of the flanks, the usual angle of involute gears
ADDENDUM, DEDENDUM = 1.0, 1.25  # height of a tooth above and below the pitch circle, in modules: the usual ones
BORE, WIDTH = 0.25, 0.04  # radius of the bore over that of the pitch circle; thickness, m
FLANK, RINGS, LAYERS = 8, 12, 6  # points of a flank, of a side face from the bore to the teeth, and of the thickness
TURN = 0.25  # of the first gear's pitch of teeth, in a frame
PRISM_SIDES, PRISM_TURN = 5, np.radians(4)  # a frame


def gears(frames: int = FRAMES) -> MeshList:
    """Return two gears that drive each other: two pieces in contact, but for a hair, of 20k vertices in all."""
    (first, faces), (second, more) = map(_gear, TEETH)
    place = np.array([MODULE * sum(TEETH) / 2, 0.0, 0.0])
    facing = np.pi + np.pi / TEETH[1]  # a gap of the second gear is where a tooth of the first one is
    meshes = []
    for number in range(frames):
        turn = 2 * np.pi * TURN * number  # of a pitch of teeth
        wheels = (first @ _about_z(turn / TEETH[0]).T, second @ _about_z(facing - turn / TEETH[1]).T + place)
        meshes.append(concatenate([Mesh.of(wheels[0], faces), Mesh.of(wheels[1], more)]))
    return MeshList(tuple(meshes))


def prism(frames: int = FRAMES) -> MeshList:
    """Return a five-sided prism of 10 vertices that turns about an axis that is none of its own."""
    n = PRISM_SIDES
    ring = _on_circle(2 * np.pi * np.arange(n) / n)
    vertices = np.concatenate([np.column_stack([ring, np.full(n, z)]) for z in (-1.0, 1.0)])
    at = np.arange(n)
    sides = [(at, (at + 1) % n, at + n), ((at + 1) % n, (at + 1) % n + n, at + n)]
    lid = np.column_stack([np.full(n - 2, 0), at[1:-1], at[2:]])
    faces = np.concatenate([*(np.column_stack(corners) for corners in sides), lid[:, ::-1], lid + n])
    tilted = vertices @ np.array([[1.0, 0.0, 0.0], [0.0, 0.6, -0.8], [0.0, 0.8, 0.6]])
    return MeshList(tuple(Mesh.of(tilted @ _about_z(PRISM_TURN * k).T, faces) for k in range(frames)))


def _gear(teeth: int) -> tuple[Float64[np.ndarray, "V 3"], Int64[np.ndarray, "F 3"]]:
    """Return an involute gear about the z axis, with the middle of a tooth at angle 0: a closed grid, as of a torus."""
    outline = _outline(teeth)
    evenly = 2 * np.pi * (np.arange(len(outline)) - FLANK + 0.5) / len(outline)  # 0 between the two points of a tip
    bore = BORE * MODULE * teeth / 2 * _on_circle(evenly)
    shares, heights = np.linspace(0, 1, RINGS), np.linspace(-WIDTH / 2, WIDTH / 2, LAYERS)
    out, up = np.stack([shares, np.full(RINGS, heights[0])], axis=1), np.stack([np.ones(LAYERS), heights], axis=1)
    section = np.concatenate([out, up[1:], (out * (1, -1))[-2::-1], (up * (0, -1))[1:-1]])  # once around, from the bore
    share, height = section[:, 0, None, None], section[:, 1, None]
    ring = bore + share * (outline - bore)
    vertices = np.concatenate([ring, np.broadcast_to(height[..., None], (*ring.shape[:2], 1))], axis=2)
    grid = np.arange(len(section) * len(outline)).reshape(len(section), len(outline))
    right, above = np.roll(grid, -1, axis=1), np.roll(grid, -1, axis=0)
    beyond = np.roll(right, -1, axis=0)
    faces = np.concatenate([np.stack([grid, right, beyond], axis=-1), np.stack([grid, beyond, above], axis=-1)])
    return vertices.reshape(-1, 3), faces.reshape(-1, 3)


def _outline(teeth: int) -> Float64[np.ndarray, "P 2"]:
    """Return the outline of an involute gear, counterclockwise, `2 * FLANK` points a tooth."""
    pitch = MODULE * teeth / 2
    radii = np.linspace(pitch - DEDENDUM * MODULE, pitch + ADDENDUM * MODULE, FLANK)
    steep = np.arccos(np.minimum(pitch * np.cos(PRESSURE) / radii, 1))  # 0 below the base circle: flanks are radial
    at_pitch = np.pi / (2 * teeth) + np.tan(PRESSURE) - PRESSURE
    half = at_pitch - np.tan(steep) + steep  # angle from the middle of a tooth to its flank
    flanks = np.concatenate([np.stack([radii, -half], axis=1), np.stack([radii, half], axis=1)[::-1]])
    middles = 2 * np.pi * np.arange(teeth) / teeth
    radius, angle = np.tile(flanks[:, 0], teeth), (middles[:, None] + flanks[:, 1]).ravel()
    return radius[:, None] * _on_circle(angle)


def _on_circle(angles: Float64[np.ndarray, " P"]) -> Float64[np.ndarray, "P 2"]:
    return np.stack([np.cos(angles), np.sin(angles)], axis=1)


def _about_z(angle: float) -> Float64[np.ndarray, "3 3"]:
    cos, sin = np.cos(angle), np.sin(angle)
    return np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
