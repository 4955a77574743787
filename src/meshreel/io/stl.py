"""Parser of STL, binary and text. In: the bytes of a file. Out: separate triangles, to be welded to a surface."""

from __future__ import annotations

import re

import numpy as np

from .polygons import Polygons, Unreadable

_HEADER, _COUNT = 80, 4  # bytes
_FACET = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
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
