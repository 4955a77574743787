"""Entropy coding of what a group says: which blocks hold surface, their symbols, what is left out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from jaxtyping import Bool, Int32, Int64

from meshreel.coding.entropy import Neighbours, decode_weights, encode_weights
from meshreel.errors import InputError
from meshreel.format.kinds import Array, Rest, Varint
from meshreel.format.records import pack, unpack, unpack_all

from .basis import join, split
from .grid import block_keys

MOST_PLACES = 1 << 19  # of a group's box: 1024 cells along its diagonal need no more
_AROUND = np.array([(x, y, z) for x in (-1, 0, 1) for y in (-1, 0, 1) for z in (-1, 0, 1) if (x, y, z) < (0, 0, 0)])


@dataclass(frozen=True, slots=True)
class Total:
    """Size of a group; a Box follows where it is not 0."""

    blocks: Annotated[int, Varint(), "of all frames"]


@dataclass(frozen=True, slots=True)
class Box:
    """The box around the blocks of a group, and which of its places they are."""

    corners: Annotated[tuple[int, ...], Array(6, Varint()), "lowest place, 2n or -2n - 1, and length, by axis"]
    streams: Annotated[bytes, Rest(), "a blob per frame: a bit per place"]


def neighbours(frames: Sequence[Int64[np.ndarray, "_ 3"]], reach: int = 3) -> Neighbours:
    """For sorted places of all frames, those before them that touch them: by a face, an edge (reach 2), a corner."""
    offsets = _AROUND[np.abs(_AROUND).sum(axis=1) <= reach]
    later, earlier, start = [np.zeros(0, np.int64)], [np.zeros(0, np.int64)], 0
    for places in frames:
        keys = block_keys(places)
        for offset in offsets if len(keys) else ():
            asked = block_keys(places + offset)
            at = np.minimum(np.searchsorted(keys, asked), len(keys) - 1)
            hit = np.flatnonzero(keys[at] == asked)
            later.append(hit + start)
            earlier.append(at[hit] + start)
        start += len(places)
    v, u = np.concatenate(later), np.concatenate(earlier)
    order = np.lexsort((u, v))
    indptr = np.concatenate([[0], np.cumsum(np.bincount(v, minlength=start))]).astype(np.int64)
    return Neighbours(indptr, u[order].astype(np.int32))


def encode_places(frames: Sequence[Int64[np.ndarray, "_ 3"]]) -> bytes:
    """A bit for every place of the group's box and frame; a frame's bits are a column, seen by those of the next.

    Raises InputError where there are more places than memory is for.
    """
    every = np.concatenate(frames)
    if len(every) == 0:
        return pack(Total(0))
    low, shape = every.min(axis=0), np.ptp(every, axis=0) + 1
    if shape.prod() > MOST_PLACES:
        raise InputError(f"a box of {shape.prod()} blocks, over {MOST_PLACES}; give fewer cells")
    bits = np.zeros((int(shape.prod()), len(frames)), np.int32)
    for column, places in enumerate(frames):
        bits[np.ravel_multi_index(tuple((places - low).T), tuple(shape)), column] = 1
    streams = join(encode_weights(bits, neighbours([_box(shape)])))
    corners = np.stack([np.where(low < 0, -2 * low - 1, 2 * low), shape], axis=1)
    return pack(Total(len(every))) + pack(Box(tuple(corners.reshape(-1).tolist()), streams))


def decode_places(data: bytes, count: int) -> list[Int64[np.ndarray, "_ 3"]]:
    """The blocks of `count` frames."""
    head, offset = unpack(Total, data)
    if head.blocks == 0 and offset == len(data):
        return [np.zeros((0, 3), np.int64)] * count
    record = unpack_all(Box, data[offset:])
    zigzag, shape = np.array(record.corners).reshape(3, 2).T
    low = np.where(zigzag % 2, -(zigzag + 1) // 2, zigzag // 2)
    box = _box(shape)
    bits = decode_weights(split(record.streams, count), len(box), neighbours([box])) == 1
    return [box[bits[:, column]] + low for column in range(count)]


def encode_symbols(symbols: Int32[np.ndarray, "B M"], frames: Sequence[Int64[np.ndarray, "_ 3"]]) -> bytes:
    """The symbols of all blocks of a group, a stream for each component."""
    return join(encode_weights(symbols, neighbours(frames, 1))) if len(symbols) else b""


def decode_symbols(data: bytes, frames: Sequence[Int64[np.ndarray, "_ 3"]], width: int) -> Int32[np.ndarray, "B M"]:
    """The symbols of `width` components."""
    if not (count := sum(map(len, frames))):
        return np.zeros((0, width), np.int32)
    return decode_weights(split(data, width), count, neighbours(frames, 1))


def encode_bits(bits: Bool[np.ndarray, " C"], places: Int64[np.ndarray, "C 3"]) -> bytes:
    """A bit for each of some sorted places; nothing where none is set."""
    if not bits.any():
        return b""
    return encode_weights(bits.astype(np.int32)[:, None], neighbours([places]))[0]


def decode_bits(data: bytes, places: Int64[np.ndarray, "C 3"]) -> Bool[np.ndarray, " C"]:
    """The inverse of `encode_bits`."""
    if not data:
        return np.zeros(len(places), bool)
    return decode_weights([data], len(places), neighbours([places]))[:, 0] == 1


def _box(shape: Int64[np.ndarray, " 3"]) -> Int64[np.ndarray, "P 3"]:
    """All places of a box, sorted."""
    return np.indices(tuple(shape.tolist())).reshape(3, -1).T.astype(np.int64)
