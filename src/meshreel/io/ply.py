"""Parser of PLY, text and binary, with any other properties and elements. In: the bytes of a file. Out: Polygons."""

from __future__ import annotations

import re
from collections.abc import Collection
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Int64

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
_STRIPS = "tristrips"  # of the Stanford scanning repository
_COLORS = (("red", "green", "blue"), ("r", "g", "b"), ("diffuse_red", "diffuse_green", "diffuse_blue"))
_PLACES = (("s", "t"), ("u", "v"), ("texture_u", "texture_v"), ("texture_s", "texture_t"))
_ALPHA = (("alpha",), ("a",))
_CORNER_PLACES, _PICTURE = "texcoord", "texnumber"  # of faces, as MeshLab writes them
_WORDS = {
    **dict.fromkeys(("nx", "ny", "nz"), "normals"),
    **dict.fromkeys((name for names in _ALPHA for name in names), "transparency"),
    **dict.fromkeys((*(name for pair in _PLACES for name in pair), _CORNER_PLACES), "texture coordinates"),
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


def parse_ply(data: bytes, beside: tuple[str, ...] = ()) -> Polygons:
    """Return the surface of a file; `beside` are its pictures where the header names none."""
    lines, elements, body = _opened(data)
    comments = (re.match(r"\s*comment\s+TextureFile\s+(.+)", line) for line in lines)
    pictures = tuple(found[1].strip() for found in comments if found) or beside
    surface, kept = Polygons(np.zeros((0, 3)), np.zeros(0, np.int64), np.zeros(0, np.int64)), _Kept()
    vertex_places, full = None, [element.name for element in elements if element.rows]
    if twice := [name for name in ("vertex", "face", _STRIPS) if full.count(name) > 1]:
        raise Unreadable(f"PLY has several elements called {twice[0]}; export one of each")
    looks = {_CORNER_PLACES, _PICTURE, *(name for names in _COLORS for name in names)}
    painted = any(field.name in looks for each in elements if each.name == "face" for field in each.properties)
    if painted and "face" in full and _STRIPS in full:
        raise Unreadable("PLY has strips of triangles beside faces with colours or pictures; export triangles alone")
    for element in elements:
        if element.name == "vertex":
            surface, vertex_places = _vertices(body, element, surface, kept)
        elif element.name == "face":
            surface = _faces(body, element, surface, kept)
        elif element.name == _STRIPS:
            surface = _strips(body, element, surface, kept)
        else:
            body.read(element, ())
    surface = _placed(surface, vertex_places, pictures, kept)
    return surface.naming(_dropped(elements, kept))


def _opened(data: bytes) -> tuple[list[str], list[_Element], _Text | _Binary]:
    """Return the lines of a file's header, its elements, and its body."""
    end = re.search(rb"[\r\n][ \t]*end_header[ \t]*(\r\n|\n|\r)", data)
    if not re.match(rb"ply\s", data) or end is None:
        raise Unreadable("PLY header does not run from 'ply' to 'end_header' (truncated?)")
    lines = re.split(r"\r\n|\n|\r", data[: end.start()].decode("utf-8", "replace"))[1:]
    encoding, elements = _header(lines)
    return lines, elements, _Text(data[end.end() :]) if encoding == "ascii" else _Binary(data[end.end() :])


def parse_ply_points(data: bytes) -> tuple[np.ndarray, np.ndarray | None, np.ndarray | None, int]:
    """Return the places of a file's vertices, their normals and colours (8 bits) or None, and the number of faces."""
    _, elements, body = _opened(data)
    faces = sum(element.rows for element in elements if element.name in ("face", _STRIPS))
    for element in elements:
        if element.name != "vertex":
            body.read(element, ())
            continue
        kept = _Kept()
        chosen = [_named(element, names, kept) for names in ((("x", "y", "z"),), (("nx", "ny", "nz"),), _COLORS)]
        columns, _ = body.read(element, {name for names in chosen for name in names})
        places, normals, colors = (_stacked(columns, names) if names else None for names in chosen)
        if places is None:
            raise Unreadable("PLY vertices have no x, y, z")
        colors = None if colors is None else eight_bits(_of_kind(element, colors, chosen[2][0]))
        return places, normals, colors, faces
    raise Unreadable("PLY has no vertices")


_Kept = set[tuple[str, str]]  # element and property of what is read


def _named(element: _Element, groups: tuple[tuple[str, ...], ...], kept: _Kept) -> tuple[str, ...]:
    """Return the first group of properties that an element has as single values; they count as kept."""
    single = {field.name for field in element.properties if field.count is None}
    names = next((group for group in groups if {*group} <= single), ())
    kept |= {(element.name, name) for name in names}
    return names


def _stacked(columns: Columns, names: tuple[str, ...]) -> np.ndarray:
    return np.stack([columns[name] for name in names], axis=1)


def _vertices(
    body: _Text | _Binary, element: _Element, surface: Polygons, kept: _Kept
) -> tuple[Polygons, np.ndarray | None]:
    """Return the surface with its vertices and their colours, and the vertices' places in a picture."""
    places, names = _named(element, (("x", "y", "z"),), kept), _named(element, _COLORS, kept)
    uv, alpha = _named(element, _PLACES, set()), _named(element, _ALPHA, set())
    columns, _ = body.read(element, {*places, *names, *uv, *alpha})
    if not places:
        raise Unreadable("PLY vertices have no x, y, z")
    if alpha and _is_opaque(element, columns[alpha[0]], alpha[0]):  # some tools write it always
        kept.add((element.name, alpha[0]))
    colors = eight_bits(_of_kind(element, _stacked(columns, names), names[0])) if names else None
    surface = replace(surface, vertices=_stacked(columns, places).astype(np.float64), colors=colors)
    return surface, _stacked(columns, uv).astype(np.float32) if uv else None


def _is_opaque(element: _Element, alpha: np.ndarray, name: str) -> bool:
    kind = next(field.dtype.kind for field in element.properties if field.name == name)
    full = (255, 65535) if kind in "iu" else (1.0, 255.0)
    return len(alpha) > 0 and float(alpha.max()) in full and bool((alpha == alpha.max()).all())


def _faces(body: _Text | _Binary, element: _Element, surface: Polygons, kept: _Kept) -> Polygons:
    """Return the faces of vertices, with the colours, pictures and places that they have."""
    lists = {field.name for field in element.properties if field.count is not None}
    name = next((name for name in _INDICES if name in lists), None)
    if name is None and element.rows:
        raise Unreadable(f"PLY faces have no list called {' or '.join(_INDICES)}")
    colors = _named(element, _COLORS, kept)
    wanted = {name or "", _CORNER_PLACES} & lists | {*colors, _PICTURE} - lists
    columns, items = body.read(element, wanted)
    corners, sizes = items.get(name or "", _NOTHING)
    kept.add((element.name, name or ""))
    corners = np.concatenate([surface.corners, whole(corners, "PLY index")])  # strips may come first
    surface = replace(surface, corners=corners, sizes=np.concatenate([surface.sizes, sizes]))
    if _CORNER_PLACES in items:
        values, counts = items[_CORNER_PLACES]
        if np.array_equal(counts, 2 * sizes):
            surface = replace(surface, uv=values.reshape(-1, 2).astype(np.float32))
    if _PICTURE in columns:
        surface = replace(surface, material_of=whole(columns[_PICTURE], "PLY texnumber"))
    if colors and len(sizes):
        values = _of_kind(element, _stacked(columns, colors), colors[0], "face")
        surface = replace(surface, face_colors=eight_bits(values, "face"))
    return surface


def _strips(body: _Text | _Binary, element: _Element, surface: Polygons, kept: _Kept) -> Polygons:
    """Return the triangles of strips, which -1 separates."""
    name = next((field.name for field in element.properties if field.name in _INDICES and field.count), None)
    if name is None:
        raise Unreadable(f"PLY strips of triangles have no list called {' or '.join(_INDICES)}")
    _, items = body.read(element, {name})
    kept.add((element.name, name))
    values, sizes = items[name]
    corners = whole(values, "PLY index")
    # -1 also between the strips of two rows, so that no triangle has corners of both.
    corners = np.insert(corners, np.cumsum(sizes)[:-1], -1) if len(sizes) > 1 else corners
    rows = np.lib.stride_tricks.sliding_window_view(corners, 3) if len(corners) > 2 else np.zeros((0, 3), np.int64)
    begins = np.maximum.accumulate(np.where(corners < 0, np.arange(len(corners)) + 1, 0))[: len(rows)]
    is_odd = (np.arange(len(rows)) - begins) % 2 == 1
    triangles = np.where(is_odd[:, None], rows[:, [1, 0, 2]], rows)[(rows >= 0).all(axis=1)]
    corners = np.concatenate([surface.corners, triangles.reshape(-1)])
    return replace(surface, corners=corners, sizes=np.concatenate([surface.sizes, np.full(len(triangles), 3)]))


def _placed(surface: Polygons, places: np.ndarray | None, pictures: tuple[str, ...], kept: _Kept) -> Polygons:
    """Return a surface with the pictures that the header names, where its corners or vertices have places in them."""
    corners = surface.corners
    if not pictures or (surface.uv is None and places is None) or len(corners) == 0:
        return replace(surface, uv=None, material_of=None)
    uv = surface.uv
    if uv is None and places is not None:
        if not 0 <= corners.min() <= corners.max() < len(places):  # which `checked` refuses
            return surface
        uv = places[corners]
    kept |= {("vertex", name) for pair in _PLACES for name in pair} | {("face", _CORNER_PLACES), ("face", _PICTURE)}
    numbers = np.zeros(len(surface.sizes), np.int64) if surface.material_of is None else surface.material_of
    known = np.where((numbers >= 0) & (numbers < len(pictures)), numbers, -1)
    return replace(surface, uv=uv, material_of=known, pictures=pictures)


def _of_kind(element: _Element, values: np.ndarray, name: str, what: str = "vertex") -> np.ndarray:
    """Return the values of a property in the kind that the header names: text is read as float64."""
    dtype = next(field.dtype for field in element.properties if field.name == name)
    if dtype.kind not in "iu" or values.dtype == dtype:
        return values
    limits = np.iinfo(dtype)
    return (shares_of(values, limits.max, what) * limits.max).round().astype(dtype)


def _header(lines: list[str]) -> tuple[str, list[_Element]]:
    encoding, elements = "", list[_Element]()
    for words in (line.split() for line in lines):
        match words:
            case ["format", ("ascii" | "binary_little_endian" | "binary_big_endian") as encoding, _]:
                pass
            case ["element", name, rows] if rows.isdecimal() and len(rows) <= _DIGITS:
                elements.append(_Element(name, int(rows), []))
            # Without the first word as Unity's player of geometry sequences writes it.
            case ["property", "list", count, kind, name] | ["list", count, kind, name] if (
                count in _TYPES and kind in _TYPES and elements
            ):
                elements[-1].properties.append(_Property(name, _dtype(kind, encoding), _dtype(count, encoding)))
            case ["property", kind, name] | [kind, name] if kind in _TYPES and elements:
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


def _dropped(elements: list[_Element], kept: _Kept) -> Dropped:
    """Name the properties and elements that were not read."""
    dropped = set[str]()
    for element in elements:
        left = [field.name for field in element.properties if (element.name, field.name) not in kept]
        if element.rows and element.name not in ("vertex", "face", _STRIPS):
            dropped.add(f"element {element.name!r}")
        elif element.rows:
            dropped |= {_WORDS.get(name, f"property {name!r} of {element.name}") for name in left}
    return frozenset(dropped)


Columns = dict[str, np.ndarray]  # single values
Items = dict[str, tuple[np.ndarray, Int64[np.ndarray, " N"]]]  # items of lists, flat, and the length of each
_NOTHING = np.zeros(0, np.int64), np.zeros(0, np.int64)


class _Text:
    """Body of an ASCII file; elements must be read in their order."""

    def __init__(self, data: bytes) -> None:
        self._lines = Lines.of(data, comment="\0")  # PLY has comments in its header only
        self._filled = np.flatnonzero(self._lines.ends > self._lines.starts)

    def read(self, element: _Element, wanted: Collection[str]) -> tuple[Columns, Items]:
        """Return the single values and the lists of an element that have these names."""
        chosen, self._filled = self._filled[: element.rows], self._filled[element.rows :]
        if len(chosen) < element.rows:
            raise Unreadable(f"PLY announces {element.rows} {element.name} rows but has {len(chosen)} (truncated?)")
        values, counts = self._lines.values(chosen)
        ends = np.cumsum(counts)
        place, padded = ends - counts, np.append(values, 0.0)  # place: the next unread value of each row
        columns, items = Columns(), Items()
        for field in element.properties:
            if (place >= ends).any():
                raise _short(element, int(np.argmax(place >= ends)))
            value = padded[place]
            place = place + 1
            if field.count is None:
                if field.name in wanted:
                    columns[field.name] = value
                continue
            length = whole(value, "PLY list length")
            if ((length < 0) | (place + length > ends)).any():
                raise _short(element, int(np.argmax((length < 0) | (place + length > ends))))
            if field.name in wanted:
                within = np.arange(int(length.sum())) - np.repeat(np.cumsum(length) - length, length)
                items[field.name] = padded[np.repeat(place, length) + within], length
            place = place + length
        return columns, items


class _Binary:
    """Body of a binary file; elements must be read in their order."""

    def __init__(self, data: bytes) -> None:
        self._data, self._at = data, 0

    def read(self, element: _Element, wanted: Collection[str]) -> tuple[Columns, Items]:
        """Return the single values and the lists of an element that have these names."""
        least = element.rows * sum((p.count or p.dtype).itemsize for p in element.properties)
        if self._at + least > len(self._data):
            raise Unreadable(f"PLY announces {element.rows} {element.name} rows but the file is too short (truncated?)")
        if element.rows == 0 or not element.properties:
            return {name: np.zeros(0) for name in wanted}, dict.fromkeys(wanted, _NOTHING)
        if all(field.count is None for field in element.properties):
            row = np.dtype([(f"{k}", field.dtype) for k, field in enumerate(element.properties)])
            rows = np.frombuffer(self._data, row, element.rows, self._at)
            self._at += rows.nbytes
            return {field.name: rows[f"{k}"] for k, field in enumerate(element.properties) if field.name in wanted}, {}
        return self._rows_of_lists(element, wanted)

    def _rows_of_lists(self, element: _Element, wanted: Collection[str]) -> tuple[Columns, Items]:
        """Read rows of any lengths: where a row begins depends on the row before."""
        sizes = [(p.count.itemsize if p.count else 0, p.dtype.itemsize) for p in element.properties]
        fields = np.array(sizes, dtype=np.int64)
        is_big = any(p.count is not None and p.count.byteorder == ">" for p in element.properties)
        rest = np.frombuffer(self._data, dtype=np.uint8)[self._at :]
        columns, items, end = Columns(), Items(), self._at
        chosen = [k for k, field in enumerate(element.properties) if field.name in wanted]
        for number in chosen or [0]:
            values, lengths, size, bad = _core.read_lists(rest, fields, element.rows, number, is_big)
            if bad >= 0:
                raise _short(element, bad)
            field, end = element.properties[number], self._at + size
            if field.count is None:
                columns[field.name] = values.view(field.dtype)
            else:
                # Lengths of the same size, by their usual name.
                items[field.name] = values.view(field.dtype), lengths.view(np.int64)
        self._at = end
        return columns, items


def _short(element: _Element, row: int) -> Unreadable:
    return Unreadable(f"PLY {element.name} {row} is too short (truncated?)")
