"""Parsers of STL, binary and text, and of OFF. In: the bytes of a file. Out: Polygons; STL's are to be welded."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np

from .polygons import Lines, Polygons, Unreadable, eight_bits, whole

_HEADER, _COUNT = 80, 4  # bytes
_FACET = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
_VERTEX = re.compile(rb"vertex\s+(\S+)\s+(\S+)\s+(\S+)", re.IGNORECASE)


def parse_stl(data: bytes) -> Polygons:
    """Return the triangles of an STL file. Normals are not reported as dropped: they follow from the corners."""
    body = data[_HEADER + _COUNT :]
    count = int.from_bytes(data[_HEADER : _HEADER + _COUNT], "little")
    if len(data) >= _HEADER + _COUNT and len(body) == count * _FACET.itemsize:
        return _binary(data, count)
    text = data.removeprefix(b"\xef\xbb\xbf").lstrip()
    if text[:5].lower() == b"solid" and b"\0" not in data:
        return _parse_text(text)
    have = len(body) // _FACET.itemsize
    if len(data) < _HEADER + _COUNT or have < count:
        held = f"its {len(data)} bytes hold {have} triangles where bytes 80 to 83, their count, say {count}"
        raise Unreadable(f"no text ('solid') of STL, and {held}: it was cut, or is no STL file")
    behind = body[count * _FACET.itemsize :].strip(b"\r\n\t \0")
    return _binary(data, count).naming({f"{len(behind)} bytes behind the triangles"} if behind else set())


def _binary(data: bytes, count: int) -> Polygons:
    """Return the triangles of a binary file with their colours, as VisCAM and Magics write them."""
    facets = np.frombuffer(data, dtype=_FACET, count=count, offset=_HEADER + _COUNT)
    bits, mark = facets["attribute"].astype(np.int64), data[:_HEADER].find(b"COLOR=")
    channels = np.stack([bits >> shift & 31 for shift in (10, 5, 0)], axis=1) * 255 // 31
    colored, surface = bits >> 15 == 1, _soup(facets["corners"].astype(np.float64).reshape(-1, 3))
    if mark >= 0:  # Magics has red last, and one colour for the faces that have the bit
        whole_file = np.frombuffer(data[mark + 6 : mark + 9].ljust(3, b"\xff"), np.uint8)
        channels, colored = np.where(colored[:, None], whole_file, channels[:, ::-1]), np.ones(count, bool)
    if not colored.any():
        return surface
    return replace(surface, colors=channels.astype(np.uint8).repeat(3, axis=0), colored=colored.repeat(3))


def _parse_text(data: bytes) -> Polygons:
    if not re.search(rb"end\s*solid", data, re.IGNORECASE):
        raise Unreadable("text STL has no 'endsolid' (truncated?)")
    words = _VERTEX.findall(data)
    facets = len(re.findall(rb"end\s*facet", data, re.IGNORECASE))
    if len(words) != 3 * facets:
        raise Unreadable(f"text STL has {len(words)} vertices for {facets} triangles")
    try:
        vertices = np.array([[float(word) for word in row] for row in words], dtype=np.float64)
    except ValueError as error:
        raise Unreadable(f"text STL: {error}") from None
    return _soup(vertices.reshape(-1, 3))


def _soup(vertices: np.ndarray) -> Polygons:
    count = len(vertices)
    return Polygons(vertices, np.arange(count), np.full(count // 3, 3, dtype=np.int64))


def parse_off(data: bytes) -> Polygons:
    """Return the surface of an OFF file, with its colours."""
    found = re.match(rb"\s*(?:#[^\n]*\n\s*)*(ST)?(C)?(N)?(4)?(n)?OFF(?![A-Za-z])([ \t]+BINARY)?", data)
    if found is None:
        raise Unreadable(f"OFF header expected, found {data[:12]!r}")
    has_places, has_colors, has_normals, *others = found.groups()
    if any(others):
        kind = "in binary" if others[2] else "of four, or any number of, dimensions"
        raise Unreadable(f"OFF {kind} is not read")
    lines = Lines.of(b" " * found.end() + data[found.end() :])
    filled = np.flatnonzero(lines.ends > lines.starts)
    if len(filled) == 0:
        raise Unreadable("OFF file ends before its counts (truncated?)")
    head, _ = lines.values(filled[:1])
    if len(head) < 2 or (head < 0).any():
        raise Unreadable(f"OFF counts expected, found {lines.line(int(filled[0]))!r}")
    vertex_count, face_count = whole(head[:2], "OFF count").tolist()
    if len(filled) < 1 + vertex_count + face_count:
        announced = f"{vertex_count} vertices and {face_count} faces"
        raise Unreadable(f"OFF announces {announced} but has {len(filled) - 1} lines")
    values, counts = lines.values(filled[1 : 1 + vertex_count])
    if (counts < 3).any():
        raise Unreadable(f"OFF vertex {int(np.argmax(counts < 3))} has fewer than 3 coordinates")
    begins, first_color = np.cumsum(counts) - counts, 6 if has_normals else 3
    vertices = values[begins[:, None] + np.arange(3)]
    colors, read = None, first_color
    if has_colors and (counts >= first_color + 3).all():
        own = values[begins[:, None] + np.arange(first_color, first_color + 3)]
        colors, read = eight_bits(_counted(own)), first_color + 4
    dropped = {"normals"} if has_normals else set()
    dropped |= {"texture coordinates"} if has_places else set()
    if not has_places and (counts > read).any():
        dropped.add("numbers behind the vertices")
    chosen = filled[1 + vertex_count : 1 + vertex_count + face_count]
    surface = Polygons(vertices, *_faces(lines, chosen), frozenset(dropped), colors)
    return _with_face_colors(surface, lines, chosen)


def _counted(values: np.ndarray) -> np.ndarray:
    """Return colours as whole numbers if they are any beyond 1: 0 to 255, otherwise fractions."""
    return values.astype(np.int64) if (values > 1).any() and (values == np.floor(values)).all() else values


def _faces(lines: Lines, chosen: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    values, counts = lines.values(chosen)
    begins = np.cumsum(counts) - counts
    sizes = whole(values[begins], "OFF corner count")
    if (sizes + 1 > counts).any():
        face = int(np.argmax(sizes + 1 > counts))
        raise Unreadable(f"OFF face {face} announces {sizes[face]} corners but has {counts[face] - 1} (truncated?)")
    place = np.arange(len(values)) - np.repeat(begins, counts)  # within its line
    return whole(values[(place > 0) & (place <= np.repeat(sizes, counts))], "OFF index"), sizes


def _with_face_colors(surface: Polygons, lines: Lines, chosen: np.ndarray) -> Polygons:
    """Return the surface with the colours behind the corners of its faces: three numbers, or four."""
    values, counts = lines.values(chosen)
    begins, behind = np.cumsum(counts) - counts, counts - surface.sizes - 1
    if not len(counts) or (behind == 0).all():
        return surface
    if (behind < 3).any():
        return surface.naming({"face colors"})  # of some faces, or numbers in a table that the file does not have
    places = (begins + surface.sizes + 1)[:, None] + np.arange(3)
    return replace(surface, face_colors=eight_bits(_counted(values[places]), "face"))
