"""The decoder's distances and their zero level. In -> out: blocks and symbols -> a mesh in voxel units.

All blocks of a frame in one pass. Voxels that blocks share get the mean of their values; marching cubes run over the
cells of these blocks alone. All up to the signs is in integers, so that encoder and decoder see the same cells crossed
on every platform.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Int32, Int64

from meshreel.geometry.voxels import distinct, moved
from meshreel.types import Mesh

from ..necgs.volumes import cases_of, cut
from .components import LARGEST, ONE, STEP_ONE, Model, distances
from .grid import OFFSETS, POINTS, SIDE, VOLUME, block_keys

_SURE = 3 * ONE * STEP_ONE  # three voxels: what is farther has no more of a vote
_BARELY = ONE * STEP_ONE // 64
_MOST = 1 << 27  # of a distance, 8 voxels: eight of these fit in 32 bits
_NEAR = ONE * STEP_ONE  # a voxel: what is farther from the zero level shows nowhere
_HIGH = np.indices((2, 2, 2)).reshape(3, -1).T  # from a block to those that have some of its voxels as their first ones
VOXELS = SIDE**3  # voxels of a block that are no other's


@dataclass(frozen=True, slots=True)
class Field:
    """Distances at the voxels of a frame's blocks, never 0."""

    places: Int64[np.ndarray, "B 3"]
    values: Int32[np.ndarray, "B P P P"]  # whole multiples of 1 / (ONE STEP_ONE) voxels; that many
    voxels: Int32[np.ndarray, "B P P P"]  # their numbers, the same in all blocks that share one


def field_of(places: Int64[np.ndarray, "B 3"], symbols: Int32[np.ndarray, "B M"], model: Model) -> Field:
    """The distances that the symbols of some sorted blocks stand for."""
    weights = np.clip(symbols.astype(np.float64) * model.step, -LARGEST, LARGEST)
    whole = distances(weights, model.basis)
    values = np.clip(whole, -_MOST, _MOST, out=whole).astype(np.int32).reshape(-1, POINTS, POINTS, POINTS)
    keys = block_keys(places)
    owners = distinct(np.concatenate([moved(keys, high) for high in _HIGH]))  # blocks that voxels are first ones of
    total, counts = (np.zeros((len(owners), SIDE, SIDE, SIDE), kind) for kind in (np.int32, np.int8))
    voxels, inner = np.empty(values.shape, np.int32), np.arange(VOXELS, dtype=np.int32).reshape(counts.shape[1:])
    for high in _HIGH:
        at = np.searchsorted(owners, moved(keys, high))
        there, here = (at, *_first(high)), (slice(None), *(slice(SIDE, None) if h else slice(SIDE) for h in high))
        total[there] += values[here]
        counts[there] += 1
        voxels[here] = VOXELS * at[:, None, None, None] + inner[_first(high)]
    shared = counts > 1
    total[shared] //= counts[shared]  # the mean, rounded down
    total[total == 0] = 1
    return Field(places, _closed(keys, owners, total, counts > 0).reshape(-1)[voxels], voxels)


def _first(high: Int64[np.ndarray, " 3"]) -> tuple[slice, slice, slice]:
    """The first of an owner's voxels along some axes, all of them along the others."""
    x, y, z = (slice(1) if h else slice(None) for h in high)
    return x, y, z


def _closed(
    keys: Int64[np.ndarray, " B"],
    owners: Int64[np.ndarray, " O"],
    values: Int32[np.ndarray, "O S S S"],
    known: Bool[np.ndarray, "O S S S"],
) -> Int32[np.ndarray, "O S S S"]:
    """Return distances without surface that leaves the blocks by less than a voxel, which would end there in a hole.

    A block that is not there is on one side, that of its known voxels; others, if near, are put on this one.
    """
    beside = list[tuple[tuple[np.ndarray, slice, slice, slice], np.ndarray]]()
    for back in _HIGH:
        names = moved(owners, -back)
        rows = np.flatnonzero(~np.isin(names, keys, assume_unique=True))
        beside.append(((rows, *_first(back)), names[rows]))
    absent = distinct(np.concatenate([names for _, names in beside]))
    votes, wanted = np.zeros(len(absent)), np.zeros(values.shape, np.int8)
    for at, names in beside:
        vote = np.where(known[at], np.clip(values[at], -_SURE, _SURE), 0).sum(axis=(1, 2, 3))
        votes += np.bincount(np.searchsorted(absent, names), vote, len(absent))
    for at, names in beside:
        wanted[at] += np.sign(votes)[np.searchsorted(absent, names)].astype(np.int8)[:, None, None, None]
    turned = known & ((wanted < 0) != (values < 0)) & (wanted != 0) & (np.abs(values) < _NEAR)
    values[turned] = np.where(wanted[turned] < 0, -_BARELY, _BARELY)
    return values


def crossed(field: Field, chosen: Bool[np.ndarray, " B"]) -> Int64[np.ndarray, " C"]:
    """The numbers of the cells of the chosen blocks that the zero level passes through, sorted by their places."""
    cells = np.flatnonzero(cases_of(field.values[chosen]) - np.uint8(1) < 254)  # 0 and 255 are not crossed
    cells += VOXELS * (np.flatnonzero(chosen) - np.arange(chosen.sum()))[cells // VOXELS]
    return cells[np.argsort(block_keys(cells_at(cells, field)))]


def polygonize(field: Field) -> tuple[Mesh, Int64[np.ndarray, " F"]]:
    """The zero level inside the blocks, in voxel units, and the number of each face's cell."""
    found, values = cut(field.values, field.voxels), field.values.reshape(-1)
    low, high = values[found.low], values[found.high]
    block, inner = np.divmod(found.low, VOLUME)
    vertices = (SIDE * field.places[block] + OFFSETS[inner]).astype(np.float64)
    axis = np.argmax(OFFSETS[found.high - VOLUME * block] != OFFSETS[inner], axis=1)
    vertices[np.arange(len(low)), axis] += low / (low - high)
    return Mesh.of(vertices, found.faces), found.cells


def cells_at(cells: Int64[np.ndarray, " C"], field: Field) -> Int64[np.ndarray, "C 3"]:
    """The places of cells."""
    block, cell = np.divmod(cells, VOXELS)
    return SIDE * field.places[block] + np.stack([cell >> 6, cell >> 3 & 7, cell & 7], axis=1)
