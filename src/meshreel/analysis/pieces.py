"""Large connected pieces of frames, and the bodies that they make over an interval of a sequence without a background.

In: cleaned frames -> their pieces; the pieces of consecutive frames -> the body of each. Connectivity decides, not
distance: wheels in mesh share no vertex and are two bodies. Pieces that are one in any frame are one body in all.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int64

from ..format.checks import MOST_TRACKS
from ..geometry.topology import components, face_normals, linked
from ..types import Mesh

LEAST = 0.05  # of the area of the frame's largest piece: smaller ones are bits (guess)
LEAST_FACES = 500  # pieces of fewer are bits: a track of their own costs more than they do (guess)

Box = tuple[float, ...]  # m, six: the lower and the upper corner, along the axes


@dataclass(frozen=True, slots=True)
class Piece:
    """Place and size of a large connected piece of a frame."""

    box: Box  # of itself
    around: Box  # of itself and the bits that go with it
    vertices: int  # with these bits


def pieces_of(mesh: Mesh) -> tuple[Piece, ...]:
    """Return the large pieces of a cleaned frame; none where it is all one."""
    found = _found(mesh)
    if found is None:
        return ()
    counts = np.bincount(found.piece[found.labels])
    arounds = [around(found.boxes[found.piece == number]) for number in range(len(found.own))]
    rows = zip(found.boxes[found.own].tolist(), arounds, counts.tolist(), strict=True)
    return tuple(Piece(tuple(box), tuple(larger.tolist()), count) for box, larger, count in rows)


def piece_of_faces(mesh: Mesh) -> Int64[np.ndarray, " F"]:
    """Return for each face of a cleaned frame the number of its piece among those of `pieces_of`; 0 where it is one."""
    found = _found(mesh)
    if found is None:
        return np.zeros(len(mesh.faces), np.int64)
    return found.piece[found.labels[mesh.faces[:, 0]]]


@dataclass(frozen=True, slots=True)
class _Found:
    """The connected components of a frame, and how they make pieces."""

    labels: Int64[np.ndarray, " V"]  # the component of each vertex
    boxes: Float64[np.ndarray, "C 6"]  # m, of each
    own: Int64[np.ndarray, " P"]  # the component that each piece is, but for bits
    piece: Int64[np.ndarray, " C"]  # the piece of each component: its own, or the nearest one


def _found(mesh: Mesh) -> _Found | None:
    """Return the pieces of a frame; None where it is all one."""
    labels = components(mesh.faces, len(mesh.vertices))
    if labels.max(initial=0) == 0:
        return None
    of_faces = labels[mesh.faces[:, 0]]
    areas, faces = np.bincount(of_faces, face_normals(mesh)[1]), np.bincount(of_faces)
    own = np.flatnonzero((areas >= LEAST * areas.max()) & (faces >= LEAST_FACES))
    if len(own) < 2:
        return None
    order = np.argsort(labels, kind="stable")
    starts = np.searchsorted(labels[order], np.arange(len(areas)))
    boxes = np.concatenate(
        [best.reduceat(mesh.vertices[order], starts, axis=0) for best in (np.minimum, np.maximum)], axis=1
    )
    return _Found(labels, boxes, own, _nearest(boxes, own))


def _nearest(boxes: Float64[np.ndarray, "C 6"], own: Int64[np.ndarray, " P"]) -> Int64[np.ndarray, " C"]:
    """Return the number of the piece that each component goes with: the one with the nearest box, then middle."""
    lows, highs = boxes[:, :3], boxes[:, 3:]
    gaps = np.maximum(np.maximum(lows[own] - highs[:, None], lows[:, None] - highs[own]), 0.0)
    middles = lows + highs
    gap, apart = ((offsets**2).sum(axis=2) for offsets in (gaps, middles[own] - middles[:, None]))
    found = np.lexsort((apart, gap), axis=-1)[:, 0]
    found[own] = np.arange(len(own))
    return found


def bodies_of(frames: Sequence[tuple[Piece, ...]]) -> list[Int64[np.ndarray, " P"]] | None:
    """Number the pieces of consecutive frames by the bodies that they belong to; None where all are one body.

    A piece is one body with that of the next frame that is most like it in place and size, and with that of the frame
    before: so each body is in all frames, and pieces that melt together or fall apart are one.
    """
    counts = [len(pieces) for pieces in frames]
    if min(counts, default=0) < 2:
        return None
    starts, links = np.cumsum([0, *counts]), list[tuple[int, int]]()
    boxes = [np.array([piece.box for piece in pieces]) for pieces in frames]
    for number in range(len(frames) - 1):
        apart = unlike(boxes[number], boxes[number + 1])
        here, there = starts[number], starts[number + 1]
        links += [(here + k, there + int(best)) for k, best in enumerate(apart.argmin(axis=1))]
        links += [(here + int(best), there + k) for k, best in enumerate(apart.argmin(axis=0))]
    label = linked(np.array(links, np.int64).reshape(-1, 2), int(starts[-1]))
    if not 1 < label.max() + 1 <= MOST_TRACKS:
        return None
    return np.split(label, starts[1:-1])


def unlike(some: Float64[np.ndarray, "P 6"], others: Float64[np.ndarray, "Q 6"]) -> Float64[np.ndarray, "P Q"]:
    """Return how far boxes are from being the same, m^2: the sum over both corners of their squared distance."""
    return ((some[:, None] - others) ** 2).sum(axis=2)


def around(boxes: Float64[np.ndarray, "P 6"]) -> Float64[np.ndarray, "6"]:
    """Return the box around some boxes."""
    return np.concatenate([boxes[:, :3].min(axis=0), boxes[:, 3:].max(axis=0)])
