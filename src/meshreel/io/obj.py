"""Parser of Wavefront OBJ without a Python loop over lines, which would take ten times as long."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
from jaxtyping import Bool, Float32, Float64, Int64, UInt8

from .polygons import Dropped, Lines, Polygons, Unreadable, eight_bits

Numbers = Int64[np.ndarray, " N"]  # of lines, or one for each of them

_KNOWN = (
    *("vt", "vn", "vp", "l", "p", "o", "g", "s", "mg", "usemtl", "mtllib", "usemap", "maplib", "lod", "bevel"),
    *("cstype", "deg", "bmat", "step", "curv", "curv2", "surf", "parm", "trim", "hole", "scrv", "sp", "end", "con"),
    *("c_interp", "d_interp", "shadow_obj", "trace_obj", "ctech", "stech", "call", "csh"),
)
_DROPS = {"vn": "normals", "l": "lines", "p": "points"}  # words of what is not kept
_DROPS |= {"curv": "curves", "curv2": "curves", "usemap": "texture maps", "maplib": "texture maps"}
_REFUSED = {"surf": "a free-form surface", "call": "a call of another file", "csh": "a command"}


def parse_obj(data: bytes) -> Polygons:
    if b"\\" in data:
        data = re.sub(rb"\\\r?\n", b" ", data)
    lines = Lines.of(data)
    first = lines.text[lines.starts]
    second = lines.text[np.minimum(lines.starts + 1, lines.ends)]
    bare = (second == ord(" ")) | (second == ord("\t")) | (lines.ends == lines.starts + 1)
    is_vertex, is_face = bare & (first == ord("v")), bare & (first == ord("f"))
    is_place = (first == ord("v")) & (second == ord("t"))
    vertices, colors, colored = _vertices(lines, np.flatnonzero(is_vertex))
    faces = np.flatnonzero(is_face)
    corners, sizes = _faces(lines, faces, np.cumsum(is_vertex)[is_face], len(vertices))
    uv = _places(lines, np.flatnonzero(is_place), faces, np.repeat(np.cumsum(is_place)[is_face], sizes))
    others = np.flatnonzero(~(is_vertex | is_face | is_place | (lines.starts == lines.ends)))
    dropped, libraries, uses = _others(lines, others)
    names = {name: number for number, name in enumerate(dict.fromkeys(uses.values()))}
    numbers = np.array([-1, *(names[name] for name in uses.values())], np.int64)
    material_of = numbers[np.searchsorted(np.array([*uses], np.int64), faces)]
    surface = Polygons(vertices, corners, sizes, dropped, colors, uv, colored=colored, libraries=libraries)
    return replace(surface, materials=tuple(names), material_of=material_of)


def _vertices(
    lines: Lines, chosen: Numbers
) -> tuple[Float64[np.ndarray, "N 3"], UInt8[np.ndarray, "N 3"] | None, Bool[np.ndarray, " N"] | None]:
    """Return positions of vertices, and colours: three numbers behind the position; a mask if some have none."""
    values, counts = lines.values(chosen, skip=1)
    _check_counts(lines, chosen, counts, "coordinates instead of 3")
    begins, colored = np.cumsum(counts) - counts, counts >= 6
    positions = values[begins[:, None] + np.arange(3)]
    if not colored.any():
        return positions, None, None
    colors = np.zeros((len(counts), 3), np.uint8)
    colors[colored] = eight_bits(values[begins[colored, None] + np.arange(3, 6)])
    return positions, colors, None if colored.all() else colored


def _faces(lines: Lines, chosen: Numbers, defined: Numbers, count: int) -> tuple[Int64[np.ndarray, " C"], Numbers]:
    """Return corners (from 0) and polygon sizes; `defined` vertices precede each face line, `count` are in the file."""
    values, sizes = lines.values(chosen, skip=1, stop="/")
    _check_counts(lines, chosen, sizes, "corners instead of 3 or more")
    bad = np.flatnonzero((np.abs(values) > count) | (values == 0) | (values != np.floor(values)) | np.isnan(values))
    if len(bad):
        where = chosen[np.searchsorted(np.cumsum(sizes), bad[0], side="right")]
        text = f"line {where + 1} ({lines.line(where)!r}) refers to vertex {values[bad[0]]:g}"
        raise Unreadable(f"{text}, but the file has {count} vertices")
    corners = values.astype(np.int64)
    return np.where(corners > 0, corners - 1, corners + np.repeat(defined, sizes)), sizes


def _check_counts(lines: Lines, chosen: Numbers, counts: Numbers, wanted: str) -> None:
    """Raise Unreadable for the first line with fewer than 3 numbers."""
    short = np.flatnonzero(counts < 3)
    if len(short):
        where = chosen[short[0]]
        raise Unreadable(f"line {where + 1} ({lines.line(where)!r}) has {counts[short[0]]} {wanted}")


def _places(
    lines: Lines, chosen: Int64[np.ndarray, " W"], faces: Numbers, defined: Int64[np.ndarray, " C"]
) -> Float32[np.ndarray, "C 2"] | None:
    """Return each corner's texture coordinates, NaN if it has none; `defined` coordinates precede each corner."""
    if not len(chosen):
        return None
    values, counts = lines.values(chosen, skip=2)
    begins, (named, _) = np.cumsum(counts) - counts, lines.values(faces, skip=1, stop="/", field=1)
    values = np.concatenate([values, [np.nan, np.nan]])  # behind a line without numbers
    places = np.where((counts >= 2)[:, None], values[begins[:, None] + np.arange(2)], np.nan)
    numbers = np.where(named > 0, named - 1, named + defined)
    good = (numbers >= 0) & (numbers < len(places)) & (numbers == np.floor(numbers)) & (named != 0)
    uv = np.full((len(numbers), 2), np.nan, np.float32)
    with np.errstate(over="ignore"):
        uv[good] = places[numbers[good].astype(np.int64)]
    return uv


def _others(lines: Lines, chosen: Int64[np.ndarray, " N"]) -> tuple[Dropped, tuple[str, ...], dict[int, str]]:
    """Return the kinds of dropped data in the other lines, material files, and the materials named, by line."""
    text, starts = lines.text, lines.starts
    is_normal = (text[starts[chosen]] == ord("v")) & (text[np.minimum(starts[chosen] + 1, len(text) - 1)] == ord("n"))
    dropped, libraries, uses = {_DROPS["vn"]} if is_normal.any() else set(), list[str](), dict[int, str]()
    for number in chosen[~is_normal]:  # no Python loop over normals: there may be one for each vertex
        words = lines.written(number).split(maxsplit=1)
        keyword, rest = words[0] if words else "", words[1].strip() if len(words) > 1 else ""
        if keyword not in _KNOWN:
            raise Unreadable(f"line {number + 1} ({lines.line(number)!r}) begins with no OBJ keyword")
        if keyword in _REFUSED:
            raise Unreadable(f"line {number + 1} ({lines.line(number)!r}) is {_REFUSED[keyword]}, which is not read")
        dropped |= {_DROPS[keyword]} if keyword in _DROPS else set()
        if keyword == "mtllib":
            libraries.append(rest)
        elif keyword == "usemtl":
            uses[int(number)] = rest
    return frozenset(dropped), tuple(libraries), uses
