"""A scene becomes chunks: its background once, and each moving body of a segment as groups of its own (section 3.2).

In: frames of a scene, options. Out: what the writer needs, in the order of time. A segment of frames is read once; in
memory are what moves in it, and the bytes of what is coded so far.

Normalised coordinates have the middle of the scene's box as origin and the size of what moves as unit, so that a
quality means the same for a person in a room as for one alone.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from jaxtyping import Bool, Float64

from .analysis.background import BackgroundOptions, fuse_background
from .analysis.bodies import find_bodies, same_bodies
from .analysis.segment.masks import Masker
from .analysis.segment.scene import ByMasks, ByPlace, segment, segment_by
from .analysis.survey import Survey
from .choice import NO_ERROR
from .coding.background import decode_background, encode_background
from .coding.intra import encode_empty
from .format.layout import Form
from .geometry.decimate import decimate
from .geometry.nearest import Surface
from .geometry.topology import components, drop_unreferenced
from .layered import MOST_EMPTY, encode_segment
from .types import Frames, Mesh, MeshSequence, Placement
from .windows import MOST_NOISE, EncodedGroup, EncoderOptions, Stages, encode_window

FRACTIONS = (0.02, 0.03, 0.045, 0.07, 0.1, 0.15, 0.22, 0.35, 0.5, 0.75)  # of the background's vertices, tried in order
PROBES = 8  # frames, at most, that what moves is measured in
OUTLIER = 3.0  # cells: a static face farther from the background is no noise


@dataclass(frozen=True, slots=True)
class Parts:
    """What does not change over a scene's segments."""

    segmentation: ByPlace | ByMasks
    background: Mesh  # m; empty where nothing stands still
    cell: float  # m, of the scene's mesh
    noise: float  # m, RMS distance of a frame's still surface from the background
    unit: float  # m, diagonal of the largest body that moves; of the scene where nothing does


@dataclass(frozen=True, slots=True)
class TrackGroup:
    """A group of frames of one track."""

    track: int
    first_frame: int
    group: EncodedGroup


def take_apart(
    sequence: MeshSequence, seen: Survey, options: EncoderOptions, stages: Stages, masker: Masker | None = None
) -> Parts:
    """What stands still in a scene, and what is known of what moves; by somebody's masks where there are any."""
    found = segment(sequence, options.segment) if masker is None else segment_by(masker, sequence, options.segment)
    segmentation: ByPlace | ByMasks = found
    stages.add("segment", len(sequence))
    cell = segmentation.lattice.size
    still = _Still(sequence, segmentation, _spread(len(sequence), options.background.frames))
    background = fuse_background(still, cell, options.background)
    stages.add("background", len(sequence))
    noise, sizes = _measured(sequence, segmentation, background, OUTLIER * cell)
    return Parts(segmentation, background, cell, noise, float(np.median(sizes)) if sizes else seen.diagonal)


def encode_static(parts: Parts, seen: Survey, options: BackgroundOptions) -> bytes:
    """The background's payload: as few faces as leave it about as far from the fused surface as noise does."""
    place = Placement(parts.unit, tuple(seen.center))
    step = max(options.lattice * parts.noise / parts.unit, 1e-4)
    normalised = Mesh((parts.background.vertices - seen.center) / parts.unit, parts.background.faces)
    payload = b""
    for fraction in (*FRACTIONS, 1.0):
        small = decimate(normalised, max(4, round(fraction * len(normalised.vertices))))
        payload = encode_background(small, step)
        decoded = decode_background(payload, place)
        if not decoded.is_empty and _apart(parts.background, decoded) <= options.coarse * parts.noise + 1e-6:
            break
    return payload


def encode_bodies(
    sequence: MeshSequence,
    seen: Survey,
    parts: Parts,
    options: EncoderOptions,
    executor: Executor | None,
    stages: Stages,
) -> Iterator[TrackGroup]:
    """The groups of all tracks, of each in the order of its frames; each track has all frames."""
    noise = min(parts.noise / parts.unit, MOST_NOISE) if options.form == Form.LAYERS else 0.0
    options = replace(options, noise=noise)
    normalised = Survey(seen.low, seen.high, (), scale=parts.unit)
    tracks = Tracks(parts.cell, options)
    for frames in segments(len(sequence), sequence.frame_rate, options):
        moving = [_moving(sequence[number], parts.segmentation, number) for number in frames]
        jobs = []
        for track, meshes in tracks.of(moving):
            for run in _runs(meshes, normalised, options):
                jobs.append((track, frames.start + run.start, [normalised.normalise(meshes[k]) for k in run]))
        coded = map if executor is None else executor.map
        for (track, first, _), groups in zip(jobs, coded(_encoded, [(job[2], options) for job in jobs]), strict=True):
            for group in groups:
                yield TrackGroup(track, first, group)
                first += group.frame_count
        stages.add("code", len(frames))
        yield from tracks.late(frames)


def _encoded(job: tuple[list[Mesh], EncoderOptions]) -> list[EncodedGroup]:
    frames, options = job
    return list((encode_segment if options.form == Form.LAYERS else encode_window)(frames, options))


