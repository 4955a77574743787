"""A scene becomes chunks: its background once, and each moving body of a segment as groups of its own (section 3.2).

In: frames of a scene, options. Out: what the writer needs, in the order of time. A segment of frames is read once; in
memory are what moves in it, and the bytes of what is coded so far.

Normalised coordinates have the middle of the scene's box as origin and the size of what moves as unit, so that a
quality means the same for a person in a room as for one alone.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from jaxtyping import Bool

from .analysis.background import BackgroundOptions, fuse_background
from .analysis.bodies import find_bodies, ring, same_bodies
from .analysis.segment.masks import Masker
from .analysis.segment.scene import ByMasks, ByPlace, segment, segment_by
from .analysis.survey import Survey, check_one_unit
from .choice import NO_ERROR
from .coding.background import decode_background, decode_change, encode_background, encode_change
from .coding.intra import encode_empty
from .errors import InputError
from .format.layout import Form
from .geometry.connected import connected
from .geometry.decimate import decimate
from .geometry.nearest import distances
from .geometry.topology import drop_unreferenced
from .layered import MOST_EMPTY, encode_segment
from .types import Frames, Mesh, MeshSequence, Placement, evenly
from .windows import MOST_NOISE, EncodedGroup, EncoderOptions, Stages, encode_window

FRACTIONS = (0.02, 0.03, 0.045, 0.07, 0.1, 0.15, 0.22, 0.35, 0.5, 0.75)  # of the background's vertices, tried in order
PROBES = 8  # frames, at most, that what moves is measured in
LEAST_NOISE = 1e-4  # of the unit: a background is no finer than with that much
LOST = 0.5  # of a frame's faces: as many stand still only where there is a background
OUTLIER = 3.0  # cells: still surface farther from the background is no noise
NORMAL_MEDIAN = 0.6745  # of the absolute value of what is normally distributed, in standard deviations


@dataclass(frozen=True, slots=True)
class Change:
    """From a frame on, the room is another."""

    frame: int
    gone: Bool[np.ndarray, " P"]  # places of the segmentation where something is no more
    came: Mesh  # m, what has come to stand


@dataclass(frozen=True, slots=True)
class Parts:
    """What does not change over a scene's segments."""

    seen: Survey  # of the scene; its unit is the diagonal of the largest body that moves, or its own where nothing does
    segmentation: ByPlace | ByMasks
    background: Mesh  # m, as in the first frame; empty where nothing stands still
    changes: list[Change]
    cell: float  # m, of the scene's mesh
    noise: float  # m, RMS distance of a frame's still surface from the background, tails and all: what bodies have
    deviation: float  # m, the same by the median, as a standard deviation: without its tails


@dataclass(frozen=True, slots=True)
class Static:
    """A state of the background from a frame on: whole, or a patch of the one before."""

    frame: int
    payload: bytes
    is_patch: bool


@dataclass(frozen=True, slots=True)
class TrackGroup:
    """A group of frames of one track."""

    track: int
    first_frame: int
    group: EncodedGroup


@dataclass(frozen=True, slots=True)
class CodedBodies:
    """What moves, as coded."""

    groups: list[TrackGroup]  # in the order that a file has them
    dropped: int  # faces of bits that were only there for a moment, and are in none of the groups


def take_apart(
    sequence: MeshSequence, seen: Survey, options: EncoderOptions, stages: Stages, masker: Masker | None = None
) -> Parts:
    """What stands still in a scene, and what is known of what moves; by somebody's masks where there are any.

    Raises InputError where frames are of different units, or of another than metres.
    """
    check_one_unit(seen)
    found = segment(sequence, options.segment) if masker is None else segment_by(masker, sequence, options.segment)
    segmentation: ByPlace | ByMasks = found
    stages.add("segment", len(sequence))
    cell = segmentation.lattice.size
    numbers = evenly(len(sequence), options.background.frames)

    def clear(number: int, mesh: Mesh) -> Bool[np.ndarray, " F"]:
        stands = segmentation.still_at_first(number, mesh)
        return stands & ~ring(mesh, ~stands, cell)

    still = _Some(sequence, numbers, clear)
    background = fuse_background(still, cell, options.background)
    if background.is_empty and len(numbers):
        _check_nothing_lost(sequence, numbers, segmentation)
    changes = [_change(sequence, segmentation, frame, options) for frame in segmentation.rest.changes]
    stages.add("background", len(sequence))
    noise, deviation, sizes = _measured(sequence, segmentation, background, OUTLIER * cell)
    unit = float(np.median(sizes)) if sizes else 0.0
    seen = replace(seen, scale=unit or seen.diagonal)
    return Parts(seen, segmentation, background, changes, cell, noise, deviation)


