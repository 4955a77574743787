"""Large connected pieces of frames, and the bodies that they form over an interval of a sequence without a background.

In: cleaned frames -> their pieces; the pieces of consecutive frames -> the body of each. Connectivity decides, not
distance: gear wheels that mesh share no vertex and are two bodies. Pieces connected in any frame are one body in all.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int64

from ..format.checks import MOST_TRACKS
from ..geometry.topology import components, face_normals, linked
from ..types import Mesh

LEAST = 0.05  # share of the area of the frame's largest piece: smaller pieces are bits (guess)
LEAST_FACES = 500  # smaller pieces are bits: a separate track would cost more than they do (guess)

Box = tuple[float, ...]  # m, six: the lower and the upper corner, along the axes


@dataclass(frozen=True, slots=True)
class Piece:
    """Place and size of a large connected piece of a frame."""

    box: Box  # of the piece alone
    around: Box  # of the piece and its bits
    vertices: int  # of the piece and its bits


def pieces_of(mesh: Mesh) -> tuple[Piece, ...]:
    """Return the large pieces of a cleaned frame; none if it is a single piece."""
    split = _found(mesh)
    if split is None:
        return ()
    counts = np.bincount(split.piece[split.labels])
    arounds = [around(split.boxes[split.piece == number]) for number in range(len(split.own))]
    rows = zip(split.boxes[split.own].tolist(), arounds, counts.tolist(), strict=True)
    return tuple(Piece(tuple(box), tuple(larger.tolist()), count) for box, larger, count in rows)


def piece_of_faces(mesh: Mesh) -> Int64[np.ndarray, " F"]:
    """Return the number of each face's piece among those of `pieces_of`; 0 for a frame of a single piece."""
    split = _found(mesh)
    if split is None:
        return np.zeros(len(mesh.faces), np.int64)
    return split.piece[split.labels[mesh.faces[:, 0]]]


@dataclass(frozen=True, slots=True)
class _Found:
    """The connected components of a frame, and their assignment to pieces."""

    labels: Int64[np.ndarray, " V"]  # the component of each vertex
    boxes: Float64[np.ndarray, "C 6"]  # m, of each component
    own: Int64[np.ndarray, " P"]  # the large component of each piece
    piece: Int64[np.ndarray, " C"]  # the piece of each component: its own, or the nearest


def _found(mesh: Mesh) -> _Found | None:
    """Return the pieces of a frame; None if it is a single piece."""
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


def _nearest(boxes: Float64[np.ndarray, "C 6"], pieces: Int64[np.ndarray, " P"]) -> Int64[np.ndarray, " C"]:
    """Return the number of each component's piece: the piece with the nearest box, then the nearest middle."""
    lows, highs = boxes[:, :3], boxes[:, 3:]
    gaps = np.maximum(np.maximum(lows[pieces] - highs[:, None], lows[:, None] - highs[pieces]), 0.0)
    middles = lows + highs
    gap, middle_gap = ((offsets**2).sum(axis=2) for offsets in (gaps, middles[pieces] - middles[:, None]))
    nearest = np.lexsort((middle_gap, gap), axis=-1)[:, 0]
    nearest[pieces] = np.arange(len(pieces))
    return nearest


def bodies_of(frames: Sequence[tuple[Piece, ...]]) -> list[Int64[np.ndarray, " P"]] | None:
    """Number the pieces of consecutive frames by the bodies that they belong to; None if all are one body.

    A piece belongs to one body with the piece most like it in place and size in the next frame, and in the frame
    before: so each body is in all frames, and pieces that merge or split are one body.
    """
    counts = [len(pieces) for pieces in frames]
    if min(counts, default=0) < 2:
        return None
    starts, links = np.cumsum([0, *counts]), list[tuple[int, int]]()
    boxes = [np.array([piece.box for piece in pieces]) for pieces in frames]
    for number in range(len(frames) - 1):
        distances = unlike(boxes[number], boxes[number + 1])
        first, second = starts[number], starts[number + 1]
        links += [(first + k, second + int(best)) for k, best in enumerate(distances.argmin(axis=1))]
        links += [(first + int(best), second + k) for k, best in enumerate(distances.argmin(axis=0))]
    label = linked(np.array(links, np.int64).reshape(-1, 2), int(starts[-1]))
    if not 1 < label.max() + 1 <= MOST_TRACKS:
        return None
    return np.split(label, starts[1:-1])


def unlike(boxes: Float64[np.ndarray, "P 6"], others: Float64[np.ndarray, "Q 6"]) -> Float64[np.ndarray, "P Q"]:
    """Return the dissimilarity of boxes, m^2: the sum over both corners of their squared distance."""
    return ((boxes[:, None] - others) ** 2).sum(axis=2)


def around(boxes: Float64[np.ndarray, "P 6"]) -> Float64[np.ndarray, "6"]:
    return np.concatenate([boxes[:, :3].min(axis=0), boxes[:, 3:].max(axis=0)])
