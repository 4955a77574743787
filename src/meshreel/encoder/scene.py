"""A scene becomes chunks: its background once, and each moving body of a segment as groups of its own (section 3.2).

In: frames of a scene, options. Out: what the writer needs, in the order of time. A segment of frames is read once; in
memory are what moves in it, and the bytes of what is coded so far.

Normalised coordinates have the middle of the scene's box as origin and the size of what moves as unit, so that a
quality means the same for a person in a room as for one alone.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from jaxtyping import Bool

from ..analysis.scene.background import BackgroundOptions
from ..analysis.scene.bodies import at_most, find_bodies, same_bodies, with_ring
from ..analysis.scene.labelling import Segmentation
from ..analysis.survey import Survey
from ..coding.background import decode_background, decode_change, encode_background, encode_change
from ..format.checks import MOST_TRACKS
from ..format.layout import Form
from ..geometry.closest_points import distances
from ..geometry.decimate import decimate, decimate_faces
from ..types import Mesh, MeshSequence, Placement
from .forms import EncodedGroup, empty_groups
from .job import Job
from .options import MOST_NOISE, EncoderOptions
from .parts import Change, Parts
from .recipe import encode_apart, encode_interval

FRACTIONS = (0.02, 0.03, 0.045, 0.07, 0.1, 0.15, 0.22, 0.35, 0.5, 0.75)  # of the background's vertices, tried in order
HALFWAY = 0.3  # of the vertices: what has fewer than half as many is decimated from there, a third of the time
LEAST_NOISE = 1e-4  # of the unit: a background is no finer than with that much


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
class TrackInterval:
    """Frames of one track that are coded together."""

    track: int
    first_frame: int
    frames: list[Mesh]  # normalised, all with surface or all without


@dataclass(frozen=True, slots=True)
class CodedBodies:
    """What moves, as coded."""

    groups: list[TrackGroup]  # in the order that a file has them
    dropped: int  # faces of bits that were only there for a moment, and are in none of the groups


def encode_static(parts: Parts, count: int, frame_rate: float, options: BackgroundOptions) -> list[Static]:
    """The states of the background in `count` frames: as few faces as are about as near to it as noise is.

    A whole one at the start and, where it is to be refreshed, again; and a patch for each change of the room.
    """
    noise = max(parts.deviation / parts.seen.unit, LEAST_NOISE)
    step, most = options.lattice * noise, options.coarse * noise
    payload, state = _coded(_normalised(parts.background, parts.seen), most, step)
    found = [] if state.is_empty else [Static(0, payload, False)]
    changes, again = {change.frame: change for change in parts.changes}, set(refreshes(count, frame_rate, options))
    for frame in sorted({*changes, *again} - {0}):
        whole = state.is_empty or frame in again
        if change := changes.get(frame):
            came = _coded(_normalised(change.came, parts.seen), most, step)[1]
            payload = encode_change(state, _gone(parts, state, change), came, step)
            state = decode_change(payload, state)
        if whole and not state.is_empty:
            payload = encode_background(state, step)
            state = decode_background(payload)  # in the order of faces that the next patch counts in
        if not (whole and state.is_empty):
            found.append(Static(frame, payload, not whole))
    return found


def refreshes(count: int, frame_rate: float, options: BackgroundOptions) -> range:
    """The frames at which the background is sent, whole, the first among them."""
    return range(0, count, count if options.refresh is None else max(1, round(options.refresh * frame_rate)))


def _gone(parts: Parts, state: Mesh, change: Change) -> Bool[np.ndarray, " F"]:
    """The faces of a state of the background, normalised, that a change takes away."""
    place = Placement(parts.seen.unit, tuple(parts.seen.center))
    return parts.segmentation.gone(change.frame, place.of(state))


def _coded(mesh: Mesh, most: float, step: float) -> tuple[bytes, Mesh]:
    """The payload of a mesh with as few vertices as leave it within an RMS distance, and that as decoded."""
    if mesh.is_empty:
        return b"", mesh
    smaller = decimate_faces(mesh, max(4, round(2 * HALFWAY * len(mesh.vertices))))
    for fraction in (*FRACTIONS, 1.0):
        source = smaller if 2 * fraction <= HALFWAY else mesh
        payload = encode_background(decimate(source, max(4, round(fraction * len(mesh.vertices)))), step)
        decoded = decode_background(payload)
        if not decoded.is_empty and _apart(mesh, decoded) <= most:
            break
    return payload, decoded


def _normalised(mesh: Mesh, seen: Survey) -> Mesh:
    return Mesh((mesh.vertices - seen.center) / seen.unit, mesh.faces)


def encode_bodies(job: Job, parts: Parts) -> CodedBodies:
    """The groups of all tracks; each track has all frames, and no group has frames with surface and without."""
    sequence, stages = job.sequence, job.stages
    options = options_of(parts, job.options)
    tracks, found = Tracks(parts.segmentation.cell, options), list[TrackGroup]()
    for frames in key_intervals(sequence, parts.segmentation, options):
        runs = track_intervals(sequence, parts, frames, tracks)
        coded = _coded_intervals([run.frames for run in runs], replace(job, options=options))
        done, count = 0, sum(len(run.frames) for run in runs)
        for run, groups in zip(runs, coded, strict=True):
            first = run.first_frame
            for group in groups:
                found.append(TrackGroup(run.track, first, group))
                first += group.frame_count
                before, done = done, done + group.frame_count  # frames of all tracks count as frames of the scene
                stages.add("code", done * len(frames) // count - before * len(frames) // count)
        found += tracks.late(frames)
    return CodedBodies(sorted(found, key=lambda each: (each.first_frame, each.track)), tracks.dropped)


def options_of(parts: Parts | None, options: EncoderOptions) -> EncoderOptions:
    """Options for the bodies of a scene, which are as noisy as what stands still; the same without `parts`."""
    return options if parts is None else replace(options, noise=min(parts.noise / parts.seen.unit, MOST_NOISE))


def track_intervals(sequence: MeshSequence, parts: Parts, frames: range, tracks: Tracks) -> list[TrackInterval]:
    """What moves in the next segment, apart in tracks and in runs of frames that can be coded together."""
    moving, found = [_moving(sequence[number], parts, number) for number in frames], list[TrackInterval]()
    for track, meshes in tracks.of(moving):
        normalised = [parts.seen.normalise(mesh) for mesh in meshes]
        for run in _runs(normalised, frames, parts.seen, tracks.options):
            found.append(TrackInterval(track, frames.start + run.start, normalised[run.start : run.stop]))
    return found


def all_intervals(
    sequence: MeshSequence, seen: Survey, parts: Parts | None, options: EncoderOptions
) -> Iterator[TrackInterval]:
    """The windows of form LAPLACIAN: of a scene, or where there are no `parts` of a sequence that may all move."""
    if parts is None:
        for window in seen.intervals(options.group_size):
            yield TrackInterval(0, window.start, [seen.normalise(sequence[number]) for number in window])
        return
    tracks = Tracks(parts.segmentation.cell, options)
    for frames in key_intervals(sequence, parts.segmentation, options):
        yield from track_intervals(sequence, parts, frames, tracks)


def _coded_intervals(runs: Sequence[list[Mesh]], job: Job) -> Iterator[Iterable[EncodedGroup]]:
    """The groups of each run, in order."""
    if job.executor is None:
        return (encode_interval(frames, job.options, None, job.store.find) for frames in runs)
    return job.executor.map(encode_apart, [(frames, job.options) for frames in runs])


def key_intervals(sequence: MeshSequence, segmentation: Segmentation, options: EncoderOptions) -> Iterator[range]:
    """Runs of frames that are coded on their own, of even lengths, cut also where the background is another."""
    count, frame_rate = len(sequence), sequence.frame_rate
    longest = max(1, round(options.key_interval * frame_rate))
    others = set(segmentation.changes) | set(refreshes(count, frame_rate, options.background))
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
        runs += [range(start + run.start, start + run.stop) for run in sizes.intervals(size)]
    return runs


class Tracks:
    """Which track each body of a segment is coded in: its own from before, or one that is free."""

    def __init__(self, cell: float, options: EncoderOptions) -> None:
        self._cell, self.options = cell, options
        self._last: list[Mesh] = []  # of each track, in the last frame so far
        self._frames = 0
        self.dropped = 0  # faces that are in no track

    def of(self, moving: Sequence[Mesh]) -> list[tuple[int, list[Mesh]]]:
        """Each track's mesh in each frame of the next segment."""
        apart = find_bodies(moving, self._cell, self.options.bodies)
        bodies, self.dropped = at_most(apart.meshes, MOST_TRACKS), self.dropped + apart.dropped
        before = same_bodies(self._last, [body[0] for body in bodies], self._cell, self.options.bodies)
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
            first = 0
            for group in empty_groups(frames.start):
                yield TrackGroup(track, first, group)
                first += group.frame_count


def _moving(mesh: Mesh, parts: Parts, number: int) -> Mesh:
    return with_ring(mesh, parts.segmentation.moving(number, mesh), parts.segmentation.cell, parts.outline)


def _apart(mesh: Mesh, small: Mesh) -> float:
    """RMS distance of a mesh's vertices to a simplified one."""
    return float(np.sqrt((distances(mesh.vertices, small) ** 2).mean()))
