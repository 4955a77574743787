"""The room without the people: what stands still in many frames, fused over time (paper, section 3.2).

In: what does not move of some frames. Out: one mesh. Signed distances to each frame's surface are averaged, so noise
averages out; what people hide in one frame is there in others.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float64, Int64

from ..errors import InputError
from ..geometry.connected import connected_faces
from ..geometry.nearest import Surface
from ..geometry.topology import drop_unreferenced, face_normals, unique_edges
from ..geometry.tsdf import SIDE, extract, fill_grid
from ..geometry.voxels import Lattice, around, distinct, spread
from ..types import Mesh

_AT_BORDER = 1e-4  # a barycentric weight below it is on an edge


@dataclass(frozen=True, slots=True)
class BackgroundOptions:
    """How frames become one background."""

    frames: int = 10  # fused, at most, spread over the sequence
    reach: int = 2  # voxels on both sides of a surface that know their distance to it
    seen: float = 0.12  # share of the frames that must have surface somewhere
    fragment: float = 0.02  # m^2: connected pieces with less area are dropped
    coarse: float = 0.5  # RMS distance from the fused surface that decimation may cost, in RMS noise of a frame
    lattice: float = 1.0  # spacing of the lattice, in the same
    refresh: float | None = None  # s from one copy of the background in the file to the next; None: one for all

    def __post_init__(self) -> None:
        if not (self.coarse > 0 and self.lattice > 0 and (self.refresh is None or self.refresh > 0)):
            raise InputError(
                f"background: coarse {self.coarse:g}, lattice {self.lattice:g}, refresh {self.refresh} s: give above 0"
            )
        if self.frames < 1 or self.reach < 1 or not 0 <= self.seen < 1 or not 0 <= self.fragment < np.inf:
            raise InputError(
                f"background of {self.frames} frames, reach {self.reach}, seen {self.seen:g}, fragment "
                f"{self.fragment:g}: give >= 1, >= 1, 0 to below 1, and from 0 on"
            )


def fuse_background(frames: Iterable[Mesh], voxel: float, options: BackgroundOptions = BackgroundOptions()) -> Mesh:
    """The mean surface of meshes of one still scene, about a voxel (m) fine; one of them in memory at a time."""
    sums = _Sums(voxel, options.reach)
    count = 0
    for mesh in frames:
        sums.add(mesh)
        count += 1
    mesh = sums.surface(max(1, int(options.seen * count)))
    if mesh.is_empty:
        return mesh
    label = connected_faces(mesh.faces, len(mesh.vertices))
    areas = np.bincount(label, face_normals(mesh)[1])
    return drop_unreferenced(Mesh(mesh.vertices, mesh.faces[areas[label] >= options.fragment]))


class _Sums:
    """Distances of voxels near any surface so far: their sum, and of how many frames.

    Inside, coordinates are about an origin near the first surface: distances are float32, and scenes may be far away.
    """

    def __init__(self, voxel: float, reach: int) -> None:
        self._lattice, self._reach = Lattice(np.full(3, -voxel / 2), voxel), reach  # cells' middles are voxels
        self._origin: Float64[np.ndarray, " 3"] | None = None
        self._keys = np.zeros(0, np.int64)
        self._sums, self._counts = np.zeros(0), np.zeros(0, np.int32)

    def add(self, mesh: Mesh) -> None:
        """Takes in a frame."""
        if mesh.is_empty:
            return
        if self._origin is None:
            self._origin = Lattice.near(mesh, self._lattice.size).origin
        mesh = Mesh(mesh.vertices - self._origin, mesh.faces)
        keys = self._around(mesh)
        keys, distances = _signed(mesh, keys, self._lattice, self._reach * self._lattice.size)
        union = distinct(np.concatenate([self._keys, keys]))
        sums, counts = np.zeros(len(union)), np.zeros(len(union), np.int32)
        before, now = np.searchsorted(union, self._keys), np.searchsorted(union, keys)
        sums[before], counts[before] = self._sums, self._counts
        sums[now] += distances
        counts[now] += 1
        self._keys, self._sums, self._counts = union, sums, counts

    def surface(self, least: int) -> Mesh:
        """Where the mean distance is zero, among voxels that at least so many frames know."""
        if self._origin is None or not len(self._keys):
            return Mesh.empty()
        cells = self._lattice.cells(self._keys)
        inside, shared = cells % SIDE, Lattice(np.zeros(3), 1.0)
        keys, which = np.unique(shared.keys(cells // SIDE + 0.5), return_inverse=True)
        blocks, which = shared.cells(keys), which.reshape(-1)
        distances = np.zeros((len(blocks), SIDE, SIDE, SIDE), np.float32)
        weights = np.zeros_like(distances)
        at = (which, inside[:, 2], inside[:, 1], inside[:, 0])
        distances[at] = self._sums / self._counts / (self._reach * self._lattice.size)
        weights[at] = self._counts
        mesh = extract(fill_grid(self._lattice.size, blocks.astype(np.int32), distances, weights), least - 0.5)
        return Mesh(mesh.vertices + self._origin, mesh.faces)

    def _around(self, mesh: Mesh) -> Int64[np.ndarray, " N"]:
        """The voxels within reach of a surface, about."""
        return around(distinct(self._lattice.keys(spread(mesh, self._lattice.size)[0])), self._reach)


def _signed(
    mesh: Mesh, keys: Int64[np.ndarray, " N"], lattice: Lattice, most: float
) -> tuple[Int64[np.ndarray, " M"], Float64[np.ndarray, " M"]]:
    """The voxels not farther than `most` from a mesh, and their distances; not those beyond its borders."""
    points = lattice.centers(keys)
    surface = Surface(mesh)
    hits = surface.closest(points)
    away = points - hits.points
    along = (away * surface.normals[hits.faces]).sum(axis=1)
    distance = np.linalg.norm(away, axis=1)
    known = (distance <= most) & ~_beyond(mesh, hits.faces, hits.barycentric)
    return keys[known], np.where(along < 0, -distance, distance)[known]


def _beyond(
    mesh: Mesh, faces: Int64[np.ndarray, " N"], barycentric: Float64[np.ndarray, "N 3"]
) -> Bool[np.ndarray, " N"]:
    """Where the closest point of a face is on the mesh's border: what lies there is past the surface, not above it."""
    edges, face_edges = unique_edges(mesh.faces)
    border = np.bincount(face_edges.reshape(-1), minlength=len(edges)) == 1
    ends = np.zeros(len(mesh.vertices), bool)
    ends[edges[border].reshape(-1)] = True
    on_edge = border[face_edges[faces]] & (barycentric[:, [2, 0, 1]] < _AT_BORDER)
    on_corner = ends[mesh.faces[faces]] & (barycentric > 1 - _AT_BORDER)
    return on_edge.any(axis=1) | on_corner.any(axis=1)
