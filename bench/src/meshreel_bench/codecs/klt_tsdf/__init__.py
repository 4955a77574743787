"""KLT of TSDF blocks (Tang et al. 2018, "Real-time Compression and Streaming of 4D Performances"): "KLT" in the paper.

Each frame becomes signed distances on a sparse regular grid, `cells` along the diagonal of the sequence's box, and is
coded by itself: the blocks of 8^3 cells that hold surface; for each the weights of `basis` principal components that
were learned offline on procedural bodies and simple shapes, quantised at `step` and range coded; marching cubes at the
decoder. The rate counts everything: mean and components are in each stream, about 20 bytes per component.

A group has each frame for itself and the entropy coder's models together: which blocks hold surface, their symbols,
what is left out. Decoded surface that is not there in the original (past a border, where signs contradict each other,
or few components ripple) is left out: a bit for each block, and one for each crossed cell in the blocks that have such.

Differs from the publication:
- Blocks share a layer of voxels, so that each holds whole cells; the decoder averages their values there. Deblocking,
  which moves weights within their step until blocks agree, is left out: with the quantisation below it cost 0.7 dB.
- Weights are fitted by weighted least squares (`components`). The basis is made of discrete Legendre polynomials.
- Distances come from meshes, not from depth (`grid`).
- Contexts come from neighbouring blocks and, for positions, from the frame before; `group` frames share adaptive
  models. Nothing else crosses frames. Geometry alone: no texture.
"""

from __future__ import annotations

import zlib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import islice
from typing import Annotated, ClassVar

import numpy as np
from jaxtyping import Bool, Float64, Int32, Int64

from meshreel.analysis.survey import survey_sequence
from meshreel.coding.entropy import Neighbours, decode_weights, encode_weights
from meshreel.errors import FormatError, InputError
from meshreel.format.kinds import F64, Array, Blob, Bytes, Rest, Varint
from meshreel.format.records import pack, unpack_all
from meshreel.geometry.closest_points import Surface
from meshreel.geometry.topology import drop_unreferenced
from meshreel.types import Mesh, MeshSequence

from ...codec import DecodedFrames, Options, Progress, reported
from . import components
from .components import Field, Model, cells_at, field_of, join, split
from .grid import block_keys, prepared, sample

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
        ranges = {"cells": (8, 1024), "basis": (1, components.MOST), "step": (0.0005, 1), "group": (1, MOST_GROUP)}
        for name, (least, most) in ranges.items():
            if not least <= getattr(self, name) <= most:
                raise InputError(f"{name} {getattr(self, name):g}: give {least:g} to {most}")

    def encode(self, sequence: MeshSequence, progress: Progress | None = None) -> bytes:
        """The stream. Raises InputError where frames take more blocks than memory is for."""
        survey = survey_sequence(sequence)
        voxel = survey.diagonal / self.cells
        symbols, energies = components.learned(self.basis)
        model = components.model_of(symbols, max(round(self.step * components.TRUNCATION * components.STEP_ONE), 1))
        scaled = (Mesh.of((mesh.vertices - survey.low) / voxel, mesh.faces) for mesh in sequence)
        starts = range(0, len(sequence), self.group)
        each = reported(starts, progress, "code", len(starts))
        groups = [encode_group(islice(scaled, self.group), model, energies) for _ in each]
        low, table = tuple(map(float, survey.low)), components.encode_basis(symbols)
        head = MAGIC, VERSION, len(sequence), self.group, self.basis, model.step
        data = pack(Stream(*head, deblocking=0, voxel=voxel, low=low, table=table, groups=join(groups)))
        return data + zlib.crc32(data).to_bytes(4, "little")

    def decode(self, data: bytes) -> Sequence[Mesh]:
        return Video(data)


