"""Heads with fields at the edges of what they may be: of each golden file, every field of every record in turn.

A head is a tree of plain values, packed without a check; bytes in place of a value are written as they are. With the
name of a golden file, `python -m tests.format.heads` writes its heads for the player's test.
"""

from __future__ import annotations

import math
import struct
import sys
import zlib
from collections.abc import Iterator
from dataclasses import asdict
from random import Random
from typing import Any

from meshreel.container.reader import ReelReader
from meshreel.container.sources import BytesSource
from meshreel.errors import FormatError
from meshreel.format.budget import LIMITS
from meshreel.format.checks import LARGEST, MOST_CHANGES, MOST_NESTED, MOST_TRACKS, SMALLEST
from meshreel.format.kinds import EXACT, Array, Bytes, Choice, Kind, List, Number, Text, Varint
from meshreel.format.layout import (
    ChunkKind,
    Form,
    Header,
    Index,
    IndexEntry,
    Preamble,
)
from meshreel.format.records import Nested, record_fields, unpack, unpack_all
from tests.golden import GOLDEN

Tree = dict[str, Any]
Change = tuple[tuple[str | int, ...], Any]  # a path in the tree, and the value there
SEEDS = 250  # heads with several changes, of each golden file

WHOLE = (0, 1, 2, 3, 127, 128, 254, 255, 256, 65_534, 65_535, LIMITS.audio, LIMITS.audio + 1, (1 << 32) - 1)
WHOLE += (EXACT - 1, EXACT, EXACT + 1, (1 << 63) - 1, 1 << 63, (1 << 64) - 1)
EDGES = (0.0, 1.0, SMALLEST, LARGEST, 5e-324, sys.float_info.max, math.inf, math.nan)
REAL = sorted({sign * math.nextafter(x, to) for x in EDGES for to in (x, 0, math.inf) for sign in (-1, 1)}, key=str)
OVERLONG = (b"\x80\x00", b"\x81\x80\x00", b"\xff" * 9 + b"\x01", b"\x80" * 9 + b"\x02", b"\xff" * 10, b"\x80")
NESTED = [f'{{"a":{"[" * n}{"]" * n}}}' for n in (MOST_NESTED - 1, MOST_NESTED, 5000)]
NESTED += [f'{{"a":{"[" * n}"\\"[[[",7{"]" * n}}}' for n in (MOST_NESTED - 1, MOST_NESTED)]
NESTED += ['{"a":' * n + "{}" + "}" * n for n in (MOST_NESTED - 1, MOST_NESTED, 5000)]
NUMBERS = ("0", "-0", "01", "1.", ".5", "1e5", "1E+5", "1e-999", "1e308", "1.8e308", "1e999", "-1e999", "1" * 308, "+1")
NUMBERS += ("1" * 310, "-" + "9" * 4301, "1.7976931348623158e308", "1.7976931348623159e308", "NaN", "Infinity", "0x1")
STRINGS = (r"\ud800", r"\udc00", r"\ud83d\ude00", r"\\ud800", r"\u12", r"\x", "é😀", "\x7f", "\t", r"\"", "\\")
TEXTS = ["", "{}", "[]", "7", "null", " {} ", "{}x", "{} \0", "\ufeff{}", "{", '{"a":1,}', '{"a":tru}', "{'a':1}"]
TEXTS += ['{"":[]}', '{"__proto__":1,"toString":2}', *NESTED, *(f'{{"a":{n}}}' for n in NUMBERS)]
TEXTS += [f'{{"a":["{s}"]}}' for s in STRINGS] + [f'{{"{s}":1}}' for s in STRINGS]
TEXTS += [r'{"\ud83d":"\ude00"}', '{"a":1e999,"a":1}', r'{"a":["\ud800"],"a":1}', f'{{"a":{"1" * 400},"a":1}}']
FRAMES = ("[0,1]", "[0.0,1e0]", "[-0,1]", "[0,1.5]", "[1,1]", "[-1,1]", "[0,1e308]", "[0]", "[0,1,2]", "7", "null")
FRAMES += ("[true,2]", '["0",1]', "[0,10000000000000000000000]", "[0,2.00]", "{}", "[[0],1]", "[0,9007199254740993]")
ROTATIONS = ("[]", "[1,0,0,0,1,0,0,0,1]", "[1.0,0,0,0,-1,0,0,0,-1e0]", "[1,0,0,0,1,0,0,0,-1]", "[1,0,0,0,1,0,0,0]")
ROTATIONS += ("[1,0,0,0,1,0,0,0,true]", "[2,0,0,0,1,0,0,0,0.5]", "[1,0,0,0,1,0,0,0,1.00000049]", "7", "null", "{}")
ROTATIONS += ("[1,0,0,0,1,0,0,0,1.000001]", f"[{'1' * 400},0,0,0,1,0,0,0,1]", "[NaN,0,0,0,1,0,0,0,1]")
EDITS = [*(f'{{"frames":{f}}}' for f in FRAMES), *(f'{{"rotation":{r}}}' for r in ROTATIONS), "{}", "[]", "7", "null"]
EDITS += ['{"speed":1}', '{"frames":[0,1],"frames":[0,2]}', '{"frames":[0,2],"rotation":[]}', '""']
TEXTS += [f'{{"edit":{edit}}}' for edit in EDITS] + [r'{"\u0065dit":{}}', '{"a":{"edit":{}}}']
RAW_TEXTS = tuple(
    struct.pack("<H", len(raw)) + raw for raw in (b'{"\xff":1}', b'{"a":"\xed\xa0\x80"}', b"{}\xc3", b"\x80")
)


