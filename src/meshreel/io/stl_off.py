"""Parsers of STL, binary and text, and of OFF. In: the bytes of a file. Out: Polygons; STL's are to be welded."""

from __future__ import annotations

import re

import numpy as np

from .polygons import Lines, Polygons, Unreadable, whole

_HEADER, _COUNT = 80, 4  # bytes
_FACET = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
_OFF_DROPS = {"ST": "texture coordinates", "C": "vertex colors", "N": "normals"}
_VERTEX = re.compile(rb"vertex\s+(\S+)\s+(\S+)\s+(\S+)")


def parse_stl(data: bytes) -> Polygons:
    """Return the triangles of an STL file. Normals are not reported as dropped: they follow from the corners."""
    body = data[_HEADER + _COUNT :]
    count = int.from_bytes(data[_HEADER : _HEADER + _COUNT], "little")
    if len(body) == count * _FACET.itemsize and len(data) >= _HEADER + _COUNT:
        facets = np.frombuffer(body, dtype=_FACET)
        colored = frozenset({"face colors"} if (facets["attribute"] & 0x8000).any() else ())
        return _soup(facets["corners"].astype(np.float64).reshape(-1, 3), colored)
    if data.lstrip().startswith(b"solid") and b"\0" not in data:
        return _parse_text(data)
    have = len(body) // _FACET.itemsize
    raise Unreadable(f"binary STL announces {count} triangles but its {len(data)} bytes hold {have} (truncated?)")


def _parse_text(data: bytes) -> Polygons:
    if not re.search(rb"endsolid", data):
        raise Unreadable("text STL has no 'endsolid' (truncated?)")
    words = _VERTEX.findall(data)
    facets = len(re.findall(rb"endfacet", data))
    if len(words) != 3 * facets:
        raise Unreadable(f"text STL has {len(words)} vertices for {facets} triangles")
    try:
        vertices = np.array([[float(word) for word in row] for row in words], dtype=np.float64)
    except ValueError as error:
        raise Unreadable(f"text STL: {error}") from None
    return _soup(vertices.reshape(-1, 3), frozenset())


def _soup(vertices: np.ndarray, dropped: frozenset[str]) -> Polygons:
    count = len(vertices)
    return Polygons(vertices, np.arange(count), np.full(count // 3, 3, dtype=np.int64), dropped)


def parse_off(data: bytes) -> Polygons:
    """Return the surface of an OFF file."""
    found = re.match(rb"\s*(?:#[^\n]*\n\s*)*(ST)?(C)?(N)?OFF\b", data)
    if found is None:
        raise Unreadable(f"OFF header expected, found {data[:12]!r}")
    dropped = {_OFF_DROPS[mark.decode()] for mark in found.groups() if mark}
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
    vertices = values[(np.cumsum(counts) - counts)[:, None] + np.arange(3)]
    corners, sizes, colored = _faces(lines, filled[1 + vertex_count : 1 + vertex_count + face_count])
    return Polygons(vertices, corners, sizes, frozenset(dropped | ({"face colors"} if colored else set())))


def _faces(lines: Lines, chosen: np.ndarray) -> tuple[np.ndarray, np.ndarray, bool]:
    values, counts = lines.values(chosen)
    begins = np.cumsum(counts) - counts
    sizes = whole(values[begins], "OFF corner count")
    if (sizes + 1 > counts).any():
        face = int(np.argmax(sizes + 1 > counts))
        raise Unreadable(f"OFF face {face} announces {sizes[face]} corners but has {counts[face] - 1} (truncated?)")
    place = np.arange(len(values)) - np.repeat(begins, counts)  # within its line
    corners = values[(place > 0) & (place <= np.repeat(sizes, counts))]
    return whole(corners, "OFF index"), sizes, bool((counts > sizes + 1).any())
