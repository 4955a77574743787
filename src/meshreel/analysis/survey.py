"""Survey a sequence in one pass before coding: bounding box, empty frames, intervals, invalid input, scenes, bodies.

In -> out: MeshSequence -> Survey. Errors in any frame surface here, before minutes are spent on the first frames.
Bodies without a background are large connected pieces of cleaned frames. Connectivity decides, not distance: gear
wheels that mesh share no vertex and are two bodies. Pieces connected in any frame are one body in all. A scene is a
sequence of open surface most of which is in the same place in all frames; a lone body moves or is closed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from jaxtyping import Float64, Int64

from ..errors import InputError
from ..format.checks import MOST_TRACKS
from ..geometry import work
from ..geometry.strict import norm
from ..geometry.threads import ahead
from ..geometry.topology import boxes_of, clean, components, drop_unreferenced, face_normals, linked
from ..types import Mesh, MeshSequence, offset

UNLIKE = 30.0  # times the median size: a larger frame of a room must be in another unit; a guess
LARGEST_RATIO = 10.0  # largest ratio of the diagonals of two frames in one interval: a guess
LEAST = 0.05  # share of the area of the frame's largest piece: smaller pieces are bits (guess)
LEAST_FACES = 500  # smaller pieces are bits: a separate track would cost more than they do (guess)
Box = tuple[float, ...]  # m, six: the lower and the upper corner, along the axes


@dataclass(frozen=True, slots=True)
class Survey:
    """Facts about a whole sequence that the encoder needs before it codes the first frame."""

    low: Float64[np.ndarray, "3"]  # corner of the sequence's bounding box, m
    high: Float64[np.ndarray, "3"]  # the opposite corner, m
    diagonals: tuple[float, ...]  # of each frame's bounding box, m; 0 for a frame without surface
    flattened: tuple[int, ...] = ()  # frames whose faces all lack area: they count as empty
    scale: float | None = None  # m, unit of normalised coordinates; None: the bounding box's diagonal
    dropped: int = 0  # faces, over all frames, that are dropped: without area, or with the vertices of another face
    pieces: tuple[tuple[Piece, ...], ...] = ()  # of each frame, none of a single-piece frame; () for a scene

    @property
    def center(self) -> Float64[np.ndarray, "3"]:
        """Center of the bounding box, m: the origin of normalised coordinates."""
        return (self.low + self.high) / 2

    @property
    def diagonal(self) -> float:
        """Length of the bounding box's diagonal, m; 1 for a box without extent."""
        return norm(self.high - self.low) or 1.0

    @property
    def unit(self) -> float:
        return self.diagonal if self.scale is None else self.scale

    def is_bare(self, frame: int) -> bool:
        return self.diagonals[offset(frame, range(len(self.diagonals)))] == 0

    def normalise(self, mesh: Mesh) -> Mesh:
        """Return the mesh cleaned and in normalised coordinates: centered, in multiples of `unit`."""
        mesh = clean(mesh)
        return mesh.at((mesh.vertices - self.center) / self.unit)

    def intervals(self, size: int) -> list[range]:
        """Return even intervals of at most `size` frames, each of empty frames or of frames of similar size."""
        intervals = []
        breaks, least, most = [0], self.diagonals[0], self.diagonals[0]
        for number, diagonal in enumerate(self.diagonals):
            least, most = min(least, diagonal), max(most, diagonal)
            if most > LARGEST_RATIO * least:  # only one is empty, or sizes differ
                breaks.append(number)
                least = most = diagonal
        for start, stop in pairwise([*breaks, len(self.diagonals)]):
            parts = -(-(stop - start) // size)
            cuts = [start + (stop - start) * k // parts for k in range(parts + 1)]
            intervals += [range(a, b) for a, b in pairwise(cuts)]
        return intervals


def survey_sequence(sequence: MeshSequence, cleaned: bool = True) -> Survey:
    """Survey a sequence, a frame for each thread in memory. Raises InputError if it is empty or a frame is invalid.

    Unless `cleaned`, faces without area count like any others, and pieces are not searched: scenes have too many faces
    for that.
    """
    return joined([survey_frames(sequence, range(len(sequence)), cleaned)])


def survey_frames(sequence: MeshSequence, numbers: range, cleaned: bool) -> Survey:
    """Survey the frames `numbers` of a sequence as `survey_sequence` does; `joined` combines such surveys."""
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    diagonals, flattened, dropped, pieces = list[float](), list[int](), 0, list[tuple[Piece, ...]]()

    def surveyed(number: int) -> tuple[int, int, tuple[Piece, ...], float, tuple[Any, Any] | None]:
        check(mesh := sequence[number], f"frame {number}")
        before = len(mesh.faces)
        mesh = clean(mesh) if cleaned else drop_unreferenced(mesh)
        box = None if mesh.is_empty else mesh.box
        return before, len(mesh.faces), pieces_of(mesh) if cleaned else (), 0.0 if box is None else mesh.diagonal, box

    for number, (before, after, own, diagonal, box) in zip(numbers, ahead(surveyed, numbers), strict=True):
        dropped += before - after
        diagonals.append(diagonal)
        flattened += [number] if before and not after else []
        pieces += [own] if cleaned else []
        if box is not None:
            low, high = np.minimum(low, box[0]), np.maximum(high, box[1])
        work.passed("survey")
    return Survey(low, high, tuple(diagonals), tuple(flattened), dropped=dropped, pieces=tuple(pieces))


def joined(parts: Sequence[Survey]) -> Survey:
    """Return the survey of a sequence from those of its parts, in order. Raises InputError if there is no frame."""
    diagonals = tuple(diagonal for part in parts for diagonal in part.diagonals)
    if not diagonals:
        raise InputError("the sequence has no frames; give at least one mesh")
    low, high = np.min([part.low for part in parts], axis=0), np.max([part.high for part in parts], axis=0)
    if not np.isfinite(low).all():  # no frame has a surface
        low, high = np.zeros(3), np.zeros(3)
    flattened = tuple(number for part in parts for number in part.flattened)
    pieces = tuple(frame_pieces for part in parts for frame_pieces in part.pieces)
    return Survey(low, high, diagonals, flattened, dropped=sum(part.dropped for part in parts), pieces=pieces)


def check_one_unit(survey: Survey) -> None:
    """Raise InputError if a frame of a scene is far larger than the others, as if its unit were another.

    Its segmentation would need more cells by the square of the ratio.
    """
    sizes = [size for size in survey.diagonals if size > 0]
    usual, largest = float(np.median(sizes or [0.0])), max(sizes, default=0.0)
    if largest > UNLIKE * usual:
        frame = survey.diagonals.index(largest)
        text = f"frame {frame} is {largest:.3g} m large, half of the frames at most {usual:.3g} m"
        raise InputError(f"{text}; correct its unit, leave it out with --frames, or encode with --dynamic-only")


def check(mesh: Mesh, where: str) -> None:
    """Raise InputError for vertices that are not finite and faces that refer to missing vertices.

    `io` checks files likewise; this is for meshes made in memory.
    """
    if not np.isfinite(mesh.vertices).all():
        vertex = int(np.argmin(np.isfinite(mesh.vertices).all(axis=1)))
        raise InputError(f"{where}: vertex {vertex} is at {mesh.vertices[vertex].tolist()}; all must be finite")
    if not mesh.is_empty and not (mesh.faces.min() >= 0 and mesh.faces.max() < len(mesh.vertices)):
        wrong = mesh.faces.max() if mesh.faces.min() >= 0 else mesh.faces.min()
        raise InputError(f"{where}: a face refers to vertex {wrong}, but there are {len(mesh.vertices)} (from 0)")


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
    arounds = [box_around(split.boxes[split.piece == number]) for number in range(len(split.own))]
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
    lows, highs = boxes_of(labels, mesh.vertices, len(areas))
    middles = lows + highs
    gaps = np.maximum(np.maximum(lows[own] - highs[:, None], lows[:, None] - highs[own]), 0.0)
    gap, middle_gap = ((offsets**2).sum(axis=2) for offsets in (gaps, middles[own] - middles[:, None]))
    nearest = np.lexsort((middle_gap, gap), axis=-1)[:, 0]  # the piece with the nearest box, then the nearest middle
    nearest[own] = np.arange(len(own))
    return _Found(labels, np.concatenate([lows, highs], axis=1), own, nearest)


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


def box_around(boxes: Float64[np.ndarray, "P 6"]) -> Float64[np.ndarray, "6"]:
    return np.concatenate([boxes[:, :3].min(axis=0), boxes[:, 3:].max(axis=0)])