def tree(data: bytes) -> Tree:
    """Take the head of a file apart."""
    preamble, start = unpack(Preamble, data)
    header, start = unpack(Header, data, start)
    index = unpack_all(Index, data[start : preamble.head_size - 4])
    return {"preamble": asdict(preamble), "header": asdict(header), "chunks": list(asdict(index)["chunks"])}


def assemble(head: Tree) -> bytes:
    """Put a head together, with a checksum that matches, and its size if that was not changed."""
    body = _raw(Nested(Header), head["header"])
    count = head.get("count", len(head["chunks"]))
    body += struct.pack("<I", count) + b"".join(_raw(Nested(IndexEntry), entry) for entry in head["chunks"])
    preamble = dict(head["preamble"])
    if "size" not in head:
        preamble["head_size"] = 14 + len(body) + 4
    data = _raw(Nested(Preamble), preamble) + body
    return data + struct.pack("<I", zlib.crc32(data))


def _raw(kind: Kind, value: Any) -> bytes:
    """Pack a value, which need not be one that the format admits."""
    if isinstance(value, bytes) and not isinstance(kind, Bytes):
        return value
    if isinstance(kind, Nested):
        return b"".join(_raw(field.kind, value[field.name]) for field in record_fields(kind.record))
    if isinstance(kind, Choice):
        return _raw(kind.number, value)
    if isinstance(kind, Text):
        return _raw(kind.length, len(value.encode())) + value.encode()
    if isinstance(kind, Array | List):
        items = b"".join(_raw(kind.item, item) for item in value)
        return items if isinstance(kind, Array) else _raw(kind.length, len(value)) + items
    if isinstance(kind, Varint):
        return _leb128(value)
    return struct.pack("<" + kind.code, value) if isinstance(kind, Number) else bytes(value)


def _leb128(value: int) -> bytes:
    more = bytearray()
    while value >= 0x80:
        more.append(value & 0x7F | 0x80)
        value >>= 7
    return bytes([*more, value])


def changes(head: Tree) -> Iterator[Change]:
    """Yield each single change of a head."""
    for name, value in (("magic", b"REEL\r\n\x1a\r"), ("version", 0), ("version", 2), ("version", 255)):
        yield ("preamble", name), value
    yield from ((("preamble", "flags"), flags) for flags in (0, 1, 2, 3, 128, 255))
    for field in record_fields(Header):
        yield from _of(field.kind, head["header"][field.name], ("header", field.name))
    for number, entry in enumerate(head["chunks"]):
        for field in record_fields(IndexEntry):
            yield from _of(field.kind, entry[field.name], ("chunks", number, field.name))
        for other in range(len(head["chunks"]) + 2):
            yield ("chunks", number, "depends_on"), (other,)
            yield ("chunks", number, "depends_on"), (*entry["depends_on"], other)
    chunks = head["chunks"]
    for k in range(len(chunks)):
        for j in {k + 1, len(chunks) - 1} - {k, len(chunks)}:
            swapped = list(chunks)
            swapped[k], swapped[j] = chunks[j], chunks[k]
            yield ("chunks",), swapped
        yield ("chunks",), chunks[:k] + chunks[k + 1 :]
        yield ("chunks",), [*chunks[: k + 1], *chunks[k:]]
        yield ("chunks",), [*chunks, chunks[k]]
    empty = {"form": Form.EMPTY, "frames": 1, "track": 0, "depends_on": (), "layers": ({"size": 1, "crc": 0},)}
    for kind in (*ChunkKind, 0, 9, 255):
        yield ("chunks",), [*chunks, empty | {"kind": kind}]
        yield ("chunks",), [empty | {"kind": kind}, *chunks]
    alone = [empty | {"kind": ChunkKind.GROUP, "track": track} for track in range(MOST_TRACKS + 1)]
    floor = empty | {"kind": ChunkKind.STATIC, "form": Form.DRACO, "frames": 0}
    patches = [floor | {"form": Form.PATCH, "depends_on": (number,)} for number in range(MOST_CHANGES + 1)]
    long = [empty | {"kind": ChunkKind.GROUP, "frames": 65_535}] * 3
    for more in ([], alone, alone[:-1], [floor, *patches, alone[0]], [floor, *patches[:-1], alone[0]], long, long[1:]):
        yield ("chunks",), more
    yield from ((("count",), count) for count in (0, len(chunks) - 1, len(chunks) + 1, (1 << 32) - 1))
    for size in (0, 17, 18, LIMITS.head, LIMITS.head + 1, (1 << 32) - 1):
        yield ("size",), size


