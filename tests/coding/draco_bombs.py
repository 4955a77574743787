"""Draco meshes written byte by byte, honest ones and such that claim what they have not got.

`python -m tests.coding.draco_bombs` prints the latter as JSON, for the tests of the player.
"""

import base64
import io
import json
import struct
import sys
from dataclasses import dataclass, replace

import DracoPy
import numpy as np

from meshreel.coding.mesh import encode_mesh
from meshreel.container.writer import ReelWriter
from meshreel.format.layout import DracoGroup, Form
from meshreel.format.records import pack
from meshreel.types import Mesh
from tests.container.files import HEADER

CODES = {"C": (0, 1), "S": (1, 3), "L": (3, 3), "R": (5, 3), "E": (7, 3)}  # number and bits of edgebreaker's symbols
AS_MANY_AS_THERE_ARE = -1
ALWAYS_ZERO = bytes([1, 1, 1, 1, 0x40, 1, 0])  # symbols: untagged, 1 bit, 1 value with all of 4096, 1 byte
LATTICE = struct.pack("<4fB", 0, 0, 0, 1023, 10)
CHEAP_PLACES = bytes([1, 1, 1]) + ALWAYS_ZERO + struct.pack("<2i", 0, 1) + LATTICE  # all points at one place


def varint(value: int) -> bytes:
    low, rest = value & 0x7F, value >> 7
    return bytes([low | 0x80]) + varint(rest) if rest else bytes([low])


@dataclass(frozen=True)
class Draco:
    """Fields of a Draco mesh in the order of its bytes; claims are of the symbols, unless others are told."""

    symbols: str
    head: bytes = b"DRACO\2\2\1\1\0\0"
    traversal: int = 0
    points: int = AS_MANY_AS_THERE_ARE
    faces: int = AS_MANY_AS_THERE_ARE
    seams: int = 0
    count: int = AS_MANY_AS_THERE_ARE  # of symbols
    splits: int = AS_MANY_AS_THERE_ARE
    handles: bytes = b"\0"
    contexts: bytes | None = None  # instead of the symbols' bits
    attributes: bytes = bytes([1, 0xFF, 0, 0, 1, 0, 9, 3, 0, 0, 2])
    places: bytes = CHEAP_PLACES

    def pack(self) -> bytes:
        """Return the bytes."""
        s = self.symbols
        made = 3 * s.count("E") + s.count("L") + s.count("R")
        found = (made - s.count("S"), len(s), len(s), s.count("S"))
        claims = (self.points, self.faces, self.count, self.splits)
        points, faces, count, splits = (b if a < 0 else a for a, b in zip(claims, found, strict=True))
        bits = sum_of_bits(s)
        return b"".join(
            (self.head, bytes([self.traversal]), varint(points), varint(faces), bytes([self.seams]), varint(count))
            + (varint(splits), self.handles, varint(len(bits)) + bits if self.contexts is None else b"", b"\xff\1\x11")
            + (self.contexts or b"", self.attributes, self.places)
        )


