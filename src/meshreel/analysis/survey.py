"""Survey a sequence in one pass before coding: bounding box, empty frames, intervals, invalid input.

In -> out: MeshSequence -> Survey. Errors in any frame surface here, before minutes are spent on the first frames.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from jaxtyping import Float64

from ..errors import InputError
from ..geometry.strict import norm
from ..geometry.topology import clean, drop_unreferenced
from ..types import Mesh, MeshSequence
from .pieces import Piece, pieces_of

UNLIKE = 30.0  # times the median size: a larger frame of a room must be in another unit; a guess
LARGEST_RATIO = 10.0  # largest ratio of the diagonals of two frames in one interval: a guess
Report = Callable[[str, int], object]  # takes a stage, and the number of further frames that have passed it


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
        return self.diagonals[frame] == 0

    def without_frames(self) -> Survey:
        """Return the survey without the facts about single frames, which normalising does not need."""
        return replace(self, diagonals=(), flattened=(), pieces=())

    def normalise(self, mesh: Mesh) -> Mesh:
        """Return the mesh cleaned and in normalised coordinates: centered, in multiples of `unit`."""
        mesh = clean(mesh)
        return mesh.at((mesh.vertices - self.center) / self.unit)

    def intervals(self, size: int) -> list[range]:
        """Return even intervals of at most `size` frames, each of empty frames or of frames of similar size."""
        intervals = []
        for start, stop in pairwise([0, *self._breaks(), len(self.diagonals)]):
            parts = -(-(stop - start) // size)
            cuts = [start + (stop - start) * k // parts for k in range(parts + 1)]
            intervals += [range(a, b) for a, b in pairwise(cuts)]
        return intervals

    def _breaks(self) -> Iterator[int]:
        """Yield the frames that cannot share an interval with the one before: only one is empty, or sizes differ."""
        least = most = self.diagonals[0]
        for number, diagonal in enumerate(self.diagonals):
            least, most = min(least, diagonal), max(most, diagonal)
            if most > LARGEST_RATIO * least:
                yield number
                least = most = diagonal


def survey(sequence: MeshSequence, report: Report = lambda *_: None, cleaned: bool = True) -> Survey:
    """Survey a sequence with one frame in memory at a time. Raises InputError if it is empty or a frame is invalid.

    Unless `cleaned`, faces without area count like any others, and pieces are not searched: scenes have too many faces
    for that.
    """
    return joined([survey_of(sequence, range(len(sequence)), report, cleaned)])


def survey_of(sequence: MeshSequence, numbers: range, report: Report = lambda *_: None, cleaned: bool = True) -> Survey:
    """Survey the frames `numbers` of a sequence as `survey` does; `joined` combines such surveys."""
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    diagonals, flattened, dropped, pieces = list[float](), list[int](), 0, list[tuple[Piece, ...]]()
    for number in numbers:
        check(mesh := sequence[number], f"frame {number}")
        had_faces, before = not mesh.is_empty, len(mesh.faces)
        mesh = clean(mesh) if cleaned else drop_unreferenced(mesh)
        dropped += before - len(mesh.faces)
        diagonals.append(0.0 if mesh.is_empty else mesh.diagonal)
        flattened += [number] if had_faces and mesh.is_empty else []
        pieces += [pieces_of(mesh)] if cleaned else []
        if not mesh.is_empty:
            lower, upper = mesh.box
            low, high = np.minimum(low, lower), np.maximum(high, upper)
        report("survey", 1)
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