def _of(kind: Kind, value: Any, path: tuple[str | int, ...]) -> Iterator[Change]:
    """Yield the changes of a field and of what is in it."""
    if isinstance(kind, Choice):
        kind = kind.number
    if isinstance(kind, Nested):
        for field in record_fields(kind.record):
            yield from _of(field.kind, value[field.name], (*path, field.name))
    elif isinstance(kind, Text):
        yield from ((path, text) for text in TEXTS)
        yield from ((path, _raw(kind.length, len(raw)) + raw) for raw in RAW_TEXTS)
    elif isinstance(kind, Number) and kind.code in "fd":
        singles = (x for x in REAL if kind.code == "d" or not abs(x) > 3e38 or math.isinf(x))
        yield from ((path, x) for x in (*singles, -value))
    elif isinstance(kind, Number | Varint):
        low, high = (0, 1 << 64)
        if isinstance(kind, Number):
            high = 1 << 8 * kind.least
            low, high = (-high // 2, high // 2) if kind.code == "q" else (0, high)
        edges = {low, low + 1, high - 1, high - 2, value - 1, value + 1, *WHOLE, *(-x for x in WHOLE)}
        yield from ((path, x) for x in sorted(edges) if low <= x < high)
        if isinstance(kind, Varint):
            yield from ((path, raw) for raw in OVERLONG)
    elif isinstance(kind, Array | List):
        for k, item in enumerate(value[:4]):
            yield from _of(kind.item, item, (*path, k))
        yield path, tuple(reversed(value))
        if isinstance(kind, List):
            lists: list[Any] = [(), value[1:], value[:-1], (*value, *value[:1]), value * 2, (0,) * 40 if value else ()]
            if path[-1] == "intervals":
                lists += [(1,) * n for n in range(1, 40)] + [(EXACT,), (1 << 62,) * 8, (EXACT // 8,) * 8]
            yield from ((path, items) for items in lists if not (items and items[0] == 0 and path[-1] == "layers"))
            yield from ((path, _raw(kind.length, count)) for count in (1, 200, 255))


def changed(head: Tree, path: tuple[str | int, ...], value: Any) -> Tree:
    """Return a head with another value at a path. Raises LookupError or TypeError where the path is gone."""
    if path[0] == "size":
        return head | {"size": value, "preamble": head["preamble"] | {"head_size": value}}
    made = dict(head)
    at: Any = made
    for step in path[:-1]:
        at[step] = dict(at[step]) if isinstance(at[step], dict) else list(at[step])
        at = at[step]
    if isinstance(at, list):
        at[path[-1]]
    at[path[-1]] = value
    return made


def heads(name: str, seeds: int = SEEDS) -> Iterator[bytes]:
    """Yield the heads with one change of a golden file, then some with two to four."""
    head = tree((GOLDEN / name).read_bytes())
    single, random = list(changes(head)), Random(name)
    for path, value in single:
        yield assemble(changed(head, path, value))
    for _ in range(seeds):
        made = head
        for path, value in random.sample(single, random.randint(2, 4)):
            try:
                made = changed(made, path, value)
                assemble(made)
            except (LookupError, TypeError, AttributeError):
                continue
        try:
            yield assemble(made)
        except (LookupError, TypeError, AttributeError):
            continue


def verdict(head: bytes) -> str:
    """Return the frames and tracks that Python finds in a file whose chunks are lost, or "refused"."""
    try:
        reader = ReelReader(BytesSource(head))
    except FormatError:
        return "refused"
    return f"{reader.frame_count} {len(reader.tracks)}"


FILES = sorted(path.relative_to(GOLDEN).as_posix() for path in GOLDEN.rglob("*.reel"))


def main(name: str) -> None:
    """Write the heads of a golden file to standard output, each behind its size and that of the verdict behind it."""
    for head in heads(name):
        words = verdict(head).encode()
        sys.stdout.buffer.write(struct.pack("<II", len(head), len(words)) + head + words)


FILES = sorted(path.relative_to(GOLDEN).as_posix() for path in GOLDEN.rglob("*.reel"))


if __name__ == "__main__":
    main(sys.argv[1])
