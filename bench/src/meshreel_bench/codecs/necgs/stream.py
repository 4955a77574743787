"""Sizes of the auto-decoder, quantization of its numbers (NeCGS, section 3.2 and appendix A.1), and the stream."""

from __future__ import annotations

import math
import zlib
from dataclasses import dataclass
from itertools import pairwise
from typing import Annotated

import numpy as np
from jaxtyping import Bool, Float64, Int32

from meshreel.coding.entropy import decode_integers, encode_integers
from meshreel.errors import FormatError
from meshreel.format.kinds import F64, U8, U16, U32, Array, Blob, Bytes, List, Rest
from meshreel.format.records import pack, unpack_all

from .volumes import Placement

SIDE = 4  # K': points along a side of an embedded feature
OUTPUTS = 4  # of a grid point: its distance and three components of its deformation
RESOLUTIONS = (16, 32, 64, 128)
MOST_CHANNELS = 128
MOST_FEATURES = 64
BITS = range(4, 17)
_NARROWING = (1.0, 0.75, 0.5, 0.375, 0.25)  # of 64: 64, 48, 32, 24 and 16 channels, as in the authors' configuration


@dataclass(frozen=True, slots=True)
class Shape:
    """Sizes of an auto-decoder."""

    resolution: int  # K, points along a side of the grid; one of RESOLUTIONS
    features: int  # C, channels of an embedded feature
    channels: int  # of the first module's output
    bits: int  # N: numbers are multiples of 2 / 2^N from -1 to 1

    @property
    def feature_size(self) -> int:
        """Length of an embedded feature."""
        return self.features * SIDE**3

    @property
    def layers(self) -> tuple[tuple[int, int], ...]:
        """Input and output channels of each convolution: L modules that double the resolution, and the last."""
        modules = round(math.log2(self.resolution // SIDE))
        widths = [self.features, *(max(OUTPUTS, round(self.channels * share)) for share in _NARROWING[:modules])]
        inner = [(a, 8 * b) for a, b in pairwise(widths)]
        return (*inner, (widths[-1], OUTPUTS))

    @property
    def tensors(self) -> tuple[tuple[int, ...], ...]:
        """Shapes of the parameters: weights, then biases of each convolution."""
        return tuple(size for a, b in self.layers for size in ((b, a, 3, 3, 3), (b,)))


def quantize(values: Float64[np.ndarray, " N"], bits: int) -> Int32[np.ndarray, " N"]:
    """Return symbols of values clamped to -1 .. 1: 2^N + 1 levels including 0 (section A.1, eq. 5)."""
    return np.rint(np.clip(values, -1, 1) * (1 << (bits - 1))).astype(np.int32)


def dequantize(symbols: Int32[np.ndarray, " N"], bits: int) -> Float64[np.ndarray, " N"]:
    """Return the values of symbols."""
    return symbols / float(1 << (bits - 1))


MAGIC = b"NeCGS\r\n\x1a"
VERSION = 1


@dataclass(frozen=True, slots=True)
class Coded:
    """Input of the decoder; symbols are those of the N frames that are not empty."""

    shape: Shape
    trimmed: bool  # flips of sign far from any surface are left out
    full: Bool[np.ndarray, " T"]  # frames that are not empty
    placement: Placement  # of all frames
    features: Int32[np.ndarray, "N E"]
    parameters: list[np.ndarray]  # of every tensor of the network, flat; none where all frames are empty


@dataclass(frozen=True, slots=True)
class _Outer:
    magic: Annotated[bytes, Bytes(8), "NeCGS"]
    version: Annotated[int, U8, "1"]
    checksum: Annotated[int, U32, "CRC-32 of all that follows"]
    inner: Annotated[bytes, Rest(), "an _Inner"]


@dataclass(frozen=True, slots=True)
class _Inner:
    resolution: Annotated[int, U8, "K"]
    features: Annotated[int, U8, "C"]
    channels: Annotated[int, U8, "of the first module"]
    bits: Annotated[int, U8, "N"]
    trimmed: Annotated[int, U8, "1: flips of sign far from any surface are left out"]
    frames: Annotated[int, U32, "T"]
    cell: Annotated[float, F64, "m"]
    anchor: Annotated[tuple[float, ...], Array(3, F64), "m"]
    full: Annotated[bytes, Blob(U32), "one bit per frame: not empty"]
    shifts: Annotated[bytes, Blob(U32), "integers: cells, differences between frames that are not empty"]
    symbols: Annotated[bytes, Blob(U32), "integers: of the features, frame by frame"]
    parameters: Annotated[tuple[bytes, ...], List(U16, Blob(U32)), "integers: of every tensor"]


def encode_stream(coded: Coded) -> bytes:
    """Return the bytes of a coded set."""
    shape, placement = coded.shape, coded.placement
    shifts = np.diff(placement.shifts[coded.full], axis=0, prepend=np.zeros((1, 3), np.int32))
    inner = _Inner(
        *(shape.resolution, shape.features, shape.channels, shape.bits),
        *(int(coded.trimmed), len(coded.full), placement.cell, placement.anchor),
        full=np.packbits(coded.full).tobytes(),
        shifts=encode_integers(shifts.astype(np.int32).reshape(-1)),
        symbols=encode_integers(coded.features.reshape(-1)),
        parameters=tuple(encode_integers(flat) for flat in coded.parameters),
    )
    data = pack(inner)
    return pack(_Outer(MAGIC, VERSION, zlib.crc32(data), data))


def decode_stream(data: bytes) -> Coded:
    """Return the coded set. Raises FormatError where the bytes are damaged."""
    outer = unpack_all(_Outer, data)
    if outer.magic != MAGIC or outer.version != VERSION:
        raise FormatError(f"not a NeCGS stream of version {VERSION}: begins with {data[:9]!r}")
    if zlib.crc32(outer.inner) != outer.checksum:
        raise FormatError("a NeCGS stream with a wrong checksum; it is damaged")
    inner = unpack_all(_Inner, outer.inner)
    shape = Shape(inner.resolution, inner.features, inner.channels, inner.bits)
    full = np.unpackbits(np.frombuffer(inner.full, np.uint8), count=inner.frames).astype(bool)
    count = int(full.sum())
    shifts = np.zeros((len(full), 3), np.int32)
    shifts[full] = np.cumsum(decode_integers(inner.shifts, 3 * count).reshape(-1, 3), axis=0)
    features = decode_integers(inner.symbols, count * shape.feature_size).reshape(count, shape.feature_size)
    sizes = [int(np.prod(size)) for size in shape.tensors] if count else []
    parameters = [decode_integers(stream, size) for stream, size in zip(inner.parameters, sizes, strict=True)]
    placement = Placement(inner.cell, (inner.anchor[0], inner.anchor[1], inner.anchor[2]), shifts)
    return Coded(shape, bool(inner.trimmed), full, placement, features, parameters)
