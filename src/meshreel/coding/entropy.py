"""Entropy coding: integer symbols <-> bytes, by the adaptive range coder in `core/` (the paper leaves its coder open).

In -> out: quantised weights (N vertices x M columns) -> a stream per column; small side data -> one stream. The first k
columns decode without the rest. Integers alone choose the symbols, so every platform decodes the same. Streams are
canonical: a truncated one, or one with a byte too many, raises FormatError.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .. import _core
from ..errors import FormatError
from ..shapes import Int32, Int64

SYMBOLS_PER_BYTE = 22_800  # no stream says more: a coded bit costs at least 1 / 2840 bit


@dataclass(frozen=True, slots=True)
class Neighbours:
    """For each vertex v its mesh neighbours with a smaller index, sorted: indices[indptr[v] : indptr[v + 1]]."""

    indptr: Int64[np.ndarray, " S"]  # S = V + 1
    indices: Int32[np.ndarray, " E"]


def causal_neighbours(faces: Int32[np.ndarray, "F 3"], count: int) -> Neighbours:
    """Return the neighbours decoded before each of `count` vertices; integers only, so the same on every platform."""
    f = faces.astype(np.int64)
    if len(f) and (f.min() < 0 or f.max() >= count):
        raise FormatError(f"a face names vertex {int(f.max())} or {int(f.min())} of {count}; the mesh is damaged")
    pairs = np.concatenate([f[:, [0, 1]], f[:, [1, 2]], f[:, [2, 0]]])
    high, low = np.maximum(pairs[:, 0], pairs[:, 1]), np.minimum(pairs[:, 0], pairs[:, 1])
    keys = np.sort((high * count + low)[high != low])
    keys = keys[np.concatenate([[True], keys[1:] != keys[:-1]])[: len(keys)]]  # np.unique takes ten times as long
    counts = np.bincount(keys // max(count, 1), minlength=count)
    indptr = np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
    return Neighbours(indptr, (keys % max(count, 1)).astype(np.int32))


def encode_weights(symbols: Int32[np.ndarray, "N M"], neighbours: Neighbours) -> list[bytes]:
    """Encode one stream per column; column c decodes with the columns before it, and without those after."""
    columns = np.array(symbols.T, dtype=np.int32, order="C")  # a copy: the core takes writable arrays
    return list(_core.encode_weights(columns, neighbours.indptr, neighbours.indices))


def decode_weights(streams: Sequence[bytes], count: int, neighbours: Neighbours) -> Int32[np.ndarray, "N M"]:
    """Decode the symbols of `count` vertices in the first len(streams) columns; FormatError on a damaged stream."""
    for column, stream in enumerate(streams):
        check_plausible(count, len(stream), f"weights, column {column}")
    columns = np.zeros((len(streams), count), np.int32)
    sizes = np.array([len(stream) for stream in streams], np.int64)
    failed = _core.decode_weights(b"".join(streams), sizes, columns, neighbours.indptr, neighbours.indices)
    if failed >= 0:
        raise FormatError(f"weights, column {failed}: {len(streams[failed])} bytes are truncated or damaged")
    return np.ascontiguousarray(columns.T)


def encode_integers(values: Int32[np.ndarray, " N"]) -> bytes:
    """Encode small side data (anchors, basis) of any int32 values as one stream; no bytes for no values."""
    return bytes(_core.encode_integers(np.ascontiguousarray(values)))


def decode_integers(data: bytes, count: int) -> Int32[np.ndarray, " N"]:
    """Decode `count` values; FormatError if `data` is not exactly their stream."""
    check_plausible(count, len(data), "integers")
    values = np.zeros(count, np.int32)
    if not _core.decode_integers(data, values):
        raise FormatError(f"integers: {len(data)} bytes are not a stream of {count} values; truncated or damaged")
    return values


def check_plausible(count: int, size: int, what: str) -> None:
    """Raise FormatError if `size` bytes cannot contain `count` symbols, before memory is allocated."""
    if not 0 <= count <= SYMBOLS_PER_BYTE * (size + 4) or (count > 0) != (size > 0):
        raise FormatError(f"{what}: {count} symbols cannot come from {size} bytes; the stream is damaged")
