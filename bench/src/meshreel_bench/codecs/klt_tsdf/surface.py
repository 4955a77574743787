"""The decoder's distances and their zero level. In -> out: blocks and symbols -> a mesh in voxel units.

Voxels that blocks share get the mean of their values. Marching cubes run over the cells of these blocks alone. All up
to the signs is in integers, so encoder and decoder see the same cells crossed on every platform.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float64, Int32, Int64

from meshreel.geometry.topology import drop_unreferenced
from meshreel.geometry.tsdf import Grid, extract
from meshreel.geometry.voxels import distinct
from meshreel.types import Mesh

from .basis import ONE
from .grid import POINTS, SIDE, block_keys, places_of, voxel_index
from .weights import LARGEST, STEP_ONE, Model, distances

_SURE = 3 * ONE * STEP_ONE  # three voxels: what is farther has no more of a vote
_BARELY = ONE * STEP_ONE // 64
_NEAR = ONE * STEP_ONE  # a voxel: what is farther from the zero level shows nowhere


@dataclass(frozen=True, slots=True)
class Field:
    """Distances at the voxels of a frame's blocks, never 0."""

    places: Int64[np.ndarray, "B 3"]
    keys: Int64[np.ndarray, " U"]  # of the voxels, sorted
    index: Int64[np.ndarray, "B N"]
    values: Float64[np.ndarray, " U"]  # whole multiples of 1 / (ONE STEP_ONE) voxels; that many


def field_of(places: Int64[np.ndarray, "B 3"], symbols: Int32[np.ndarray, "B M"], model: Model) -> Field:
    """The distances that the symbols of some blocks stand for."""
    keys, index = voxel_index(places)
    weights = np.clip(symbols.astype(np.float64) * model.step, -LARGEST, LARGEST)
    values = _mean(distances(weights, model.basis), index, len(keys))
    return Field(places, keys, index, _closed(places, keys, np.where(values == 0, 1.0, values)))


def _mean(values: Float64[np.ndarray, "B N"], index: Int64[np.ndarray, "B N"], count: int) -> Float64[np.ndarray, " U"]:
    """The mean of each voxel's values, rounded down."""
    flat = index.reshape(-1)
    return np.floor(np.bincount(flat, values.reshape(-1), count) / np.maximum(np.bincount(flat, minlength=count), 1))


def _closed(
    places: Int64[np.ndarray, "B 3"], keys: Int64[np.ndarray, " U"], values: Float64[np.ndarray, " U"]
) -> Float64[np.ndarray, " U"]:
    """The distances without surface that leaves the blocks by less than a voxel, which would end there in a hole.

    A block that is not there is on one side, that of its known voxels; others, if near, are put on this one.
    """
    voxels, owners = _outsiders(places, keys)
    if len(voxels) == 0:
        return values
    names, which = np.unique(owners, return_inverse=True)
    side = np.sign(np.bincount(which, np.clip(values[voxels], -_SURE, _SURE), len(names)))
    wanted = np.bincount(voxels, side[which], len(keys))
    turned = (wanted * values < 0) & (np.abs(values) < _NEAR)
    return np.where(turned, np.sign(wanted) * _BARELY, values)


def _outsiders(
    places: Int64[np.ndarray, "B 3"], keys: Int64[np.ndarray, " U"]
) -> tuple[Int64[np.ndarray, " P"], Int64[np.ndarray, " P"]]:
    """Each voxel, by number, beside each block without values that it belongs to, by key."""
    voxels, names = places_of(keys), block_keys(places)
    first = voxels % SIDE == 0
    pairs = [(np.zeros(0, np.int64), np.zeros(0, np.int64))]
    for back in np.indices((2, 2, 2)).reshape(3, -1).T:
        chosen = np.flatnonzero((first | (back == 0)).all(axis=1) & first.any(axis=1))
        owners = block_keys(voxels[chosen] // SIDE - back)
        missing = ~np.isin(owners, names)
        pairs.append((chosen[missing], owners[missing]))
    return np.concatenate([a for a, _ in pairs]), np.concatenate([b for _, b in pairs])


def crossed(field: Field, chosen: Bool[np.ndarray, " B"]) -> Int64[np.ndarray, "C 3"]:
    """The cells of the chosen blocks that the zero level passes through, sorted."""
    inside = (field.values < 0)[field.index[chosen]].reshape(-1, POINTS, POINTS, POINTS)
    count = np.zeros((len(inside), SIDE, SIDE, SIDE), np.int8)
    for x, y, z in np.indices((2, 2, 2)).reshape(3, -1).T:
        count += inside[:, x : x + SIDE, y : y + SIDE, z : z + SIDE]
    block, *cell = np.nonzero((count > 0) & (count < 8))  # corners on both sides
    cells = SIDE * field.places[chosen][block] + np.stack(cell, axis=1)
    return cells[np.argsort(block_keys(cells))]


def polygonize(field: Field) -> Mesh:
    """The zero level inside the blocks, in voxel units."""
    if len(field.places) == 0:
        return Mesh.empty()
    origin = SIDE * field.places.min(axis=0)  # float32 inside: near 0
    voxels = places_of(field.keys) - origin
    inside, owners = voxels % SIDE, block_keys(voxels // SIDE)
    keys = distinct(np.sort(owners))
    which = np.searchsorted(keys, owners)
    values = np.zeros((len(keys), SIDE, SIDE, SIDE), np.float32)
    known = np.zeros_like(values)
    at = (which, inside[:, 2], inside[:, 1], inside[:, 0])
    values[at] = field.values / (ONE * STEP_ONE)
    known[at] = 1.0
    mesh = extract(Grid.of(1.0, places_of(keys).astype(np.int32), values, known), 0.5)
    return Mesh(mesh.vertices + origin, mesh.faces)


def cells_of(mesh: Mesh) -> Int64[np.ndarray, " F"]:
    """The key of the cell that each face lies in."""
    return block_keys(np.floor(mesh.vertices[mesh.faces].mean(axis=1)).astype(np.int64))


def without(mesh: Mesh, cells: Int64[np.ndarray, "C 3"]) -> Mesh:
    """The mesh without the faces in some cells."""
    if len(cells) == 0:
        return mesh
    return drop_unreferenced(Mesh(mesh.vertices, mesh.faces[~np.isin(cells_of(mesh), block_keys(cells))]))
