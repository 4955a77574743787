"""TSDF-Def volumes (NeCGS, section 3.1): grids around frames, distances of a mesh, surfaces by marching cubes.

Inside is where the winding number is above 1/2; close to a sheet, which has no inside on either side, such as the wall
of a room, it is behind the sheet. The decoder trims the flips of sign past the border of a sheet. On a face with four
crossings each inside corner is cut off alone, in both cubes of the face: the surface has no holes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from typing import Any

import numpy as np
from jaxtyping import Bool, Float32, Float64, Int, Int8, Int32, Int64, UInt8

from meshreel.errors import InputError
from meshreel.geometry.closest_points import Hits, Surface
from meshreel.geometry.inside import winding_numbers
from meshreel.geometry.topology import border_edges, drop_unreferenced, face_normals, weld
from meshreel.types import Mesh

TRUNCATION = 2.0  # cells at which a distance becomes 1, as in the authors' code
MARGIN = 2  # cells between the largest frame and the sides of its grid; a guess
FARTHEST = 1 << 30  # cells between two frames, at most
SHEETS = 0.05  # share of a mesh's area from which sheets are kept and trimmed; a guess
_BLOCK = 4  # points along a side of a block that has one sign where no surface is near
_PROBE = 0.02  # cells before and behind a face
_ASKED = 20_000  # faces in the sample that shows whether there are sheets


@dataclass(frozen=True, slots=True)
class Placement:
    """One grid per frame with cells of one size; grids move by whole cells, so that still surface stays the same."""

    cell: float  # m
    anchor: tuple[float, float, float]  # m, middle of the grid of a frame without a shift
    shifts: Int32[np.ndarray, "T 3"]  # cells

    def inverse(self, mesh: Mesh, frame: int, resolution: int) -> Mesh:
        """Convert a frame from metres to cells of its grid."""
        return Mesh((mesh.vertices - self._origin(frame, resolution)) / self.cell, mesh.faces)

    def forward(self, mesh: Mesh, frame: int, resolution: int) -> Mesh:
        """Convert a frame from cells to metres."""
        return Mesh(mesh.vertices * self.cell + self._origin(frame, resolution), mesh.faces)

    def _origin(self, frame: int, resolution: int) -> Float64[np.ndarray, " 3"]:
        return np.array(self.anchor) + self.cell * (self.shifts[frame] - (resolution - 1) / 2)


Box = tuple[Float64[np.ndarray, " 3"], Float64[np.ndarray, " 3"]]  # lowest and highest corner


def box_of(mesh: Mesh) -> Box | None:
    """Return the box of a mesh's faces; None if it has none."""
    if mesh.is_empty:
        return None
    used = mesh.vertices[np.unique(mesh.faces)]
    return used.min(axis=0), used.max(axis=0)


def place_grids(boxes: Sequence[Box | None], resolution: int) -> Placement:
    """Return grids that hold the box of every frame; the grid of an empty frame is at the anchor."""
    full = [box for box in boxes if box is not None]
    if not full:
        return Placement(1.0, (0.0, 0.0, 0.0), np.zeros((len(boxes), 3), np.int32))
    side = max(float((high - low).max()) for low, high in full)
    cell = max(side, 1e-9) / (resolution - 1 - 2 * MARGIN)
    anchor = (full[0][0] + full[0][1]) / 2
    middles = np.array([anchor if box is None else (box[0] + box[1]) / 2 for box in boxes])
    shifts = np.rint((middles - anchor) / cell)
    if np.abs(shifts).max() > FARTHEST:
        raise InputError(f"frames {np.abs(shifts).max() * cell:g} m apart in cells of {cell:g} m; code them by parts")
    return Placement(cell, (float(anchor[0]), float(anchor[1]), float(anchor[2])), shifts.astype(np.int32))


