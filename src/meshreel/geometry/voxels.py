"""A sparse lattice of cubic cells: the cell of a point, neighbouring cells, and points spread over faces.

The points are dense enough that hardly any cell crossed by a surface is missed.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float64, Int32, Int64

from .. import _core
from ..types import Mesh

_SIDE = 1 << 20  # cells along an axis, half of them on either side of the origin: three axes fit into a 64-bit key
_HALF = _SIDE // 2
_STRIDES = np.array([_SIDE * _SIDE, _SIDE, 1])
_STRIDE = 1 << 12  # cells between possible origins of a lattice, so that float32 resolves a cell finely (guess)
_MOST_PARTS = 512  # of a face's side: bounds memory for one giant face (guess)
_AROUND = np.array([d for d in itertools.product((-1, 0, 1), repeat=3) if any(d)])


@dataclass(frozen=True, slots=True)
class Lattice:
    """Lattice of cubic cells of one size; the key of a cell is an integer that orders cells by position."""

    origin: Float64[np.ndarray, " 3"]  # m, a corner of a cell
    size: float  # m

    @staticmethod
    def near(mesh: Mesh, size: float) -> Lattice:
        """Return the lattice of a mesh's scene: its origin is (0, 0, 0), unless that is far away."""
        if mesh.is_empty:
            return Lattice(np.zeros(3), size)
        place, stride = mesh.vertices[mesh.faces[0, 0]], _STRIDE * size
        return Lattice(stride * np.round(place / stride), size)

    def keys(self, points: Float64[np.ndarray, "N 3"]) -> Int64[np.ndarray, " N"]:
        """Return the key of each point's cell; points beyond the range of keys get a cell at its border."""
        cells = np.floor((points - self.origin) / self.size)
        return (np.clip(cells, 2 - _HALF, _HALF - 2).astype(np.int64) + _HALF) @ _STRIDES

    def cells(self, keys: Int64[np.ndarray, " P"]) -> Int64[np.ndarray, "P 3"]:
        """Return the integer coordinates of cells, counted from the origin along each axis."""
        return np.stack([keys // (_SIDE * _SIDE), keys // _SIDE % _SIDE, keys % _SIDE], axis=1) - _HALF

    def centers(self, keys: Int64[np.ndarray, " P"]) -> Float64[np.ndarray, "P 3"]:
        return self.origin + (self.cells(keys) + 0.5) * self.size


def moved(keys: Int64[np.ndarray, " P"], offset: Int64[np.ndarray, " 3"]) -> Int64[np.ndarray, " P"]:
    """Return the keys of the cells that lie `offset` cells away along each axis."""
    return keys + int(_STRIDES @ offset)


def distinct(keys: Int64[np.ndarray, " N"]) -> Int64[np.ndarray, " P"]:
    """Return the sorted distinct keys, as np.unique does, in a third of the time for millions of keys.

    Keys mostly come in sorted runs, and a stable sort merges these several times faster.
    """
    ordered = np.sort(keys, kind="stable")
    return ordered[np.concatenate([[True], ordered[1:] != ordered[:-1]])] if len(ordered) else ordered


def around(keys: Int64[np.ndarray, " P"]) -> Int64[np.ndarray, " Q"]:
    """Return the given cells and all cells beside one of them, also at an edge or a corner."""
    for axis in np.eye(3, dtype=np.int64):
        keys = distinct(np.concatenate([moved(keys, axis * step) for step in (-1, 0, 1)]))
    return keys


def contains(keys: Int64[np.ndarray, " P"], wanted: Int64[np.ndarray, " N"]) -> Bool[np.ndarray, " N"]:
    """Return a mask of the wanted keys that are among sorted keys, at least one; np.isin would sort both again."""
    return keys[np.minimum(np.searchsorted(keys, wanted), len(keys) - 1)] == wanted


def neighbours(keys: Int64[np.ndarray, " P"]) -> Int32[np.ndarray, "P 26"]:
    """Return, for each of the sorted cells, the indices of its 26 neighbours; its own index where one is missing."""
    table = np.empty((len(keys), len(_AROUND)), np.int32)
    numbers = np.arange(len(keys), dtype=np.int32)
    for column, offset in enumerate(_AROUND):
        wanted = moved(keys, offset)
        at = np.minimum(np.searchsorted(keys, wanted), max(len(keys) - 1, 0))
        table[:, column] = np.where(keys[at] == wanted, at, numbers) if len(keys) else numbers
    return table


def spread(mesh: Mesh, spacing: float) -> tuple[Float64[np.ndarray, "N 3"], Int64[np.ndarray, " N"]]:
    """Return points on a mesh at most about `spacing` apart, and their faces, ascending; every face has a point."""
    points, faces = _core.spread(mesh.vertices, mesh.faces, spacing, _MOST_PARTS)
    return points, faces.view(np.int64)  # NumPy has two types of this size
