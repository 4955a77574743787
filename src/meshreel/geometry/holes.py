"""Holes of a mesh: the loops of its border that are short enough to be closed. In: a mesh. Out: one with more faces."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterator

import numpy as np
from jaxtyping import Bool, Float64, Int64

from ..types import Mesh


def close_holes(
    mesh: Mesh,
    perimeter: float,
    stay_open: Callable[[Float64[np.ndarray, "N 3"]], Bool[np.ndarray, " N"]] | None = None,
) -> Mesh:
    """Close the simple loops of the border of at most this perimeter, in the unit of the vertices, by a fan each.

    Longer loops stay open: soles missing from a capture, sleeves, the rim of what a camera saw. So do loops whose fan
    has a face with its middle where `stay_open` says so.
    """
    loops = [loop for loop in _loops(mesh) if _length(mesh.vertices[loop]) <= perimeter]
    middles = [mesh.vertices[loop].mean(axis=0) for loop in loops]
    if stay_open is not None and loops:
        rims = [mesh.vertices[loop] for loop in loops]
        fans = [(rim + np.roll(rim, -1, axis=0) + middle) / 3 for rim, middle in zip(rims, middles, strict=True)]
        free = np.split(stay_open(np.concatenate(fans)), np.cumsum([len(fan) for fan in fans])[:-1])
        closed = [number for number, each in enumerate(free) if not each.any()]
        loops, middles = [loops[number] for number in closed], [middles[number] for number in closed]
    count = len(mesh.vertices)
    faces = [  # wound against the loop
        np.stack([np.roll(loop, -1), loop, np.full(len(loop), count + number)], axis=1)
        for number, loop in enumerate(loops)
    ]
    return Mesh.of(np.concatenate([mesh.vertices, *(m[None] for m in middles)]), np.concatenate([mesh.faces, *faces]))


def _length(loop: Float64[np.ndarray, "n 3"]) -> float:
    return float(np.linalg.norm(loop - np.roll(loop, -1, axis=0), axis=1).sum())


def _loops(mesh: Mesh) -> Iterator[Int64[np.ndarray, " n"]]:
    """Yield the half-edges without an opposite one as loops that meet no vertex twice, each by its vertices.

    Where several loops meet at a vertex, a walk along the border cuts off a loop whenever it comes back to itself.
    """
    f = mesh.faces.astype(np.int64)
    half = np.concatenate([f[:, [0, 1]], f[:, [1, 2]], f[:, [2, 0]]])
    count = len(mesh.vertices)
    border = half[~np.isin(half[:, 0] * count + half[:, 1], half[:, 1] * count + half[:, 0])]
    following = defaultdict[int, list[int]](list)
    for a, b in border[np.lexsort(border.T)[::-1]].tolist():
        following[a].append(b)
    for start in sorted(following):
        chain, place = [start], {start: 0}
        while following[chain[-1]]:
            vertex = following[chain[-1]].pop()
            if vertex not in place:
                place[vertex] = len(chain)
                chain.append(vertex)
                continue
            loop = chain[place[vertex] :]
            del chain[place[vertex] + 1 :]
            for gone in loop[1:]:
                del place[gone]
            if len(loop) >= 3:
                yield np.array(loop)
