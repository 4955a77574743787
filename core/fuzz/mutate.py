"""Mutate a .reel file by its structure: one part changes, and all lengths and checksums fit again.

In: the bytes of a file, a random generator, and a function that changes plain bytes. Out: the bytes of another file.
The parts are found with the product's own records, so a new field or form needs no change here.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from random import Random
from typing import Any

import numpy as np

from meshreel.coding import entropy
from meshreel.coding.mesh import decode_mesh, encode_mesh
from meshreel.container.writer import pack_head
from meshreel.errors import FormatError, InputError
from meshreel.format import kinds
from meshreel.format.layout import (
    EDITED,
    Atlas,
    ChunkKind,
    ColorsLevel,
    DisplacementHead,
    DracoGroup,
    EmptyGroup,
    Form,
    Header,
    Index,
    IndexEntry,
    LaplacianGroup,
    Layer,
    LayersGroup,
    LayersLevel,
    LayersPatches,
    Pictures,
    Preamble,
    StaticPatch,
    VertexColors,
)
from meshreel.format.records import Nested, pack, record_fields, unpack
from meshreel.types import Mesh

TRIES = 20  # changes tried until one can be packed
MOST_FACES = 2000  # of meshes that are coded again; larger ones take too long
NUMBERS = (0, 1, 2, 3, 7, 8, 30, 31, 63, 64, 127, 128, 199, 200, 255, 256, 65_535, 1 << 20, (1 << 31) - 1, 1 << 32)
REALS = (0.0, -0.0, 5e-324, 1e-30, 1e-3, 0.5, 1.0, -1.0, 3.0, 1e6, 1e15, 1e30, 1e300)
FIRST = {  # the record that a payload begins with
    Form.LAPLACIAN: LaplacianGroup,
    Form.LAYERS: LayersGroup,
    Form.DRACO: DracoGroup,
    Form.EMPTY: EmptyGroup,
    Form.PATCH: StaticPatch,
    Form.VERTEX_COLORS: VertexColors,
    Form.PLACES: Atlas,
    Form.VIDEO: Pictures,
}
MORE = {
    Form.LAYERS: [LayersLevel, LayersPatches],
    Form.VERTEX_COLORS: [ColorsLevel],
    Form.VIDEO: [Pictures],
}  # those of further layers
DRACO = {"base", "reference", "mesh", "meshes"}  # fields that hold Draco bytes
ChangeBytes = Callable[[bytes], bytes]


@dataclass(frozen=True)
class Chunk:
    """Index entry of a chunk, and the records of its payload, a layer each."""

    entry: IndexEntry
    layers: tuple[bytes, ...]


def mutate(data: bytes, random: Random, change: ChangeBytes, of_head: float = 0.2) -> bytes:
    """Return the file with a part changed: of the head, with this probability, or of a payload."""
    try:
        header, chunks = parse(data)
    except FormatError:
        return change(data)
    if not chunks:
        return change(data)
    for _ in range(TRIES):
        try:
            if random.random() < of_head:
                return _change_head(header, chunks, random, change)
            at = random.randrange(len(chunks))
            return assemble(header, [*chunks[:at], _Change(random, change).chunk(chunks[at]), *chunks[at + 1 :]])
        except (FormatError, InputError, ValueError, OverflowError, LookupError):
            continue  # a value that cannot be packed, or a payload that no form has
    return change(data)


def parse(data: bytes) -> tuple[Header, list[Chunk]]:
    """Split a file into header and chunks, whatever its checksums say. Raises FormatError if the head is damaged."""
    preamble, start = unpack(Preamble, data)
    header, start = unpack(Header, data, start)
    index, _ = unpack(Index, data, start)
    offset, chunks = preamble.head_size, []
    for entry in index.chunks:
        layers = []
        for layer in entry.layers:
            layers.append(data[offset : offset + layer.size])
            offset += layer.size
        chunks.append(Chunk(entry, tuple(layers)))
    return header, chunks


def assemble(header: Header, chunks: list[Chunk]) -> bytes:
    """Join a header and chunks to a file whose sizes, checksums, forms and numbers of frames fit."""
    entries = []
    for chunk in chunks:
        payload = b"".join(chunk.layers)
        form = Form(payload[0]) if payload and payload[0] in list(Form) else chunk.entry.form
        frames = chunk.entry.frames if chunk.entry.kind == ChunkKind.STATIC else _frames(payload, chunk.entry.frames)
        layers = tuple(Layer(len(layer), zlib.crc32(layer)) for layer in chunk.layers)
        entries.append(replace(chunk.entry, form=form, frames=frames, layers=layers))
    flags = EDITED if '"edit"' in header.metadata else 0
    return pack_head(header, Index(tuple(entries)), flags) + b"".join(b"".join(chunk.layers) for chunk in chunks)


def _frames(payload: bytes, known: int) -> int:
    """Return the number of frames that a payload says it has."""
    try:
        if payload[0] == Form.LAYERS:
            return int(unpack(LayersGroup, payload)[0].frames)
        if payload[0] == Form.DRACO:
            return len(unpack(DracoGroup, payload)[0].meshes)
        if payload[0] == Form.LAPLACIAN:
            return int(unpack(DisplacementHead, unpack(LaplacianGroup, payload)[0].displacements)[0].frames)
    except (FormatError, IndexError):
        pass
    return known


def _change_head(header: Header, chunks: list[Chunk], random: Random, change: ChangeBytes) -> bytes:
    """Change the header, an entry, or the order of the chunks; or bytes behind the checks of the records."""
    of, at = _Change(random, change), random.randrange(len(chunks))
    kind = random.randrange(5)
    if kind == 0:
        return assemble(of.record(header), chunks)
    if kind == 1:
        return assemble(
            header, [*chunks[:at], replace(chunks[at], entry=of.record(chunks[at].entry)), *chunks[at + 1 :]]
        )
    if kind == 2:
        other = chunks[random.randrange(len(chunks))]
        return assemble(header, [*chunks[:at], other, *chunks[at + random.randrange(2) :]])
    whole = assemble(header, chunks)
    size = unpack(Preamble, whole)[0].head_size
    if kind == 3:  # the head as bytes, its checksum right
        head = change(whole[14 : size - 4])
        head = whole[:10] + (14 + len(head) + 4).to_bytes(4, "little") + head
        return head + zlib.crc32(head).to_bytes(4, "little") + whole[size:]
    return change(whole)


class _Change:
    """Changes of values by their kind."""

    def __init__(self, random: Random, change: ChangeBytes) -> None:
        self.random, self.bytes = random, change

    def chunk(self, chunk: Chunk) -> Chunk:
        """Change one layer of a chunk, or how many there are."""
        layers, at = list(chunk.layers), self.random.randrange(len(chunk.layers))
        kind = self.random.randrange(12)
        if kind == 0:
            del layers[at]
        elif kind == 1:
            layers.insert(at, layers[self.random.randrange(len(layers))])
        elif kind == 2:
            layers = [b"".join(layers)]
        else:
            layers[at] = self.layer(layers, at)
        return replace(chunk, layers=tuple(layer for layer in layers if layer) or chunk.layers)

    def layer(self, layers: list[bytes], at: int) -> bytes:
        """Change a layer by its record, if it is one; otherwise its bytes."""
        data = layers[at]
        form = Form(layers[0][0])
        if self.random.randrange(10) == 0:
            return self.bytes(data)
        types = [FIRST[form]] if at == 0 else MORE.get(form, [])
        for record_type in types if at < len(layers) - 1 else types[::-1]:
            try:
                record, end = unpack(record_type, data)
            except FormatError:
                continue
            return pack(self.record(record)) + data[end:]
        return self.bytes(data)

    def record(self, record: Any) -> Any:
        """Change one field of a record, or a few."""
        for _ in range(1 + (self.random.randrange(4) == 0)):
            field = self.random.choice(record_fields(type(record)))
            value = getattr(record, field.name)
            if field.name == "dropped" and self.random.randrange(4):
                record = self.runs(record)
                continue
            if field.name == "displacements":
                value = self.displacements(value)
            elif field.name in DRACO and self.random.randrange(2):
                value = self.draco(value)
            else:
                value = self.value(field.kind, value)
            record = replace(record, **{field.name: value})
        return record

    def value(self, kind: Any, value: Any) -> Any:
        """Change a value of a kind."""
        match kind:
            case kinds.Number(code="f" | "d"):
                return self.random.choice((*REALS, -value, value * 2.0 ** self.random.randrange(-60, 60)))
            case kinds.Number() | kinds.Varint():
                return self.random.choice(
                    (*NUMBERS, value + 1, value - 1, value ^ 1 << self.random.randrange(8), 2 * value)
                )
            case kinds.Choice():
                return self.random.choice(list(kind.values))
            case kinds.Text():
                return self.bytes(value.encode()).decode(errors="replace")
            case kinds.Array() | kinds.List():
                return self.items(kind, value)
            case Nested():
                return self.record(value)
        return self.bytes(value)

    def items(self, kind: kinds.Array | kinds.List, values: tuple[Any, ...]) -> tuple[Any, ...]:
        """Change an item of a list, repeat it or leave it out."""
        if not values:
            return (self.value(kind.item, 0),) if isinstance(kind.item, kinds.Number | kinds.Varint) else values
        at = self.random.randrange(len(values))
        change = self.random.randrange(4) if isinstance(kind, kinds.List) else 3
        middle = ((), (values[at],) * 2, (values[at],) * self.random.randrange(20))[change] if change < 3 else None
        return (*values[:at], *((self.value(kind.item, values[at]),) if middle is None else middle), *values[at + 1 :])

    def runs(self, record: Any) -> Any:
        """Change runs of dropped faces and code them again."""
        runs = entropy.decode_integers(record.dropped, record.runs).tolist()
        at = self.random.randrange(len(runs) + 1)
        change = self.random.randrange(4)
        if change == 0:
            runs.insert(at, self.random.choice(NUMBERS[:-1]))
        elif runs:
            at %= len(runs)
            runs[at : at + 1] = [[], [runs[at] + 1], [1, max(runs[at] - 1, 0)]][change - 1]
        return replace(record, runs=len(runs), dropped=entropy.encode_integers(np.array(runs, np.int32)))

    def displacements(self, data: bytes) -> bytes:
        """Change the head of coded displacements, or one of its streams with the size that the head gives it."""
        head, start = unpack(DisplacementHead, data)
        if self.random.randrange(2) or not head.components:
            return pack(self.record(head)) + data[start:]
        components, streams = list(head.components), []
        for component in components:
            for size in (component.anchors_size, component.deltas_size):
                streams.append(data[start : start + size])
                start += size
        at = self.random.randrange(len(streams))
        streams[at] = self.bytes(streams[at])
        name = fields(components[0])[2 + at % 2].name
        components[at // 2] = replace(components[at // 2], **{name: len(streams[at])})
        return pack(replace(head, components=tuple(components))) + b"".join(streams)

    def draco(self, value: Any) -> Any:
        """Change a coded mesh, one of them where there are several, and code it again."""
        if isinstance(value, tuple):
            at = self.random.randrange(len(value)) if value else 0
            return (*value[:at], self.draco(value[at]), *value[at + 1 :]) if value else value
        mesh = decode_mesh(value, 1.0 / 1024)
        if mesh.is_empty or len(mesh.faces) > MOST_FACES:
            return self.bytes(value)
        points, faces = mesh.vertices.copy(), mesh.faces.copy()
        change = self.random.randrange(5)
        if change == 0:
            points[self.random.randrange(len(points))] += self.random.choice((0.01, -0.3, 40.0))
        elif change == 1:
            faces = faces[: self.random.randrange(len(faces) + 1)]
        elif change == 2:
            faces[self.random.randrange(len(faces))] = self.random.choice(faces.tolist())
        elif change == 3:
            faces[self.random.randrange(len(faces)), self.random.randrange(3)] = self.random.randrange(len(points))
        else:
            faces = np.concatenate([faces, faces[:, ::-1] if self.random.randrange(2) else faces])
        return encode_mesh(Mesh.of(points, faces), 1.0 / 1024)


def change_bytes(random: Random) -> ChangeBytes:
    """Return a function that changes plain bytes: a bit, a byte, a range moved, repeated or left out."""

    def change(data: bytes) -> bytes:
        out = bytearray(data)
        for _ in range(1 + random.randrange(3)):
            at, size = random.randrange(len(out) + 1), 1 + random.randrange(8)
            kind = random.randrange(5)
            if kind == 0 and at < len(out):
                out[at] ^= 1 << random.randrange(8)
            elif kind == 1 and at < len(out):
                out[at] = random.choice((0, 1, 0x7F, 0x80, 0xFF))
            elif kind == 2:
                out[at:at] = random.randbytes(size)
            elif kind == 3:
                del out[at : at + size]
            else:
                out[at : at + size] = out[(start := random.randrange(len(out) + 1)) : start + size]
        return bytes(out)

    return change