def _check_nothing_lost(sequence: MeshSequence, numbers: Sequence[int], segmentation: ByPlace | ByMasks) -> None:
    """Where a background is empty, no frame may have much that stands still: it would be in no part of the file."""
    for number in numbers:
        mesh = sequence[number]
        still = segmentation.still_at_first(number, mesh)
        if still.sum() > LOST * len(mesh.faces):
            text = f"frame {number}: {still.sum()} of {len(mesh.faces)} faces stand still, but are too small for a room"
            size = f"the frame is {mesh.diagonal:.3g} m large; is it in metres? If not, give --scale"
            raise InputError(f"{text}: {size}; if so, encode with --dynamic-only")


def encode_static(parts: Parts, count: int, frame_rate: float, options: BackgroundOptions) -> list[Static]:
    """The states of the background in `count` frames: as few faces as are about as near to it as noise is.

    A whole one at the start and, where it is to be refreshed, again; and a patch for each change of the room.
    """
    if parts.background.is_empty:
        return []
    noise = max(parts.deviation / parts.seen.unit, LEAST_NOISE)
    step, most = options.lattice * noise, options.coarse * noise
    payload, state = _coded(_normalised(parts.background, parts.seen), most, step)
    changes = {change.frame: change for change in parts.changes}
    found = [Static(0, payload, False)]
    for frame in sorted({*changes, *refreshes(count, frame_rate, options)} - {0}):
        if change := changes.get(frame):
            gone = _gone(parts, state, change)
            came = _coded(_normalised(change.came, parts.seen), most, step)[1]
            payload = encode_change(state, gone, came, step)
            state = decode_change(payload, state)
            found.append(Static(frame, payload, True))
        else:
            found.append(Static(frame, encode_background(state, step), False))
    return found


def refreshes(count: int, frame_rate: float, options: BackgroundOptions) -> range:
    """The frames at which the background is sent, whole, the first among them."""
    return range(0, count, count if options.refresh is None else max(1, round(options.refresh * frame_rate)))


def _change(sequence: MeshSequence, segmentation: ByPlace | ByMasks, frame: int, options: EncoderOptions) -> Change:
    assert isinstance(segmentation, ByPlace)  # masks know of no changes
    came = segmentation.rest.since == frame
    numbers = [frame + number for number in evenly(len(sequence) - frame, options.background.frames)]
    later = _Some(sequence, numbers, lambda _, mesh: segmentation.faces_at(mesh, came))
    mesh = fuse_background(later, segmentation.lattice.size, options.background) if came.any() else Mesh.empty()
    return Change(frame, segmentation.rest.until == frame, mesh)


def _gone(parts: Parts, state: Mesh, change: Change) -> Bool[np.ndarray, " F"]:
    """The faces of a state of the background, normalised, that a change takes away."""
    assert isinstance(parts.segmentation, ByPlace)
    place = Placement(parts.seen.unit, tuple(parts.seen.center))
    return parts.segmentation.faces_at(place.of(state), change.gone)


def _coded(mesh: Mesh, most: float, step: float) -> tuple[bytes, Mesh]:
    """The payload of a mesh with as few vertices as leave it within an RMS distance, and that as decoded."""
    if mesh.is_empty:
        return b"", mesh
    for fraction in (*FRACTIONS, 1.0):
        payload = encode_background(decimate(mesh, max(4, round(fraction * len(mesh.vertices)))), step)
        decoded = decode_background(payload)
        if not decoded.is_empty and _apart(mesh, decoded) <= most:
            break
    return payload, decoded


def _normalised(mesh: Mesh, seen: Survey) -> Mesh:
    return Mesh((mesh.vertices - seen.center) / seen.unit, mesh.faces)


def encode_bodies(
    sequence: MeshSequence, parts: Parts, options: EncoderOptions, executor: Executor | None, stages: Stages
) -> CodedBodies:
    """The groups of all tracks; each track has all frames, and no group has frames with surface and without."""
    noise = min(parts.noise / parts.seen.unit, MOST_NOISE) if options.form == Form.LAYERS else 0.0
    options = replace(options, noise=noise)
    tracks, found = Tracks(parts.cell, options), list[TrackGroup]()
    for frames in segments(sequence, parts.segmentation, options):
        moving = [_moving(sequence[number], parts, number) for number in frames]
        jobs = []
        for track, meshes in tracks.of(moving):
            normalised = [parts.seen.normalise(mesh) for mesh in meshes]
            for run in _runs(normalised, frames, parts.seen, options):
                jobs.append((track, frames.start + run.start, normalised[run.start : run.stop]))
        coded = map if executor is None else executor.map
        for (track, first, _), groups in zip(jobs, coded(_encoded, [(job[2], options) for job in jobs]), strict=True):
            for group in groups:
                found.append(TrackGroup(track, first, group))
                first += group.frame_count
        stages.add("code", len(frames))
        found += tracks.late(frames)
    return CodedBodies(sorted(found, key=lambda each: (each.first_frame, each.track)), tracks.dropped)


