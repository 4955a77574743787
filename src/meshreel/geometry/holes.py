"""Holes of a mesh: loops of its border that are short enough to close. In: a mesh. Out: one with additional faces."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterator

import numpy as np
from jaxtyping import Bool, Float64, Int64

from ..types import Mesh
from .topology import unique_edges


def close_holes(
    mesh: Mesh,
    perimeter: float,
    stay_open: Callable[[Float64[np.ndarray, "N 3"]], Bool[np.ndarray, " N"]] | None = None,
) -> Mesh:
    """Close the simple loops of the border of at most this perimeter, in the unit of the vertices, by least area.

    Longer loops stay open: soles missing from a capture, sleeves, the edge of a camera's view. So do loops whose faces
    would repeat an edge of the mesh, or have a middle where `stay_open` returns True. No vertex is added: cracks are
    zipped.
    """
    edges = unique_edges(mesh.faces)[0].astype(np.int64)
    edge_keys, patches = edges[:, 0] * len(mesh.vertices) + edges[:, 1], list[Int64[np.ndarray, "n 3"]]()
    for loop in _loops(mesh):
        rim = mesh.vertices[loop]
        if np.linalg.norm(rim - np.roll(rim, -1, axis=0), axis=1).sum() <= perimeter:
            pairs = np.sort(np.stack(np.broadcast_arrays(loop[:, None], loop[None])), axis=0)
            keys = pairs[0] * len(mesh.vertices) + pairs[1]
            exists = edge_keys[np.minimum(np.searchsorted(edge_keys, keys), len(edge_keys) - 1)] == keys
            patches.extend([loop[patch[:, ::-1]] for patch in [_least_area(rim, exists)] if len(patch)])
    if stay_open is not None and patches:
        middles = mesh.vertices[np.concatenate(patches)].mean(axis=1)
        free = np.split(stay_open(middles), np.cumsum([len(patch) for patch in patches])[:-1])
        patches = [patch for patch, is_open in zip(patches, free, strict=True) if not is_open.any()]
    return Mesh.of(mesh.vertices, np.concatenate([mesh.faces, *patches]))


def _least_area(rim: Float64[np.ndarray, "n 3"], taken: Bool[np.ndarray, "n n"]) -> Int64[np.ndarray, "m 3"]:
    """Return the faces of least area that close a loop, with its orientation (Barequet and Sharir 1995).

    No face has a diagonal that `exists` in the mesh; without such faces, return none.
    """
    count = len(rim)
    least, middle = np.zeros((count, count)), np.zeros((count, count), np.int64)
    for length in range(2, count):
        first = np.arange(count - length)
        between, last = first[:, None] + np.arange(1, length), first + length
        sides = rim[between] - rim[first][:, None], (rim[last] - rim[first])[:, None]
        areas = np.linalg.norm(np.cross(*sides), axis=2) / 2
        sums = least[first[:, None], between] + least[between, last[:, None]] + areas
        if length < count - 1:
            sums[taken[first, last]] = np.inf
        middle[first, last] = between[first, best := sums.argmin(axis=1)]
        least[first, last] = sums[first, best]
    if not np.isfinite(least[0, -1]):
        return np.zeros((0, 3), np.int64)
    faces, spans = [], [(0, count - 1)]
    while spans:
        start, end = spans.pop()
        if end - start >= 2:
            at = int(middle[start, end])
            faces.append((start, at, end))
            spans += [(start, at), (at, end)]
    return np.array(faces)


def _loops(mesh: Mesh) -> Iterator[Int64[np.ndarray, " n"]]:
    """Yield the half-edges without an opposite as loops that pass no vertex twice, each as its vertices.

    If several loops meet at a vertex, a walk along the border cuts off a loop whenever it returns to itself.
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