def sum_of_bits(symbols: str) -> bytes:
    value, shift = 0, 0
    for symbol in symbols:
        number, bits = CODES[symbol]
        value, shift = value | number << shift, shift + bits
    return value.to_bytes((shift + 7) // 8, "little")


FAN = Draco("E" + "R" * 400)
SLOW = Draco("E" * 6000 + "E" + "R" * 20_000 + "SCC" * 6000)  # each S gives 20,000 corners another vertex


def cloud(points: int, method: str) -> bytes:
    """A valid cloud of ten points that claims so many."""
    numbers = np.random.default_rng(0).random((10, 3))
    data = DracoPy.encode(numbers, None, quantization_bits=10, preserve_order=method == "sequential")
    return data[:11] + points.to_bytes(4, "little") + data[15:] + b"\0" * 1100


def sequential_mesh() -> bytes:
    return bytes(DracoPy.encode(np.eye(3), np.array([[0, 1, 2]]), quantization_bits=10, compression_level=0))


def bombs() -> dict[str, tuple[bytes, str]]:
    """Return Draco bytes and the words that refuse them."""
    few, other, lies = "so few bytes", "attributes other than", "not those it claims"
    position = FAN.attributes[5:10]
    half = 1 << 31
    alphabet = bytes([1, 1, 1, 1, 18]) + varint(1 << 30) + b"\3" * 50
    changed = {
        "150 M faces": (replace(FAN, faces=150_000_000, contexts=b"\0" * 10_000), few),
        "150 M points": (replace(FAN, points=150_000_000), few),
        "4 G points at splits": (replace(FAN, splits=(1 << 32) - 1), few),
        "faces that it has not got": (replace(FAN, faces=100_000), lies),
        "points that it has not got": (replace(FAN, points=100_000), lies),
        "splits that it has not got": (replace(FAN, splits=400), lies),
        "symbols that it has not got": (replace(FAN, faces=100_000, count=100_000), lies),
        "more symbols than faces": (replace(FAN, count=1 << 62), lies),
        "handles that it has not got": (replace(FAN, handles=varint(half)), lies),
        "a handle to nowhere": (replace(FAN, handles=bytes([1, 1, 1, 0])), lies),
        "a context of 2 G symbols": (replace(FAN, traversal=2, contexts=varint(half) + ALWAYS_ZERO), lies),
        "a split that nothing is left for": (Draco("ES"), lies),
        "a face without an edge to be put to": (Draco("C"), lies),
        "joins without end": (SLOW, "joined again"),
        "255 attributes with seams": (replace(FAN, seams=255), other),
        "4 G attributes": (replace(FAN, attributes=bytes([1, 0xFF, 0, 0]) + varint((1 << 32) - 1) + position), other),
        "255 decoders": (replace(FAN, attributes=bytes([255]) + FAN.attributes[1:]), other),
        "255 components": (replace(FAN, attributes=FAN.attributes[:7] + b"\xff\0\0\2"), other),
        "normals": (replace(FAN, attributes=FAN.attributes[:5] + b"\1" + FAN.attributes[6:]), other),
        "64-bit floats": (replace(FAN, attributes=FAN.attributes[:6] + b"\x0a" + FAN.attributes[7:]), other),
        "raw floats": (replace(FAN, attributes=FAN.attributes[:-1] + b"\0"), other),
        "an alphabet of 1 G symbols": (replace(FAN, places=alphabet), "do not fill"),
        "another prediction": (replace(FAN, places=b"\4" + CHEAP_PLACES[1:]), "not predicted"),
        "a lattice of no width": (replace(FAN, places=CHEAP_PLACES[:-5] + struct.pack("<fB", np.nan, 10)), "lattice"),
        "a lattice of 31 bits": (replace(FAN, places=CHEAP_PLACES[:-1] + bytes([31])), "lattice"),
        "another traversal": (replace(FAN, traversal=1), "traversal"),
        "metadata": (replace(FAN, head=FAN.head[:-1] + b"\x80"), "metadata"),
        "another version": (replace(FAN, head=b"DRACO\1\1\1\1\0\0"), "version 2"),
        "a byte more": (replace(FAN, places=CHEAP_PLACES + b"\0"), "do not fill"),
        "a byte less": (replace(FAN, places=CHEAP_PLACES[:-1]), "do not fill"),
    }
    made = {name: (mesh.pack(), words) for name, (mesh, words) in changed.items()}
    made["a mesh of another coding"] = (sequential_mesh(), "sequential")
    for method in ("sequential", "kd-tree"):
        made[f"a {method} cloud of 200 M points"] = (cloud(200_000_000, method), "point cloud")
    return made


def reel_of(*meshes: bytes) -> bytes:
    """Return a file of one group with these Draco meshes, its sums right."""
    file = io.BytesIO()
    with ReelWriter(file, HEADER) as writer:
        writer.add_group(0, len(meshes), pack(DracoGroup(Form.DRACO, 0, 0.001, meshes)))
    return file.getvalue()


def flat(side: int) -> Mesh:
    """A flat grid of `side` x `side` vertices on a lattice of step 1: Draco needs a byte for hundreds of its faces."""
    x, y = np.meshgrid(np.arange(side), np.arange(side))
    corner = np.arange(side * side).reshape(side, side)
    a, b, c, d = (corner[i : side - 1 + i, j : side - 1 + j].ravel() for i in (0, 1) for j in (0, 1))
    vertices = np.stack([x.ravel(), y.ravel(), 0 * x.ravel()], axis=1).astype(np.float64)
    return Mesh.of(vertices, np.concatenate([np.stack([a, b, c], 1), np.stack([b, d, c], 1)]))


def main() -> None:
    """Print names, bytes and words."""
    honest = {name: encode_mesh(flat(side), 1.0) for name, side in (("small", 5), ("by valence", 60))}
    honest["by hand"] = FAN.pack()
    text = {name: [base64.b64encode(data).decode(), words] for name, (data, words) in bombs().items()}
    made = {"bombs": text, "honest": {n: base64.b64encode(d).decode() for n, d in honest.items()}}
    sys.stdout.write(json.dumps(made))


if __name__ == "__main__":
    main()
