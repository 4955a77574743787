"""Parser of Wavefront OBJ without a Python loop over lines, which would take ten times as long.

In: the bytes of a file. Out: Polygons. Reads `v/vt/vn` corners, negative indices, continued lines and any newline.
"""

from __future__ import annotations

import re

import numpy as np
from jaxtyping import Float64, Int64

from .polygons import Dropped, Polygons, Unreadable
from .text_lines import Lines

_KNOWN = (
    *("vt", "vn", "vp", "l", "p", "o", "g", "s", "mg", "usemtl", "mtllib", "usemap", "maplib", "lod", "bevel"),
    *("cstype", "deg", "bmat", "step", "curv", "curv2", "surf", "parm", "trim", "hole", "scrv", "sp", "end", "con"),
    *("c_interp", "d_interp", "shadow_obj", "trace_obj", "ctech", "stech", "call", "csh"),
)
_DROPS = {"vt": "texture coordinates", "vn": "normals", "usemtl": "materials", "l": "lines", "p": "points"}


def parse_obj(data: bytes) -> Polygons:
    """Return the surface of an OBJ file."""
    if b"\\" in data:
        data = re.sub(rb"\\\r?\n", b" ", data)
    lines = Lines.of(data)
    first = lines.text[lines.starts]
    second = lines.text[np.minimum(lines.starts + 1, lines.ends)]
    bare = (second == ord(" ")) | (second == ord("\t")) | (lines.ends == lines.starts + 1)
    is_vertex, is_face = bare & (first == ord("v")), bare & (first == ord("f"))
    vertices, dropped = _vertices(lines, np.flatnonzero(is_vertex))
    corners, sizes = _faces(lines, np.flatnonzero(is_face), np.cumsum(is_vertex)[is_face], len(vertices))
    known = is_vertex | is_face | (lines.starts == lines.ends)
    return Polygons(vertices, corners, sizes, dropped | _others(lines, first, second, ~known))


def _vertices(lines: Lines, chosen: Int64[np.ndarray, " V"]) -> tuple[Float64[np.ndarray, "V 3"], Dropped]:
    values, counts = lines.values(chosen, skip=1)
    short = np.flatnonzero(counts < 3)
    if len(short):
        where = chosen[short[0]]
        raise Unreadable(f"line {where + 1} ({lines.line(where)!r}) has {counts[short[0]]} coordinates instead of 3")
    begins = np.cumsum(counts) - counts
    return values[begins[:, None] + np.arange(3)], frozenset({"vertex colors"} if (counts >= 6).any() else ())


def _faces(
    lines: Lines, chosen: Int64[np.ndarray, " P"], defined: Int64[np.ndarray, " P"], count: int
) -> tuple[Int64[np.ndarray, " C"], Int64[np.ndarray, " P"]]:
    """Return corners (from 0) and polygon sizes; `defined` vertices precede each face line, `count` are in the file."""
    values, sizes = lines.values(chosen, skip=1, stop="/")
    short = np.flatnonzero(sizes < 3)
    if len(short):
        where = chosen[short[0]]
        raise Unreadable(f"line {where + 1} ({lines.line(where)!r}) has {sizes[short[0]]} corners instead of 3 or more")
    bad = np.flatnonzero((np.abs(values) > count) | (values == 0) | (values != np.floor(values)) | np.isnan(values))
    if len(bad):
        where = chosen[np.searchsorted(np.cumsum(sizes), bad[0], side="right")]
        raise Unreadable(
            f"line {where + 1} ({lines.line(where)!r}) refers to vertex {values[bad[0]]:g}, "
            f"but the file has {count} vertices"
        )
    corners = values.astype(np.int64)
    return np.where(corners > 0, corners - 1, corners + np.repeat(defined, sizes)), sizes


def _others(lines: Lines, first: np.ndarray, second: np.ndarray, other: np.ndarray) -> Dropped:
    """Return the data in the other lines that is dropped. Raises Unreadable for unknown statements."""
    dropped = set()
    for mark in ("t", "n"):  # no Python loop: there may be one for each vertex
        found = other & (first == ord("v")) & (second == ord(mark))
        dropped |= {_DROPS["v" + mark]} if found.any() else set()
        other = other & ~found
    for number in np.flatnonzero(other):
        keyword = next(iter(lines.line(number).split(maxsplit=1)), "")
        if keyword and keyword not in _KNOWN:
            raise Unreadable(f"line {number + 1} ({lines.line(number)!r}) begins with no OBJ keyword")
        dropped |= {_DROPS[keyword]} if keyword in _DROPS else set()
    return frozenset(dropped)