class Video(DecodedFrames):
    """The frames of a stream, decoded when asked for; the group of the last one is kept."""

    def __init__(self, data: bytes) -> None:
        """Raises FormatError where the stream's head is not one."""
        if data[:4] != MAGIC:
            raise FormatError(f"begins with {data[:4]!r}, not {MAGIC!r}: no stream of klt_tsdf")
        if zlib.crc32(data[:-4]).to_bytes(4, "little") != data[-4:]:
            raise FormatError(f"checksum of {len(data)} bytes is wrong; the stream is damaged")
        self.stream = stream = unpack_all(Stream, data[:-4])
        if stream.version != VERSION:
            raise FormatError(f"version {stream.version} of klt_tsdf; this one reads {VERSION}")
        self._model = components.model_of(components.decode_basis(stream.table, stream.basis), stream.step)
        self._groups = split(stream.groups, -(-stream.frames // stream.group))
        self._last: tuple[int, list[Frame]] | None = None

    def __len__(self) -> int:
        return self.stream.frames

    def frame(self, number: int) -> Mesh:
        which, inside = divmod(number, self.stream.group)
        if self._last is None or self._last[0] != which:
            count = min(self.stream.group, len(self) - which * self.stream.group)
            self._last = which, decode_group(self._groups[which], count, self.stream.basis)
        places, symbols, left_out = self._last[1][inside]
        field = field_of(places, symbols, self._model)
        (mesh, cells), omitted = components.polygonize(field), _decode_omitted(left_out, field)
        if len(omitted):
            mesh = drop_unreferenced(Mesh(mesh.vertices, mesh.faces[~np.isin(cells, omitted)]))
        return Mesh.of(mesh.vertices * self.stream.voxel + self.stream.low, mesh.faces)


_FAR = 1.5  # voxels from the surface beyond which decoded surface is left out
_PAST = 0.5  # voxels past a border


# Frame of a group as it travels: the places of its blocks, their symbols, and what is left out.
Frame = tuple[Int64[np.ndarray, "_ 3"], Int32[np.ndarray, "_ _"], bytes]


def encode_group(meshes: Iterable[Mesh], model: Model, energies: Float64[np.ndarray, " M"]) -> bytes:
    """Return the bytes of frames in voxel units; `energies` are the expected mean squares of the weights."""
    frames = list[Frame]()
    for mesh in map(prepared, meshes):
        blocks = sample(mesh)
        symbols = components.forward(blocks, model, energies)
        frames.append((blocks.places, symbols, _encode_omitted(mesh, field_of(blocks.places, symbols, model))))
    places, each, omitted = (list(column) for column in zip(*frames, strict=True))
    every = np.concatenate(each)
    coded = join(encode_weights(every, neighbours(places, 1))) if len(every) else b""  # one a component
    return join([encode_places(places), coded, *omitted])


def decode_group(data: bytes, count: int, width: int) -> list[Frame]:
    """The group of `count` frames."""
    first, second, *omitted = split(data, 2 + count)
    places = decode_places(first, count)
    ends, symbols = np.cumsum([len(each) for each in places]), np.zeros((0, width), np.int32)
    if ends[-1]:
        symbols = decode_weights(split(second, width), int(ends[-1]), neighbours(places, 1))
    return list(zip(places, np.split(symbols, ends[:-1]), omitted, strict=True))


def _encode_omitted(mesh: Mesh, field: Field) -> bytes:
    """Return the bits of blocks and cells whose surface is left out; no bytes if none is."""
    cells = _wrong(mesh, *components.polygonize(field))
    if len(cells) == 0:
        return b""
    chosen = np.zeros(len(field.places), bool)
    chosen[cells // components.VOXELS] = True
    seen = components.crossed(field, chosen)
    return join([encode_bits(chosen, field.places), encode_bits(np.isin(seen, cells), cells_at(seen, field))])


def _decode_omitted(data: bytes, field: Field) -> Int64[np.ndarray, " C"]:
    """The numbers of the cells that are left out."""
    if not data:
        return np.zeros(0, np.int64)
    first, second = split(data, 2)
    cells = components.crossed(field, decode_bits(first, field.places))
    return cells[decode_bits(second, cells_at(cells, field))]


def _wrong(mesh: Mesh, decoded: Mesh, cells: Int64[np.ndarray, " F"]) -> Int64[np.ndarray, " C"]:
    """Return the numbers of the cells most of whose decoded faces lie off the mesh."""
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


MOST_PLACES = 1 << 19  # of a group's box: 1024 cells along its diagonal need no more
_AROUND = np.array([(x, y, z) for x in (-1, 0, 1) for y in (-1, 0, 1) for z in (-1, 0, 1) if (x, y, z) < (0, 0, 0)])


@dataclass(frozen=True, slots=True)
class Box:
    """The box around the blocks of a group, and which of its places they are; one byte, 0, where it has none."""

    blocks: Annotated[int, Varint(), "of all frames, above 0"]
    corners: Annotated[tuple[int, ...], Array(6, Varint()), "lowest place, 2n or -2n - 1, and length, by axis"]
    streams: Annotated[bytes, Rest(), "a blob per frame: a bit per place"]


def neighbours(frames: Sequence[Int64[np.ndarray, "_ 3"]], reach: int = 3) -> Neighbours:
    """Return earlier blocks that touch each block, of sorted places: by a face, an edge (`reach` 2) or a corner (3)."""
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
        return b"\0"
    low, shape = every.min(axis=0), np.ptp(every, axis=0) + 1
    if shape.prod() > MOST_PLACES:
        raise InputError(f"a box of {shape.prod()} blocks, over {MOST_PLACES}; give fewer cells")
    bits = np.zeros((int(shape.prod()), len(frames)), np.int32)
    for column, places in enumerate(frames):
        bits[np.ravel_multi_index(tuple((places - low).T), tuple(shape)), column] = 1
    streams = join(encode_weights(bits, neighbours([_box(shape)])))
    corners = np.stack([np.where(low < 0, -2 * low - 1, 2 * low), shape], axis=1)
    return pack(Box(len(every), tuple(corners.reshape(-1).tolist()), streams))


def decode_places(data: bytes, count: int) -> list[Int64[np.ndarray, "_ 3"]]:
    """The blocks of `count` frames."""
    if data == b"\0":
        return [np.zeros((0, 3), np.int64)] * count
    record = unpack_all(Box, data)
    zigzag, shape = np.array(record.corners).reshape(3, 2).T
    low = np.where(zigzag % 2, -(zigzag + 1) // 2, zigzag // 2)
    box = _box(shape)
    bits = decode_weights(split(record.streams, count), len(box), neighbours([box])) == 1
    return [box[bits[:, column]] + low for column in range(count)]


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
