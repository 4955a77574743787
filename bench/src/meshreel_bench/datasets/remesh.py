"""Sequences made of captured ones: with new connectivity in every frame, as captures have it, or side by side.

In -> out: frames on one list of faces -> frames that share nothing but their surface. Per frame, with its number as
the seed: midpoint subdivision, vertices moved along the surface, QEM, vertices and faces in a random order.
"""

from __future__ import annotations

import operator
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float64

from meshreel.geometry.closest_points import Surface
from meshreel.geometry.decimate import decimate
from meshreel.geometry.derived_sequences import DerivedSequence
from meshreel.geometry.topology import concatenate, subdivide_midpoint, unique_edges, vertex_normals
from meshreel.io.meshes import read_mesh
from meshreel.io.write import write_mesh
from meshreel.types import Frames, Mesh, MeshSequence

# m, added to the coordinates; a row for each frame, where it moves
Place = tuple[float, float, float] | Float64[np.ndarray, "T 3"]


@dataclass(frozen=True, slots=True)
class RemeshOptions:
    """Settings that give each frame its own connectivity."""

    vertices: int = 10_000  # about this number is kept
    levels: int = 1  # midpoint subdivisions before the jitter
    jitter: float = 0.35  # largest move of a vertex along the surface, of its shortest edge


class RemeshedSequence(DerivedSequence):
    """The frames of a sequence, remeshed when they are asked for; a folder keeps them as PLY files."""

    def __init__(self, source: MeshSequence, folder: Path | None = None, options: RemeshOptions = RemeshOptions()):
        super().__init__(source)
        self._folder, self._options = folder, options
        if folder is not None:
            folder.mkdir(parents=True, exist_ok=True)

    def __getitem__(self, index: int) -> Mesh:
        number = range(len(self))[operator.index(index)]
        if self._folder is None:
            return remesh(self.source[number], number, self._options)
        o = self._options
        path = self._folder / f"{o.vertices}-{o.levels}-{o.jitter:g}-{number:05}.ply"
        if not path.exists():
            write_mesh(remesh(self.source[number], number, o), path)
        return read_mesh(path, str(path)).mesh


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


def remesh(mesh: Mesh, seed: int, options: RemeshOptions = RemeshOptions()) -> Mesh:
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
    edges, _ = unique_edges(mesh.faces)
    lengths = np.linalg.norm(mesh.vertices[edges[:, 0]] - mesh.vertices[edges[:, 1]], axis=1)
    shortest = np.full(len(mesh.vertices), np.inf)
    for end in range(2):
        np.minimum.at(shortest, edges[:, end], lengths)
    shortest[np.isinf(shortest)] = 0  # no face uses it
    offsets = random.uniform(-1, 1, (len(mesh.vertices), 3))
    normals = vertex_normals(mesh)
    offsets -= np.einsum("vd,vd->v", offsets, normals)[:, None] * normals
    return offsets / np.maximum(np.linalg.norm(offsets, axis=1), 1)[:, None] * shortest[:, None]


def _shuffled(mesh: Mesh, random: np.random.Generator) -> Mesh:
    """Vertices, faces and each face's first corner in a random order; faces keep their orientation."""
    order = random.permutation(len(mesh.vertices))
    rank = np.empty_like(order)
    rank[order] = np.arange(len(order))
    faces = rank[mesh.faces][random.permutation(len(mesh.faces))]
    first = random.integers(0, 3, (len(faces), 1))
    return Mesh.of(mesh.vertices[order], np.take_along_axis(faces, (first + np.arange(3)) % 3, axis=1))