def segments(count: int, frame_rate: float, options: EncoderOptions) -> Iterator[range]:
    """Runs of frames that are coded on their own, of even lengths, cut also where the background is sent again."""
    longest = max(1, round(options.key_interval * frame_rate))
    refresh = options.background.refresh
    every = count if refresh is None else max(1, round(refresh * frame_rate))
    for start in range(0, count, every):
        stop = min(start + every, count)
        parts = -(-(stop - start) // longest)
        cuts = [start + (stop - start) * k // parts for k in range(parts + 1)]
        yield from (range(a, b) for a, b in pairwise(cuts))


def _runs(meshes: Sequence[Mesh], normalised: Survey, options: EncoderOptions) -> list[range]:
    """Frames of a body that can be coded together: with surface or without, and of one scale."""
    sizes = replace(normalised, diagonals=tuple(mesh.diagonal for mesh in meshes))
    return sizes.windows(len(meshes) if options.form == Form.LAYERS else options.group_size)


class Tracks:
    """Which track each body of a segment is coded in: its own from before, or one that is free."""

    def __init__(self, cell: float, options: EncoderOptions) -> None:
        self._cell, self._options = cell, options
        self._last: list[Mesh] = []  # of each track, in the last frame so far
        self._frames = 0

    def of(self, moving: Sequence[Mesh]) -> list[tuple[int, list[Mesh]]]:
        """Each track's mesh in each frame of the next segment."""
        bodies = find_bodies(moving, self._cell, self._options.bodies).meshes
        before = same_bodies(self._last, [body[0] for body in bodies], self._cell, self._options.bodies)
        free = [number for number in range(len(self._last) + len(bodies) + 1) if number not in before]
        numbers = [free.pop(0) if old < 0 else old for old in before]
        count = max([len(self._last), 1, *(number + 1 for number in numbers)])
        empty = [Mesh.empty()] * len(moving)
        found = [empty] * count
        for number, body in zip(numbers, bodies, strict=True):
            found[number] = body
        self._new = range(len(self._last), count) if self._frames else range(0)
        self._last = [meshes[-1] for meshes in found]
        self._frames += len(moving)
        return list(enumerate(found))

    def late(self, frames: range) -> Iterator[TrackGroup]:
        """The empty frames of tracks that began in this segment, up to it."""
        for track in self._new:
            for start in range(0, frames.start, MOST_EMPTY):
                count = min(MOST_EMPTY, frames.start - start)
                yield TrackGroup(track, start, EncodedGroup(Form.EMPTY, count, encode_empty(), (), NO_ERROR))


class _Still(Frames):
    """What stands still of some frames."""

    def __init__(self, sequence: Frames, segmentation: ByPlace | ByMasks, numbers: Sequence[int]) -> None:
        self._sequence, self._segmentation, self._numbers = sequence, segmentation, numbers

    def __len__(self) -> int:
        return len(self._numbers)

    def __getitem__(self, index: int) -> Mesh:
        number = self._numbers[index]
        mesh = self._sequence[number]
        return _part(mesh, ~self._segmentation.moving(number, mesh))


def _moving(mesh: Mesh, segmentation: ByPlace | ByMasks, number: int) -> Mesh:
    return _part(mesh, segmentation.moving(number, mesh))


def _part(mesh: Mesh, chosen: Bool[np.ndarray, " F"]) -> Mesh:
    return drop_unreferenced(Mesh(mesh.vertices, mesh.faces[chosen]))


def _spread(count: int, most: int) -> list[int]:
    return sorted({round(k) for k in np.linspace(0, count - 1, min(count, most))})


def _measured(
    sequence: MeshSequence, segmentation: ByPlace | ByMasks, background: Mesh, far: float
) -> tuple[float, list[float]]:
    """RMS distance of still faces' corners from the background, m; the diagonal of the largest body a frame, m."""
    squares, sizes = [], []
    for number in _spread(len(sequence), PROBES):
        mesh = sequence[number]
        moves = segmentation.moving(number, mesh)
        if moves.any():
            sizes.append(_largest(_part(mesh, moves)))
        still = _part(mesh, ~moves)
        if not still.is_empty and not background.is_empty:
            gaps = _gaps(still.vertices, background)
            squares.append(float((gaps[gaps < far] ** 2).mean()) if (gaps < far).any() else 0.0)
    return math.sqrt(float(np.mean(squares))) if squares else 0.0, sizes


def _largest(mesh: Mesh) -> float:
    """The diagonal of the connected piece with most vertices, m."""
    label = components(mesh.faces, len(mesh.vertices))
    return Mesh(mesh.vertices[label == np.bincount(label).argmax()], mesh.faces[:0]).diagonal


def _gaps(points: Float64[np.ndarray, "N 3"], mesh: Mesh) -> Float64[np.ndarray, " N"]:
    return np.linalg.norm(Surface(mesh).closest(points).points - points, axis=1)


def _apart(mesh: Mesh, small: Mesh) -> float:
    """RMS distance of a mesh's vertices to a simplified one."""
    return float(np.sqrt((_gaps(mesh.vertices, small) ** 2).mean()))
