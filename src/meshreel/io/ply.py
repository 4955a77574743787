"""Parser of PLY, text and binary, with any other properties and elements. In: the bytes of a file. Out: Polygons."""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np

from .. import _core
from .polygons import Dropped, Lines, Polygons, Unreadable, eight_bits, shares_of, whole

_TYPES = {
    **dict.fromkeys(("char", "int8"), "i1"),
    **dict.fromkeys(("uchar", "uint8"), "u1"),
    **dict.fromkeys(("short", "int16"), "i2"),
    **dict.fromkeys(("ushort", "uint16"), "u2"),
    **dict.fromkeys(("int", "int32"), "i4"),
    **dict.fromkeys(("uint", "uint32"), "u4"),
    **dict.fromkeys(("float", "float32"), "f4"),
    **dict.fromkeys(("double", "float64"), "f8"),
}
_DIGITS = 18  # of a number of rows; longer ones do not fit 64-bit integers
_INDICES = ("vertex_indices", "vertex_index")
_COLORS = (("red", "green", "blue"), ("r", "g", "b"), ("diffuse_red", "diffuse_green", "diffuse_blue"))
_DROPS = {
    "normals": {"nx", "ny", "nz"},
    "transparency": {"alpha"},
    "texture coordinates": {"s", "t", "u", "v", "texture_u", "texture_v", "texcoord"},
}


@dataclass(frozen=True, slots=True)
class _Property:
    name: str
    dtype: np.dtype
    count: np.dtype | None  # of a list's length; None where it is a single value


@dataclass(frozen=True, slots=True)
class _Element:
    name: str
    rows: int
    properties: list[_Property]


def parse_ply(data: bytes) -> Polygons:
    end = re.search(rb"end_header[ \t]*(\r\n|\n|\r)", data)
    if not re.match(rb"ply\s", data) or end is None:
        raise Unreadable("PLY header does not run from 'ply' to 'end_header' (truncated?)")
    encoding, elements = _header(data[: end.start()].decode("utf-8", "replace").splitlines()[1:])
    body = _Text(data[end.end() :]) if encoding == "ascii" else _Binary(data[end.end() :])
    vertices, corners, sizes, colors = np.zeros((0, 3)), np.zeros(0, np.int64), np.zeros(0, np.int64), None
    for element in elements:
        if element.name == "vertex":
            columns, _, _ = body.read(element, None)
            if not {"x", "y", "z"} <= columns.keys():
                raise Unreadable("PLY vertices have no x, y, z")
            vertices = np.stack([columns[axis] for axis in "xyz"], axis=1).astype(np.float64)
            names = next((group for group in _COLORS if {*group} <= columns.keys()), None)
            if names is not None:
                colors = eight_bits(_of_kind(element, np.stack([columns[name] for name in names], axis=1), names[0]))
        elif element.name == "face":
            name = next((p.name for p in element.properties if p.name in _INDICES and p.count), None)
            if name is None and element.rows:
                raise Unreadable(f"PLY faces have no list called {' or '.join(_INDICES)}")
            _, corners, sizes = body.read(element, name)
        else:
            body.read(element, None)
    return Polygons(vertices, corners, sizes, _dropped(elements), colors)


def _of_kind(element: _Element, values: np.ndarray, name: str) -> np.ndarray:
    """Return the values of a property in the kind that the header names: text is read as float64."""
    dtype = next(field.dtype for field in element.properties if field.name == name)
    if dtype.kind not in "iu" or values.dtype == dtype:
        return values
    limits = np.iinfo(dtype)
    return (shares_of(values, limits.max) * limits.max).round().astype(dtype)


def _header(lines: list[str]) -> tuple[str, list[_Element]]:
    encoding, elements = "", list[_Element]()
    for words in (line.split() for line in lines):
        match words:
            case ["format", ("ascii" | "binary_little_endian" | "binary_big_endian") as encoding, _]:
                pass
            case ["element", name, rows] if rows.isdecimal() and len(rows) <= _DIGITS:
                elements.append(_Element(name, int(rows), []))
            case ["property", "list", count, kind, name] if count in _TYPES and kind in _TYPES and elements:
                elements[-1].properties.append(_Property(name, _dtype(kind, encoding), _dtype(count, encoding)))
            case ["property", kind, name] if kind in _TYPES and elements:
                elements[-1].properties.append(_Property(name, _dtype(kind, encoding), None))
            case [] | ["comment", *_] | ["obj_info", *_]:
                pass
            case _:
                raise Unreadable(f"PLY header has {' '.join(words)[:60]!r}")
    if not encoding:
        raise Unreadable("PLY header names no format")
    return encoding, elements


def _dtype(kind: str, encoding: str) -> np.dtype:
    return np.dtype((">" if encoding == "binary_big_endian" else "<") + _TYPES[kind])


def _dropped(elements: list[_Element]) -> Dropped:
    names = {p.name for e in elements if e.rows for p in e.properties}
    faces = {p.name for e in elements if e.rows and e.name == "face" for p in e.properties}
    others = {f"element {e.name!r}" for e in elements if e.rows and e.name not in ("vertex", "face")}
    others |= {"colors of faces"} if faces & {name for group in _COLORS for name in group} else set()
    return frozenset({words for words, fields in _DROPS.items() if fields & names} | others)


Columns = dict[str, np.ndarray]


