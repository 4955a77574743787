"""The codec of `klt_tsdf`: a sequence <-> one stream of a head, a basis and groups of frames."""

from __future__ import annotations

import zlib
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Annotated, ClassVar

import numpy as np
from jaxtyping import Float64

from meshreel.analysis.survey import survey
from meshreel.errors import FormatError, InputError
from meshreel.format.kinds import F64, Array, Blob, Bytes, Rest, Varint
from meshreel.format.records import pack, unpack_all
from meshreel.types import Mesh, MeshSequence

from ...codec import Progress
from ..base import DecodedFrames, Options
from .basis import MOST, basis_of, decode_basis, encode_basis, join, learned, split
from .frames import Group, decode_frame, decode_group, encode_group
from .weights import STEP_ONE, TRUNCATION, Model

MAGIC = b"KLTT"
VERSION = 1
MOST_GROUP = 64  # frames


@dataclass(frozen=True, slots=True)
class Stream:
    """A sequence; its CRC-32 follows as four bytes, little-endian."""

    magic: Annotated[bytes, Bytes(4), "KLTT"]
    version: Annotated[int, Varint(), "1"]
    frames: Annotated[int, Varint(), "of the sequence, above 0"]
    group: Annotated[int, Varint(), "frames of a group, the last one's aside"]
    basis: Annotated[int, Varint(), "number of components"]
    step: Annotated[int, Varint(), "of the weights, in units of 1 / STEP_ONE voxels"]
    deblocking: Annotated[int, Varint(), "0"]
    voxel: Annotated[float, F64, "m"]
    low: Annotated[tuple[float, ...], Array(3, F64), "m, where the grid begins"]
    table: Annotated[bytes, Blob(Varint()), "the basis"]
    groups: Annotated[bytes, Rest(), "a blob per group"]


@dataclass(frozen=True, slots=True)
class KltTsdfCodec(Options):
    """TSDF blocks by KLT; see the package."""

    name: ClassVar[str] = "klt_tsdf"
    cells: float = 128.0  # of the grid along the diagonal of the sequence's bounding box
    basis: int = 32  # principal components kept
    step: float = 0.05  # of the weights' quantiser, in truncations (3 voxels) of root mean square over a block
    group: int = 10  # frames that share the entropy coder's adaptive models

    def __post_init__(self) -> None:
        """Refuses what cannot be coded."""
        ranges = {"cells": (8, 1024), "basis": (1, MOST), "step": (0.0005, 1), "group": (1, MOST_GROUP)}
        for name, (least, most) in ranges.items():
            if not least <= getattr(self, name) <= most:
                raise InputError(f"{name} {getattr(self, name):g}: give {least:g} to {most}")

    def encode(self, sequence: MeshSequence, progress: Progress | None = None) -> bytes:
        """The stream. Raises InputError where frames take more blocks than memory is for."""
        seen = survey(sequence)
        voxel = seen.diagonal / self.cells
        symbols, energies = learned(self.basis)
        model = Model(basis_of(symbols), max(round(self.step * TRUNCATION * STEP_ONE), 1))
        groups = list[bytes]()
        for start in range(0, len(sequence), self.group):
            numbers = range(start, min(start + self.group, len(sequence)))
            groups.append(encode_group((_scaled(sequence[n], seen.low, voxel) for n in numbers), model, energies))
            if progress is not None:
                progress("code", numbers.stop, len(sequence))
        stream = Stream(
            magic=MAGIC,
            version=VERSION,
            frames=len(sequence),
            group=self.group,
            basis=self.basis,
            step=model.step,
            deblocking=0,
            voxel=voxel,
            low=tuple(map(float, seen.low)),
            table=encode_basis(symbols),
            groups=join(groups),
        )
        data = pack(stream)
        return data + zlib.crc32(data).to_bytes(4, "little")

    def decode(self, data: bytes) -> Sequence[Mesh]:
        """The frames, from the bytes alone; a group is decoded when one of its frames is asked for."""
        return open_video(data)


def _scaled(mesh: Mesh, low: Float64[np.ndarray, " 3"], voxel: float) -> Mesh:
    return Mesh.of((mesh.vertices - low) / voxel, mesh.faces)


@dataclass(slots=True)
class Video(DecodedFrames):
    """The frames of a stream; the group of the last one is kept."""

    stream: Stream
    model: Model
    groups: list[bytes]
    _last: tuple[int, Group] | None = field(default=None)

    def __len__(self) -> int:
        return self.stream.frames

    def frame(self, number: int) -> Mesh:
        which, inside = divmod(number, self.stream.group)
        if self._last is None or self._last[0] != which:
            count = min(self.stream.group, len(self) - which * self.stream.group)
            self._last = which, decode_group(self.groups[which], count, self.stream.basis)
        mesh = decode_frame(self._last[1], inside, self.model)
        return Mesh.of(mesh.vertices * self.stream.voxel + self.stream.low, mesh.faces)


def open_video(data: bytes) -> Video:
    """The frames of a stream, decoded when asked for. Raises FormatError where its head is not one."""
    if data[:4] != MAGIC:
        raise FormatError(f"begins with {data[:4]!r}, not {MAGIC!r}: no stream of klt_tsdf")
    if zlib.crc32(data[:-4]).to_bytes(4, "little") != data[-4:]:
        raise FormatError(f"checksum of {len(data)} bytes is wrong; the stream is damaged")
    stream = unpack_all(Stream, data[:-4])
    if stream.version != VERSION:
        raise FormatError(f"version {stream.version} of klt_tsdf; this one reads {VERSION}")
    symbols = decode_basis(stream.table, stream.basis)
    groups = split(stream.groups, -(-stream.frames // stream.group))
    return Video(stream, Model(basis_of(symbols), stream.step), groups)
