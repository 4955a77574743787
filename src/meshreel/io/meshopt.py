"""Encoder of meshoptimizer's streams for glTF's EXT_meshopt_compression; the only module that imports it.

In: bytes of vertices or of corners. Out: a stream, and an order of vertices and faces that makes it small.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from jaxtyping import Float32, Int32, Int64, UInt32

from ..errors import InputError

MODES = ATTRIBUTES, TRIANGLES = "ATTRIBUTES", "TRIANGLES"
_VERSIONS = {ATTRIBUTES: 0, TRIANGLES: 1}  # of streams in the extension


def check_meshopt() -> Any:
    """Return the package. Raises InputError if it is not installed."""
    try:
        import meshoptimizer
    except ImportError:
        raise InputError("meshoptimizer is not installed; pip install 'meshreel[glb]'") from None
    return meshoptimizer


def pack_stream(data: bytes, mode: str, stride: int) -> bytes:
    """Encode vertices of `stride` bytes, a multiple of 4, or corners of triangles of 2 or 4 bytes, as a stream."""
    package, count = check_meshopt(), len(data) // stride
    if mode == TRIANGLES:
        package.encode_index_version(_VERSIONS[mode])
        corners = np.frombuffer(data, f"<u{stride}").astype(np.uint32)
        return bytes(package.encode_index_buffer(corners, count, int(corners.max()) + 1))
    package.encode_vertex_version(_VERSIONS[mode])
    return bytes(package.encode_vertex_buffer(np.frombuffer(data, np.uint8).reshape(-1, stride), count, stride))


def exponential(values: Float32[np.ndarray, " N"], bits: int) -> UInt32[np.ndarray, " N"]:
    """Round to multiples of 2^-bits in the layout of filter EXPONENTIAL: a 24-bit factor, and -bits above it."""
    factors = np.rint(values.astype(np.float64) * 2**bits).astype(np.int64)
    return ((factors & 0xFFFFFF) | ((-bits & 0xFF) << 24)).astype(np.uint32)


def by_use(corners: Int32[np.ndarray, "F 3"], count: int) -> tuple[Int64[np.ndarray, " W"], Int32[np.ndarray, "F 3"]]:
    """Return vertices of `count` in the order of their use, and faces in an order that uses them together."""
    ordered = np.zeros(corners.size, np.uint32)
    check_meshopt().optimize_vertex_cache(ordered, corners.reshape(-1).astype(np.uint32), corners.size, count)
    used, first = np.unique(ordered, return_index=True)
    order = used[np.argsort(first)].astype(np.int64)
    renamed = np.zeros(count, np.int32)
    renamed[order] = np.arange(len(order))
    return order, renamed[ordered].reshape(-1, 3)
