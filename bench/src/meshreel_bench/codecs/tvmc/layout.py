"""The bytes of a TVMC* stream: one record, then its checksum. In -> out: Stream <-> bytes, checked in full."""

from __future__ import annotations

import zlib
from dataclasses import dataclass
from enum import IntEnum
from itertools import pairwise
from typing import Annotated

import numpy as np

from meshreel.encoder.options import MOST_FRAMES
from meshreel.errors import FormatError
from meshreel.format.checks import LARGEST, MOST_CHANGES, MOST_TRACKS, SMALLEST
from meshreel.format.kinds import F64, U8, U32, Array, Blob, Bytes, Choice, List, Varint
from meshreel.format.layout import Checksum, Form
from meshreel.format.records import Nested, least_size, pack, unpack_all

MAGIC = b"TVMC"
VERSION = 1
LONGEST = 1 << 24  # frames (a guess): a few bytes must not claim years of empty ones


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
    """Return the stream that fills `data`. Raises FormatError where it is damaged, of another version or invalid."""
    size = len(data) - least_size(Checksum)
    if data[: len(MAGIC)] != MAGIC:
        raise FormatError(f"no TVMC* stream: it begins with {data[:4]!r}")
    if size <= len(MAGIC) or data[len(MAGIC)] != VERSION:
        raise FormatError(f"a TVMC* stream that is truncated, or of another version than {VERSION}")
    if unpack_all(Checksum, data[size:]).crc != zlib.crc32(data[:size]):
        raise FormatError(f"a TVMC* stream of {len(data)} bytes whose checksum is wrong; damaged or truncated")
    stream = unpack_all(Stream, data[:size])
    _check_numbers(stream)
    _check_states(stream)
    _check_groups(stream)
    return stream


def _check_numbers(stream: Stream) -> None:
    if not 0 < stream.frame_count <= LONGEST:
        raise FormatError(f"a TVMC* stream of {stream.frame_count} frames; 1 to {LONGEST} are known")
    if not (SMALLEST <= stream.scale <= LARGEST and 0 < stream.step <= LARGEST):
        raise FormatError(f"scale {stream.scale:g}, step {stream.step:g} of a TVMC* stream")
    if not all(abs(number) <= LARGEST for number in stream.origin):
        raise FormatError(f"origin {stream.origin} of a TVMC* stream")
    if stream.bare and sum(stream.bare) != stream.frame_count:
        raise FormatError(f"{sum(stream.bare)} frames with and without background, of {stream.frame_count}")


def _check_states(stream: Stream) -> None:
    """Check that states are in order, the first is whole, and chains of patches are no longer than in .reel files."""
    firsts = [state.first_frame for state in stream.states]
    if any(a >= b for a, b in pairwise([-1, *firsts, stream.frame_count])):
        raise FormatError(f"states of the background from frames {firsts} on")
    patches = MOST_CHANGES
    for state in stream.states:
        patches = patches + 1 if is_patch(state) else 0
        if patches > MOST_CHANGES:
            raise FormatError(f"the background from frame {state.first_frame} on is a patch of none, or of too many")


def _check_groups(stream: Stream) -> None:
    """Check the order of groups, their lengths, and the number of groups that share a frame."""
    first, ends = 0, list[int]()
    for number, group in enumerate(stream.groups):
        if not first <= group.first_frame <= stream.frame_count - group.frame_count:
            raise FormatError(f"group {number} from frame {group.first_frame} on is out of order or beyond the end")
        if not 0 < group.frame_count <= MOST_FRAMES:
            raise FormatError(f"group {number} has {group.frame_count} frames, 1 to {MOST_FRAMES} are known")
        first = group.first_frame
        ends = [end for end in ends if end > first] + [first + group.frame_count]
        if len(ends) > MOST_TRACKS:
            raise FormatError(f"frame {first} is in {len(ends)} groups, at most {MOST_TRACKS} are known")


def is_patch(state: State) -> bool:
    """Return whether a state is a patch of the previous one."""
    return state.payload[:1] == bytes([Form.PATCH])


def is_bare(stream: Stream, frame: int) -> bool:
    """Return whether a frame is shown without the background."""
    return bool(np.searchsorted(np.cumsum(stream.bare), frame, side="right") % 2 == 1) if stream.bare else False
