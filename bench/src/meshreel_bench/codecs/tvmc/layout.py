"""The bytes of a TVMC* stream: a record, then a checksum. Only what measures it decodes it: no law is checked."""

from __future__ import annotations

import zlib
from dataclasses import dataclass
from enum import IntEnum
from typing import Annotated

import numpy as np

from meshreel.errors import FormatError
from meshreel.format.kinds import F64, U8, U32, Array, Blob, Bytes, Choice, List, Varint
from meshreel.format.layout import Checksum
from meshreel.format.records import Nested, least_size, pack, unpack_all

MAGIC = b"TVMC"
VERSION = 1


class Kind(IntEnum):
    """Coding of a group."""

    TRACKED = 0  # a reference and displacements
    DRACO = 1  # one Draco mesh per frame


@dataclass(frozen=True, slots=True)
class State:
    """Background from one frame to the next state."""

    first_frame: Annotated[int, Varint(), "later than that of the previous state"]
    payload: Annotated[bytes, Blob(Varint()), "as in a STATIC chunk: a background, or a patch of the previous one"]


@dataclass(frozen=True, slots=True)
class Group:
    """Consecutive frames of one body, coded together."""

    first_frame: Annotated[int, Varint(), "not before that of the previous group"]
    frame_count: Annotated[int, U8, "above 0"]
    kind: Annotated[Kind, Choice(U8, Kind), "format of the payload"]
    payload: Annotated[bytes, Blob(Varint()), "a TrackedPayload, or that of a group of form DRACO"]


@dataclass(frozen=True, slots=True)
class TrackedPayload:
    """A reference and the displacements of its vertices in each frame."""

    levels: Annotated[int, U8, "midpoint subdivisions of the decoded reference"]
    spacing: Annotated[float, F64, "of the reference's lattice, above 0: decoded vertices are rounded to multiples"]
    reference: Annotated[bytes, Blob(Varint()), "a Draco mesh"]
    displacements: Annotated[tuple[bytes, ...], List(U8, Blob(Varint())), "one Draco point cloud per frame"]


@dataclass(frozen=True, slots=True)
class Stream:
    """A sequence. A frame shows the state of its time and the groups that contain it; with neither it is empty."""

    magic: Annotated[bytes, Bytes(4), "TVMC"]
    version: Annotated[int, U8, "1"]
    frame_count: Annotated[int, U32, "of the sequence"]
    origin: Annotated[tuple[float, ...], Array(3, F64), "of normalised coordinates, m"]
    scale: Annotated[float, F64, "m, the unit of normalised coordinates"]
    step: Annotated[float, F64, "quantization step of the displacements, normalised, above 0"]
    bare: Annotated[tuple[int, ...], List(Varint(), Varint()), "lengths of runs of frames with and without background"]
    states: Annotated[tuple[State, ...], List(Varint(), Nested(State)), "the background"]
    groups: Annotated[tuple[Group, ...], List(Varint(), Nested(Group)), "the moving bodies"]


def pack_stream(stream: Stream) -> bytes:
    """Return the bytes of a stream."""
    data = pack(stream)
    return data + pack(Checksum(zlib.crc32(data)))


def unpack_stream(data: bytes) -> Stream:
    """Return the stream that fills `data`. Raises FormatError where it is damaged, or of another version."""
    size = len(data) - least_size(Checksum)
    if data[: len(MAGIC)] != MAGIC:
        raise FormatError(f"no TVMC* stream: it begins with {data[:4]!r}")
    if size <= len(MAGIC) or data[len(MAGIC)] != VERSION:
        raise FormatError(f"a TVMC* stream that is truncated, or of another version than {VERSION}")
    if unpack_all(Checksum, data[size:]).crc != zlib.crc32(data[:size]):
        raise FormatError(f"a TVMC* stream of {len(data)} bytes whose checksum is wrong; damaged or truncated")
    return unpack_all(Stream, data[:size])


def is_bare(stream: Stream, frame: int) -> bool:
    """Return whether a frame is shown without the background."""
    return bool(np.searchsorted(np.cumsum(stream.bare), frame, side="right") % 2 == 1) if stream.bare else False