class _Text:
    """Body of an ASCII file; elements must be read in their order."""

    def __init__(self, data: bytes) -> None:
        self._lines = Lines.of(data, comment="\0")  # PLY has comments in its header only
        self._filled = np.flatnonzero(self._lines.ends > self._lines.starts)

    def read(self, element: _Element, wanted: str | None) -> tuple[Columns, np.ndarray, np.ndarray]:
        """Return the single values of an element by name, and the items (flat) and lengths of the list `wanted`."""
        chosen, self._filled = self._filled[: element.rows], self._filled[element.rows :]
        if len(chosen) < element.rows:
            raise Unreadable(f"PLY announces {element.rows} {element.name} rows but has {len(chosen)} (truncated?)")
        values, counts = self._lines.values(chosen)
        ends = np.cumsum(counts)
        place, padded = ends - counts, np.append(values, 0.0)  # place: the next unread value of each row
        columns, items, sizes = Columns(), np.zeros(0, np.int64), np.zeros(0, np.int64)
        for field in element.properties:
            if (place >= ends).any():
                raise _short(element, int(np.argmax(place >= ends)))
            value = padded[place]
            place = place + 1
            if field.count is None:
                columns[field.name] = value
                continue
            length = whole(value, "PLY list length")
            if ((length < 0) | (place + length > ends)).any():
                raise _short(element, int(np.argmax((length < 0) | (place + length > ends))))
            if field.name == wanted:
                listed = np.repeat(place - (np.cumsum(length) - length), length) + np.arange(int(length.sum()))
                items, sizes = whole(padded[listed], "PLY index"), length
            place = place + length
        return columns, items, sizes


class _Binary:
    """Body of a binary file; elements must be read in their order."""

    def __init__(self, data: bytes) -> None:
        self._data, self._at = data, 0

    def read(self, element: _Element, wanted: str | None) -> tuple[Columns, np.ndarray, np.ndarray]:
        least = element.rows * sum((p.count or p.dtype).itemsize for p in element.properties)
        if self._at + least > len(self._data):
            raise Unreadable(f"PLY announces {element.rows} {element.name} rows but the file is too short (truncated?)")
        if element.rows == 0 or not element.properties:
            return {p.name: np.zeros(0) for p in element.properties}, np.zeros(0, np.int64), np.zeros(0, np.int64)
        lengths = self._lengths_of_first_row(element)
        fields = [(f"{k}", p.dtype, (n,)) for k, (p, n) in enumerate(zip(element.properties, lengths, strict=True))]
        counts = [(f"n{k}", p.count or np.dtype("V0")) for k, p in enumerate(element.properties)]
        row = np.dtype([part for pair in zip(counts, fields, strict=True) for part in pair])
        if self._at + row.itemsize * element.rows <= len(self._data):
            rows = np.frombuffer(self._data, dtype=row, count=element.rows, offset=self._at)
            if all((rows[f"n{k}"] == n).all() for k, n in enumerate(lengths) if element.properties[k].count):
                self._at += row.itemsize * element.rows
                return _even_rows(element, rows, wanted)
        return self._uneven_rows(element, wanted)

    def _lengths_of_first_row(self, element: _Element) -> list[int]:
        at, lengths = self._at, []
        for field in element.properties:
            length = 1
            if field.count is not None:
                end, order = at + field.count.itemsize, "big" if field.count.byteorder == ">" else "little"
                length, at = int.from_bytes(self._data[at:end], order), end  # type: ignore[arg-type]
            lengths.append(length)
            at += length * field.dtype.itemsize
            if at > len(self._data):
                raise _short(element, 0)
        return lengths

    def _uneven_rows(self, element: _Element, wanted: str | None) -> tuple[Columns, np.ndarray, np.ndarray]:
        """Read rows of different lengths: where a row begins depends on the row before."""
        if wanted is None and element.name == "vertex":
            raise Unreadable("PLY vertices with lists of different lengths are not read")
        lists = [(p.name, p.count is not None) for p in element.properties]
        number = 0 if wanted is None else lists.index((wanted, True))
        sizes = [(p.count.itemsize if p.count else 0, p.dtype.itemsize) for p in element.properties]
        fields = np.array(sizes, dtype=np.int64)
        is_big = any(p.count is not None and p.count.byteorder == ">" for p in element.properties)
        rest = np.frombuffer(self._data, dtype=np.uint8)[self._at :]
        items, lengths, size, bad = _core.read_lists(rest, fields, element.rows, number, is_big)
        if bad >= 0:
            raise _short(element, bad)
        self._at += size
        if wanted is None:
            return {}, np.zeros(0, np.int64), np.zeros(0, np.int64)
        values = items.view(element.properties[number].dtype)
        return {}, whole(values, "PLY index"), lengths.view(np.int64)  # of the same size, by its usual name


def _even_rows(element: _Element, rows: np.ndarray, wanted: str | None) -> tuple[Columns, np.ndarray, np.ndarray]:
    columns, items, sizes = Columns(), np.zeros(0, np.int64), np.zeros(0, np.int64)
    for k, field in enumerate(element.properties):
        if field.count is None:
            columns[field.name] = rows[f"{k}"][:, 0]
        elif field.name == wanted:
            block = rows[f"{k}"]
            items, sizes = whole(block.reshape(-1), "PLY index"), np.full(len(block), block.shape[1], dtype=np.int64)
    return columns, items, sizes


def _short(element: _Element, row: int) -> Unreadable:
    return Unreadable(f"PLY {element.name} {row} is too short (truncated?)")
