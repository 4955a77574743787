"""Decoded surface that no frame has: where cameras saw through, where they look and never measure, and shards.

In: the frames of a group beside what is decoded of them. Out: for each frame the faces that may not be shown, whatever
it costs to say so.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, Float64, Int32, Int64

from ...geometry.topology import components, connected_faces
from .shown_frame import ShownFrame

SHARD = 1e-5  # squared diagonals: half a square centimetre of a body that faces the wrong way shows (guess)
HOLE = 0.002  # squared diagonals of surface, half a foot, missed where it lacks, seen where it is not (guess)
SELDOM = 0.25  # share of the frames in which cameras face surface, below which its measurements are noise (guess)
OFTEN = 0.3  # share of the frames in which cameras must face it, for that to be said (guess)
POOLED = 3  # rings of faces around each that are judged together, so that no crumbs are left (guess)


def ghosts(frames: Sequence[ShownFrame], faces: Int32[np.ndarray, "F 3"], far: float | None) -> Bool[np.ndarray, "T F"]:
    """Mark decoded faces, in regions larger than `HOLE` or `SHARD`, that the frames lack.

    Of noisy bodies these are faces farther than `far`, squared, where a camera saw through, and such as cameras face
    and hardly ever measure. Of clean ones, which have no `far`, they are shards: faces that face away from the frame's
    surface or have no counterpart there.
    """
    if far is None:
        return _large(np.stack([frame.wrong() for frame in frames]), frames, faces, SHARD)
    through = np.stack([(frame.apart > far) & frame.knows_free for frame in frames])
    gone = _large(through | _unseen(frames, faces, far), frames, faces, HOLE)
    for row, frame in zip(gone, frames, strict=True):
        row |= _crumbs(row, frame.areas, faces)
    return gone


def _large(
    found: Bool[np.ndarray, "T F"], frames: Sequence[ShownFrame], faces: Int32[np.ndarray, "F 3"], least: float
) -> Bool[np.ndarray, "T F"]:
    """Return the regions, connected in space and time, that reach an area, squared diagonals, in some frame."""
    labels = regions(faces, found)
    largest = np.zeros(labels.max() + 1)
    for row, frame in zip(labels, frames, strict=True):
        largest = np.maximum(largest, np.bincount(row[row >= 0], frame.areas[row >= 0], len(largest)))
    return found & np.append(largest >= least, False)[labels]


def _unseen(frames: Sequence[ShownFrame], faces: Int32[np.ndarray, "F 3"], far: float) -> Bool[np.ndarray, "T F"]:
    """Return the faces that cameras often face and hardly ever measure, in the frames in which they do not."""
    faced, there = (np.stack(each) for each in zip(*(frame.measured(far) for frame in frames), strict=True))
    counts = (faced.sum(axis=0), (faced & there).sum(axis=0), np.full(len(faces), len(frames)))
    often, seen, most = (_pooled(each, faces) for each in counts)
    return ~there & (seen < SELDOM * often) & (often >= OFTEN * most)


def _pooled(counts: Int64[np.ndarray, " F"], faces: Int32[np.ndarray, "F 3"]) -> Float64[np.ndarray, " F"]:
    """Return sums over the faces near each."""
    found = counts.astype(np.float64)
    for _ in range(POOLED):
        found = np.bincount(faces.reshape(-1), found.repeat(3))[faces].sum(axis=1)
    return found


def _crumbs(
    gone: Bool[np.ndarray, " F"], areas: Float64[np.ndarray, " F"], faces: Int32[np.ndarray, "F 3"]
) -> Bool[np.ndarray, " F"]:
    """Return the faces of bits that would be left at the rim of dropped faces."""
    kept, count = np.flatnonzero(~gone), int(faces.max()) + 1
    rim, labels = np.zeros(count, bool), connected_faces(faces[kept], count)
    rim[faces[gone]] = True
    sizes = np.bincount(labels, areas[kept])
    beside = np.bincount(labels, rim[faces[kept]].any(axis=1)) > 0
    found = np.zeros_like(gone)
    found[kept] = (beside & (sizes < HOLE))[labels]
    return found


def regions(faces: Int32[np.ndarray, "F 3"], far: Bool[np.ndarray, "T F"]) -> Int64[np.ndarray, "T F"]:
    """Label regions of faces that share a vertex or are the same face in the next frame; -1 outside."""
    count = int(faces.max()) + 1
    frames, at = np.nonzero(far)
    corners = frames[:, None] * count + faces[at]
    stays = far[1:] & far[:-1]
    earlier, same = np.nonzero(stays)
    ends = earlier * count + faces[same, 0]
    links = np.stack([ends, ends + count, ends], axis=1)
    used, inverse = np.unique(np.concatenate([corners, links]), return_inverse=True)
    triples = inverse.reshape(-1, 3).astype(np.int32)
    labels = np.full(far.shape, -1)
    labels[far] = components(triples, len(used))[triples[: len(at), 0]]
    return labels
