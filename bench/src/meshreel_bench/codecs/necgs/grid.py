"""Placement of the grids of frames, and truncated signed distances of a mesh at their points.

Inside is where the winding number is above 1/2; close to a sheet, which has no inside on either side, such as the wall
of a room, it is behind the sheet. The decoder trims the flips of sign past the border of a sheet.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float32, Float64, Int, Int32

from meshreel.errors import InputError
from meshreel.geometry.closest_points import Hits, Surface
from meshreel.geometry.inside import winding_numbers
from meshreel.geometry.topology import border_edges, face_normals, weld
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
        self.has_sheets = not self._closed and self._many_are_sheets()

    def inside(self, points: Float64[np.ndarray, "N 3"], hits: Hits) -> Bool[np.ndarray, " N"]:
        """Return which points are inside a body or behind the sheet that is closest to them."""
        sheet = np.zeros(len(points), bool)  # untrimmed, one loose face would turn all behind it into inside
        if self.has_sheets:
            asked, which = np.unique(hits.faces, return_inverse=True)
            sheet = self._sheets(asked)[which]
        behind = np.einsum("nd,nd->n", points - hits.points, self.surface.normals[hits.faces]) < 0
        behind[~sheet] = self._enclosed(points[~sheet])
        return behind

    def _enclosed(self, points: Float64[np.ndarray, "N 3"]) -> Bool[np.ndarray, " N"]:
        """Return which points are in a body; a closed mesh may have all its faces turned inwards."""
        numbers = winding_numbers(self.surface.mesh, points)
        return (np.abs(numbers) if self._closed else numbers) > 0.5

    def _many_are_sheets(self) -> bool:
        """Return whether sheets are more than `SHEETS` of the area, by a sample of the faces."""
        some = np.arange(0, len(self.surface.mesh.faces), max(1, len(self.surface.mesh.faces) // _ASKED))
        areas = self.surface.areas[some]
        return bool(areas[self._sheets(some)].sum() > SHEETS * areas.sum())

    def _sheets(self, faces: Int[np.ndarray, " N"]) -> Bool[np.ndarray, " N"]:
        """Return which faces have no inside on either side."""
        mesh = self.surface.mesh
        middles, offsets = mesh.vertices[mesh.faces[faces]].mean(axis=1), _PROBE * self.surface.normals[faces]
        return ~(self._enclosed(middles - offsets) | self._enclosed(middles + offsets))