def truncated_distances(mesh: Mesh, resolution: int) -> tuple[Float32[np.ndarray, "K K K"], bool]:
    """Return distances of a mesh in cells, -1 to 1 for `TRUNCATION` cells, and whether it has sheets to trim."""
    solid = Mesh(mesh.vertices, mesh.faces[face_normals(mesh)[1] > 0])  # zero areas break the winding number's tree
    if solid.is_empty:
        return np.ones((resolution,) * 3, np.float32), False
    signs = _Signs(solid)
    blocks = np.indices((resolution // _BLOCK,) * 3).reshape(3, -1).T * _BLOCK
    offsets = np.indices((_BLOCK,) * 3).reshape(3, -1).T
    middles = blocks + (_BLOCK - 1) / 2
    hits = signs.surface.closest(middles)
    away = np.linalg.norm(hits.points - middles, axis=1)
    near = away <= TRUNCATION + np.sqrt(3) * (_BLOCK - 1) / 2
    values = np.repeat(np.where(signs.inside(middles, hits), -1.0, 1.0)[:, None], _BLOCK**3, axis=1)
    points = (blocks[near, None] + offsets).reshape(-1, 3).astype(np.float64)
    hits = signs.surface.closest(points)
    distances = np.linalg.norm(hits.points - points, axis=1) * np.where(signs.inside(points, hits), -1.0, 1.0)
    values[near] = np.clip(distances / TRUNCATION, -1, 1).reshape(-1, _BLOCK**3)
    count = resolution // _BLOCK
    grid = values.reshape((count,) * 3 + (_BLOCK,) * 3).transpose(0, 3, 1, 4, 2, 5)
    return grid.reshape((resolution,) * 3).astype(np.float32), signs.has_sheets


class _Signs:
    """Inside and outside of a mesh without faces of zero area."""

    def __init__(self, mesh: Mesh) -> None:
        self.surface = Surface(mesh)
        self._closed = not len(border_edges(weld(mesh)))
        some = np.arange(0, len(mesh.faces), max(1, len(mesh.faces) // _ASKED))  # a sample
        areas = self.surface.areas[some]
        self.has_sheets = not self._closed and bool(areas[self._sheets(some)].sum() > SHEETS * areas.sum())

    def inside(self, points: Float64[np.ndarray, "N 3"], hits: Hits) -> Bool[np.ndarray, " N"]:
        """Return a mask of points inside a body or behind the closest sheet."""
        sheet = np.zeros(len(points), bool)  # untrimmed, one loose face would turn all behind it into inside
        if self.has_sheets:
            asked, which = np.unique(hits.faces, return_inverse=True)
            sheet = self._sheets(asked)[which]
        behind = np.einsum("nd,nd->n", points - hits.points, self.surface.normals[hits.faces]) < 0
        behind[~sheet] = self._enclosed(points[~sheet])
        return behind

    def _enclosed(self, points: Float64[np.ndarray, "N 3"]) -> Bool[np.ndarray, " N"]:
        """Return a mask of points inside a body; a closed mesh may have all its faces turned inwards."""
        numbers = winding_numbers(self.surface.mesh, points)
        return (np.abs(numbers) if self._closed else numbers) > 0.5

    def _sheets(self, faces: Int[np.ndarray, " N"]) -> Bool[np.ndarray, " N"]:
        """Return a mask of faces without an inside on either side."""
        mesh = self.surface.mesh
        middles, offsets = mesh.vertices[mesh.faces[faces]].mean(axis=1), _PROBE * self.surface.normals[faces]
        return ~(self._enclosed(middles - offsets) | self._enclosed(middles + offsets))


REACH = 0.5  # cells that a deformation of 1 moves a point, so that cells do not fold over
STEEP = 0.8  # change along an edge, of which a surface has half: a flip of sign far from any surface


@dataclass(frozen=True, slots=True)
class Cut:
    """Topology of the surface of grids of points; V vertices on edges of a grid."""

    low: Int64[np.ndarray, " V"]  # flat number of the edge's first point
    high: Int64[np.ndarray, " V"]  # of its second point, one further along an axis
    faces: Int32[np.ndarray, "F 3"]  # counter-clockwise from outside
    cells: Int64[np.ndarray, " F"]  # flat number of each face's cell


def extract(volume: Float32[np.ndarray, "K K K 4"], trimmed: bool) -> Mesh:
    """Return the mesh of a TSDF-Def volume, in cells; `trimmed` leaves out flips of sign far from any surface."""
    resolution, flat = len(volume), volume.reshape(-1, 4).astype(np.float64)
    found = cut(volume[None, ..., 0])
    vertices = place(flat[found.low], flat[found.high], *(grid_points(n, resolution) for n in (found.low, found.high)))
    faces = found.faces
    if trimmed:
        steep = np.abs(flat[found.low, 0] - flat[found.high, 0]) > STEEP
        faces = faces[~steep[faces].any(axis=1)]
    return drop_unreferenced(Mesh.of(vertices, faces))


def place(low: Any, high: Any, first: Any, second: Any) -> Any:
    """Return vertices on edges, cells, from V x 4 values and V x 3 places of both ends; NumPy arrays or tensors."""
    share = (low[:, 0] / (low[:, 0] - high[:, 0]))[:, None]
    return (1 - share) * (first + REACH * low[:, 1:]) + share * (second + REACH * high[:, 1:])


def grid_points(numbers: Int64[np.ndarray, " N"], resolution: int) -> Float64[np.ndarray, "N 3"]:
    """Return the places of grid points with given flat numbers, cells."""
    return np.stack(np.unravel_index(numbers, (resolution,) * 3), axis=1).astype(np.float64)


def cut(values: np.ndarray, voxels: Int32[np.ndarray, "B P P P"] | None = None) -> Cut:
    """Return the edges where the sign changes in B blocks of P x P x P points, and the faces between these.

    `voxels` are the points' numbers, one for all blocks that share a point; without, none is shared.
    """
    side, cases = values.shape[1], cases_of(values)
    strides = np.array([side**2, side, 1])
    cells = np.flatnonzero(cases - np.uint8(1) < 254)  # 0 and 255 are not cut
    edges = triangles_of_cases()[cases[cells]]
    used = edges[..., 0] >= 0
    cells, edges = np.repeat(cells, used.sum(axis=1)), edges[used]
    block, cell = np.divmod(cells, (side - 1) ** 3)
    x, y, z = np.unravel_index(cell, (side - 1,) * 3)
    corners = (side**3 * block + side**2 * x + side * y + z).astype(np.int32)
    starts, axes = ((np.array(EDGES) @ way).astype(np.int32) for way in ([1, 0], [0, 1]))
    lows = corners[:, None] + (np.array(CORNERS) @ strides).astype(np.int32)[starts][edges]
    keys = 3 * (lows if voxels is None else voxels.reshape(-1)[lows]) + axes[edges]
    found = np.full(3 * (values.size if voxels is None else int(voxels.max(initial=-1)) + 1), -1, np.int32)
    found[keys] = lows
    made = np.flatnonzero(found >= 0)
    low = found[made].astype(np.int64)
    found[made] = np.arange(len(made), dtype=np.int32)
    return Cut(low, low + strides[made % 3], found[keys], cells)


def cases_of(values: np.ndarray) -> UInt8[np.ndarray, " C"]:
    """Return the inside corners of each cell of B x P x P x P points, as bits in the order of `CORNERS`."""
    inside = (values < 0).view(np.uint8)
    pairs = inside[:, :-1] | inside[:, 1:] << np.uint8(1)
    fours = pairs[:, :, :-1] | pairs[:, :, 1:] << np.uint8(2)
    return (fours[..., :-1] | fours[..., 1:] << np.uint8(4)).reshape(-1)


CORNERS = [(n & 1, n >> 1 & 1, n >> 2) for n in range(8)]
EDGES = [(n, axis) for axis in range(3) for n in range(8) if not n >> axis & 1]  # first corner, axis
_RINGS = [(axis, [0, 1 << (axis + 1) % 3, 7 ^ 1 << axis, 1 << (axis + 2) % 3]) for axis in range(3)]
# Corners of the six faces, counter-clockwise from outside.
SIDES = [side for axis, ring in _RINGS for side in (ring[::-1], [corner | 1 << axis for corner in ring])]


@cache
def triangles_of_cases() -> Int8[np.ndarray, "N T 3"]:
    """Return the triangles of each case (bit n: corner n is inside) as numbers of `EDGES`, filled up with -1."""
    cases = [_triangles(case) for case in range(256)]
    table = np.full((256, max(map(len, cases)), 3), -1, np.int8)
    for case, triangles in enumerate(cases):
        table[case, : len(triangles)] = np.reshape(triangles, (-1, 3))
    return table


def _triangles(case: int) -> list[tuple[int, int, int]]:
    """Return the loops of the surface on the cube's faces, each as a fan; bit n of `case`: corner n is inside."""
    following = dict(step for side in SIDES for step in _steps(side, case))
    triangles = []
    while following:
        loop = [min(following)]
        while (edge := following.pop(loop[-1])) != loop[0]:
            loop.append(edge)
        triangles += [(loop[0], a, b) for a, b in pairwise(loop[1:])]
    return triangles


def _steps(side: list[int], case: int) -> list[tuple[int, int]]:
    """Return the first and the last edge of each run of inside corners around a face."""
    crossed = []
    for a, b in zip(side, side[1:] + side[:1], strict=True):
        if (case >> a ^ case >> b) & 1:
            crossed.append((EDGES.index((min(a, b), (a ^ b).bit_length() - 1)), bool(case >> b & 1)))
    if crossed and not crossed[0][1]:
        crossed = crossed[1:] + crossed[:1]
    return [(crossed[n][0], crossed[n + 1][0]) for n in range(0, len(crossed), 2)]
