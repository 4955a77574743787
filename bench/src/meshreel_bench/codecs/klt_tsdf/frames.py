"""A group of frames <-> bytes: each frame for itself, the entropy coder's models together.

Decoded surface that is not there in the original (past a border, where signs contradict each other, or few components
ripple) is left out: a bit for each block, and one for each crossed cell in the blocks that have such.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int32, Int64

from meshreel.geometry.closest_points import Surface
from meshreel.geometry.topology import drop_unreferenced
from meshreel.types import Mesh

from .basis import join, split
from .blocks import decode_bits, decode_places, decode_symbols, encode_bits, encode_places, encode_symbols
from .grid import prepared, sample
from .surface import VOXELS, Field, cells_at, crossed, field_of, polygonize
from .weights import Model, forward

_FAR = 1.5  # voxels from the surface beyond which decoded surface is left out
_PAST = 0.5  # voxels past a border


@dataclass(frozen=True, slots=True)
class Group:
    """The frames of a group as they travel."""

    places: list[Int64[np.ndarray, "_ 3"]]  # of each frame
    symbols: list[Int32[np.ndarray, "_ _"]]
    omitted: list[bytes]


def encode_group(meshes: Iterable[Mesh], model: Model, energies: Float64[np.ndarray, " M"]) -> bytes:
    """The bytes of some frames in voxel units, and of what mean square weights are expected."""
    group = Group([], [], [])
    for mesh in meshes:
        mesh = prepared(mesh)
        blocks = sample(mesh)
        symbols = forward(blocks, model, energies)
        group.places.append(blocks.places)
        group.symbols.append(symbols)
        group.omitted.append(_encode_omitted(mesh, field_of(blocks.places, symbols, model)))
    coded = encode_symbols(np.concatenate(group.symbols), group.places)
    return join([encode_places(group.places), coded, *group.omitted])


def decode_group(data: bytes, count: int, width: int) -> Group:
    """The group of `count` frames."""
    first, second, *omitted = split(data, 2 + count)
    places = decode_places(first, count)
    symbols = decode_symbols(second, places, width)
    return Group(places, np.split(symbols, np.cumsum([len(p) for p in places])[:-1]), omitted)


def decode_frame(group: Group, number: int, model: Model) -> Mesh:
    """A frame of a group, in voxel units."""
    field = field_of(group.places[number], group.symbols[number], model)
    (mesh, cells), omitted = polygonize(field), _decode_omitted(group.omitted[number], field)
    if not len(omitted):
        return mesh
    kept = np.ones(VOXELS * len(field.places), bool)
    kept[omitted] = False
    return drop_unreferenced(Mesh(mesh.vertices, mesh.faces[kept[cells]]))


def _encode_omitted(mesh: Mesh, field: Field) -> bytes:
    """Encode the blocks that omit surface, and their omitting cells; no bytes if there are none."""
    cells = _wrong(mesh, *polygonize(field))
    if len(cells) == 0:
        return b""
    chosen = np.zeros(len(field.places), bool)
    chosen[cells // VOXELS] = True
    seen = crossed(field, chosen)
    return join([encode_bits(chosen, field.places), encode_bits(np.isin(seen, cells), cells_at(seen, field))])


def _decode_omitted(data: bytes, field: Field) -> Int64[np.ndarray, " C"]:
    """The numbers of the cells that are left out."""
    if not data:
        return np.zeros(0, np.int64)
    first, second = split(data, 2)
    cells = crossed(field, decode_bits(first, field.places))
    return cells[decode_bits(second, cells_at(cells, field))]


def _wrong(mesh: Mesh, decoded: Mesh, cells: Int64[np.ndarray, " F"]) -> Int64[np.ndarray, " C"]:
    """The numbers of the cells, of those of the faces, most of whose decoded faces are where the mesh is not."""
    if decoded.is_empty or mesh.is_empty:
        return np.zeros(0, np.int64)
    middles = decoded.vertices[decoded.faces].mean(axis=1)
    surface = Surface(mesh)
    hits = surface.closest(middles)
    away = middles - hits.points
    squared = np.einsum("nd,nd->n", away, away)
    along = np.einsum("nd,nd->n", away, surface.normals[hits.faces])
    past = surface.past_border(hits) & (squared - along**2 > _PAST**2)
    numbers, index = np.unique(cells, return_inverse=True)
    share = np.bincount(index, past | (squared > _FAR**2)) / np.bincount(index)
    return numbers[share > 0.5]
