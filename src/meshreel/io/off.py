"""Parser of text OFF and its variants (COFF, NOFF, STOFF ...). In: the bytes of a file. Out: Polygons."""

from __future__ import annotations

import re

import numpy as np

from .polygons import Polygons, Unreadable
from .text_lines import Lines, whole

_DROPS = {"ST": "texture coordinates", "C": "vertex colors", "N": "normals"}


def parse_off(data: bytes) -> Polygons:
    """Return the surface of an OFF file."""
    found = re.match(rb"\s*(?:#[^\n]*\n\s*)*(ST)?(C)?(N)?OFF\b", data)
    if found is None:
        raise Unreadable(f"OFF header expected, found {data[:12]!r}")
    dropped = {_DROPS[mark.decode()] for mark in found.groups() if mark}
    lines = Lines.of(b" " * found.end() + data[found.end() :])
    filled = np.flatnonzero(lines.ends > lines.starts)
    if len(filled) == 0:
        raise Unreadable("OFF file ends before its counts (truncated?)")
    head, _ = lines.values(filled[:1])
    if len(head) < 2 or (head < 0).any():
        raise Unreadable(f"OFF counts expected, found {lines.line(int(filled[0]))!r}")
    vertex_count, face_count = whole(head[:2], "OFF count").tolist()
    if len(filled) < 1 + vertex_count + face_count:
        raise Unreadable(
            f"OFF announces {vertex_count} vertices and {face_count} faces but has {len(filled) - 1} lines"
        )
    chosen = filled[1 : 1 + vertex_count]
    values, counts = lines.values(chosen)
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