def _encoded(job: tuple[list[Mesh], EncoderOptions]) -> list[EncodedGroup]:
    frames, options = job
    return list((encode_segment if options.form == Form.LAYERS else encode_window)(frames, options))


def segments(sequence: MeshSequence, segmentation: ByPlace | ByMasks, options: EncoderOptions) -> Iterator[range]:
    """Runs of frames that are coded on their own, of even lengths, cut also where the background is another."""
    count, frame_rate = len(sequence), sequence.frame_rate
    longest = max(1, round(options.key_interval * frame_rate))
    others = set(segmentation.rest.changes) | set(refreshes(count, frame_rate, options.background))
    for start, stop in pairwise(sorted({0, count} | others)):
        pieces = -(-(stop - start) // longest)
        yield from (range(a, b) for a, b in pairwise(start + (stop - start) * k // pieces for k in range(pieces + 1)))


def _runs(meshes: Sequence[Mesh], frames: range, seen: Survey, options: EncoderOptions) -> list[range]:
    """Frames of a body that can be coded together: with surface or without, and of one scale.

    A run is cut, too, where the scene begins or ends to have a surface: frames without are shown without background.
    """
    size = len(meshes) if options.form == Form.LAYERS else options.group_size
    cuts = [k for k in range(1, len(frames)) if seen.is_bare(frames[k]) != seen.is_bare(frames[k - 1])]
    runs = []
    for start, stop in pairwise([0, *cuts, len(frames)]):
        sizes = replace(seen, diagonals=tuple(mesh.diagonal for mesh in meshes[start:stop]))
        runs += [range(start + run.start, start + run.stop) for run in sizes.windows(size)]
    return runs


class Tracks:
    """Which track each body of a segment is coded in: its own from before, or one that is free."""

    def __init__(self, cell: float, options: EncoderOptions) -> None:
        self._cell, self._options = cell, options
        self._last: list[Mesh] = []  # of each track, in the last frame so far
        self._frames = 0
        self.dropped = 0  # faces that are in no track

    def of(self, moving: Sequence[Mesh]) -> list[tuple[int, list[Mesh]]]:
        """Each track's mesh in each frame of the next segment."""
        apart = find_bodies(moving, self._cell, self._options.bodies)
        bodies, self.dropped = apart.meshes, self.dropped + apart.dropped
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


class _Some(Frames):
    """Chosen faces of some frames."""

    def __init__(
        self, sequence: Frames, numbers: Sequence[int], choose: Callable[[int, Mesh], Bool[np.ndarray, " F"]]
    ) -> None:
        self._sequence, self._numbers, self._choose = sequence, numbers, choose

    def __len__(self) -> int:
        return len(self._numbers)

    def __getitem__(self, index: int) -> Mesh:
        number = self._numbers[index]
        mesh = self._sequence[number]
        return _part(mesh, self._choose(number, mesh))


def _moving(mesh: Mesh, parts: Parts, number: int) -> Mesh:
    moves = parts.segmentation.moving(number, mesh)
    return _part(mesh, moves | ring(mesh, moves, parts.cell))


def _part(mesh: Mesh, chosen: Bool[np.ndarray, " F"]) -> Mesh:
    return drop_unreferenced(Mesh(mesh.vertices, mesh.faces[chosen]))


def _measured(
    sequence: MeshSequence, segmentation: ByPlace | ByMasks, background: Mesh, far: float
) -> tuple[float, float, list[float]]:
    """RMS distance of still surface from the background, m, its deviation by the median, m; sizes of largest bodies.

    What is farther than `far` is past a border of the background.
    """
    squares, deviations, sizes = [], [], []
    for number in evenly(len(sequence), PROBES):
        mesh = sequence[number]
        moves = segmentation.moving(number, mesh)
        if moves.any():
            sizes.append(_largest(_part(mesh, moves)))
        still = _part(mesh, ~moves)
        if not still.is_empty and not background.is_empty:
            gaps = distances(still.vertices, background)
            deviations.append(float(np.median(gaps)) / NORMAL_MEDIAN)
            squares.append(float((gaps[gaps < far] ** 2).mean()) if (gaps < far).any() else 0.0)
    if not squares:
        return 0.0, 0.0, sizes
    return math.sqrt(float(np.mean(squares))), float(np.mean(deviations)), sizes


def _largest(mesh: Mesh) -> float:
    """The diagonal of the connected piece with most vertices, m."""
    label = connected(mesh.faces, len(mesh.vertices))
    return Mesh(mesh.vertices[label == np.bincount(label).argmax()], mesh.faces[:0]).diagonal


def _apart(mesh: Mesh, small: Mesh) -> float:
    """RMS distance of a mesh's vertices to a simplified one."""
    return float(np.sqrt((distances(mesh.vertices, small) ** 2).mean()))
