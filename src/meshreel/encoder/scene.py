"""The chunks of a scene: its background once, and each moving body as groups of its own track (paper, section 3.2).

In: a job, the parts of its scene. Out: the payloads of the file, in the order of time. A key interval is read once; in
memory is its moving surface.

Normalised coordinates have the middle of the scene's box as origin and the size of what moves as unit, so that a
quality means the same for a person in a room as for one alone.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import pairwise

import numpy as np
from jaxtyping import Bool

from ..analysis.scene.background import BackgroundOptions
from ..analysis.scene.bodies import BodyOptions, at_most, find_bodies, same_bodies, with_ring
from ..analysis.scene.labelling import Segmentation
from ..analysis.survey import Survey
from ..coding.background import changed, decode_background, decode_change, encode_background, encode_change
from ..format.budget import Chain, CostlyError
from ..format.checks import MOST_TRACKS
from ..geometry.closest_points import distances
from ..geometry.decimate import decimate_faces
from ..geometry.derived_sequences import digest
from ..geometry.topology import clean
from ..types import Mesh, MeshSequence, Placement
from .forms import empty_groups
from .interval import Interval
from .job import Job
from .options import EncoderOptions
from .parts import Change, Parts
from .recipe import encode_intervals, longest_interval
from .tracks import TrackGroup

FRACTIONS = (0.75, 0.5, 0.35, 0.22, 0.15, 0.1, 0.07, 0.045, 0.03, 0.02)  # of the background's vertices (decision 19)
HALVINGS = 2  # of the factor between two fractions, in search for a smaller mesh that is near enough (guess)
LEAST_NOISE = 1e-4  # of the unit: the noise that a background is coded for, at least (guess)


@dataclass(frozen=True, slots=True)
class Static:
    """A state of the background from a frame on: whole, or a patch of the one before."""

    frame: int
    payload: bytes
    is_patch: bool


@dataclass(frozen=True, slots=True)
class CodedBodies:
    """The moving bodies as encoded."""

    groups: list[TrackGroup]  # in the order of the file
    dropped: int  # faces of pieces that were there for a moment only, and are in none of the groups


def encode_static(parts: Parts, count: int, frame_rate: float, options: BackgroundOptions) -> list[Static]:
    """Encode the states of the background: as few faces as stay about as near to it as the noise.

    The first state is whole, as are those of a refresh; each change of the room is a patch of the state before.
    """
    noise = max(parts.deviation / parts.seen.unit, LEAST_NOISE)
    step, most = options.lattice * noise, options.coarse * noise
    payload, state = _coded(_normalised(parts.background, parts.seen), most, step)
    found = [] if state.is_empty else [Static(0, payload, False)]
    chain, changes = Chain(0, len(payload)), {change.frame: change for change in parts.changes}
    again = set(refreshes(count, frame_rate, options))
    for frame in sorted({*changes, *again} - {0}):
        whole = state.is_empty or frame in again
        if change := changes.get(frame):
            came = _coded(_normalised(change.came, parts.seen), most, step)[1]
            before, gone = state, _gone(parts, state, change)
            payload = encode_change(before, gone, came, step)
            try:
                state = decode_change(payload, before)
                chain = chain.then(before, state, len(payload))
            except CostlyError:  # no reader would decode it
                state, whole = changed(before, gone, came), True
        if whole and not state.is_empty:
            payload = encode_background(state, step)
            state = decode_background(payload)  # the next patch counts faces in the decoded order
            chain = Chain(0, len(payload))
        if not (whole and state.is_empty):
            found.append(Static(frame, payload, not whole))
    return found


def refreshes(count: int, frame_rate: float, options: BackgroundOptions) -> range:
    """Return the frames at which the whole background is sent; the first frame is one of them."""
    return range(0, count, count if options.refresh is None else max(1, round(options.refresh * frame_rate)))


def _gone(parts: Parts, state: Mesh, change: Change) -> Bool[np.ndarray, " F"]:
    """Return a mask of the background's faces, normalised, that a change removes."""
    place = Placement(parts.seen.unit, tuple(parts.seen.center))
    return parts.segmentation.gone(change.frame, place.of(state))


def _coded(mesh: Mesh, most: float, step: float) -> tuple[bytes, Mesh]:
    """Encode a mesh with the fewest vertices that stay within an RMS distance; return payload and decoded mesh."""
    if mesh.is_empty:
        return b"", mesh
    steps = [clean(mesh)]  # each from the one before: these are nearer to the mesh than what is made from it at once
    for fraction in FRACTIONS:
        steps.append(decimate_faces(steps[-1], max(4, round(2 * fraction * len(mesh.vertices)))))
    failed, best, found = 0, mesh, (b"", mesh)
    for best in reversed(steps):
        found = _stored(best, step)
        if is_near := _is_near(mesh, found[1], most):
            break
        failed = len(best.faces)
    for _ in range(HALVINGS if failed and is_near else 0):
        small = decimate_faces(best, round((failed * len(best.faces)) ** 0.5))
        stored = _stored(small, step)
        if _is_near(mesh, stored[1], most):
            best, found = small, stored
        else:
            failed = len(small.faces)
    return found


def _normalised(mesh: Mesh, seen: Survey) -> Mesh:
    return Mesh((mesh.vertices - seen.center) / seen.unit, mesh.faces)


def encode_bodies(job: Job, parts: Parts) -> CodedBodies:
    """Encode the groups of all tracks; each track has all frames, and no group has frames with surface and without.

    The intervals of the whole scene are one stream: workers need not wait for the last body of a key interval.
    """
    tracks, found = Tracks(parts.segmentation.cell, job.scene.bodies), list[TrackGroup]()
    places = deque[tuple[int, int]]()  # track and first frame of intervals that are not encoded yet

    def intervals() -> Iterator[Interval]:
        for interval in scene_intervals(job, parts, tracks):
            places.append((interval.track, interval.first_frame))
            yield interval

    for groups in encode_intervals(job, intervals()):
        track, first = places.popleft()
        for group in groups:
            found.append(TrackGroup(track, first, group))
            first += group.frame_count
    found += tracks.late()
    return CodedBodies(sorted(found, key=lambda each: (each.first_frame, each.track)), tracks.dropped)


def scene_intervals(job: Job, parts: Parts, tracks: Tracks) -> Iterator[Interval]:
    """Yield the intervals of all tracks of a scene, in the order of time."""
    for frames in key_intervals(job.sequence, parts.segmentation, job.options):
        found = track_intervals(job, parts, frames, tracks)
        weight = Fraction(len(frames), sum(len(interval.frames) for interval in found))
        yield from (replace(interval, weight=weight) for interval in found)


def track_intervals(job: Job, parts: Parts, frames: range, tracks: Tracks) -> list[Interval]:
    """Assign the moving surface of a key interval to tracks, and cut each track where frames cannot share an interval.

    Frames can where all have a surface or none has, and where they are of about one scale.
    """
    moving, found = [_moving(job.sequence[number], parts, number) for number in frames], list[Interval]()
    longest = longest_interval(job.options, job.sequence.frame_rate)
    for track, meshes in tracks.of(moving):
        normalised = [parts.seen.normalise(mesh) for mesh in meshes]
        for cut in _cut(normalised, frames, parts.seen, longest):
            some = normalised[cut.start : cut.stop]
            found.append(Interval(some, parts.body_noise, frames.start + cut.start, track, digest(some)))
    return found


def key_intervals(sequence: MeshSequence, segmentation: Segmentation, options: EncoderOptions) -> Iterator[range]:
    """Yield the key intervals of a scene, of even lengths, cut also where the background changes or is sent again."""
    count, frame_rate = len(sequence), sequence.frame_rate
    longest = max(1, round(options.key_interval * frame_rate))
    others = set(segmentation.changes)
    if options.scene is not None:
        others |= set(refreshes(count, frame_rate, options.scene.background))
    for start, stop in pairwise(sorted({0, count} | others)):
        pieces = -(-(stop - start) // longest)
        yield from (range(a, b) for a, b in pairwise(start + (stop - start) * k // pieces for k in range(pieces + 1)))


def _cut(meshes: Sequence[Mesh], frames: range, seen: Survey, longest: int) -> list[range]:
    """Cut a body's frames into intervals of at most `longest` frames.

    They are cut, too, where the scene begins or ends to have a surface: frames without are shown without background.
    """
    cuts = [k for k in range(1, len(frames)) if seen.is_bare(frames[k]) != seen.is_bare(frames[k - 1])]
    found = []
    for start, stop in pairwise([0, *cuts, len(frames)]):
        sizes = replace(seen, diagonals=tuple(mesh.diagonal for mesh in meshes[start:stop]))
        found += [range(start + some.start, start + some.stop) for some in sizes.intervals(longest)]
    return found


class Tracks:
    """Assigns the bodies of each key interval to tracks: to their own from before, or to one that is free."""

    def __init__(self, cell: float, options: BodyOptions) -> None:
        self._cell, self._options = cell, options
        self._last: list[Mesh] = []  # of each track, in the last frame so far
        self._frames = 0
        self._began: list[int] = []  # the first frame of each track's first key interval
        self.dropped = 0  # faces that are in no track

    def of(self, moving: Sequence[Mesh]) -> list[tuple[int, list[Mesh]]]:
        """Return each track's mesh in each frame of the next key interval."""
        apart = find_bodies(moving, self._cell, self._options)
        bodies, self.dropped = at_most(apart.meshes, MOST_TRACKS), self.dropped + apart.dropped
        before = same_bodies(self._last, [body[0] for body in bodies], self._cell, self._options)
        free = [number for number in range(len(self._last) + len(bodies) + 1) if number not in before]
        numbers = [free.pop(0) if old < 0 else old for old in before]
        count = max([len(self._last), 1, *(number + 1 for number in numbers)])
        empty = [Mesh.empty()] * len(moving)
        found = [empty] * count
        for number, body in zip(numbers, bodies, strict=True):
            found[number] = body
        self._began += [self._frames] * (count - len(self._began))
        self._last = [meshes[-1] for meshes in found]
        self._frames += len(moving)
        return list(enumerate(found))

    def late(self) -> Iterator[TrackGroup]:
        """Yield the empty frames that tracks have before the key interval in which they began."""
        for track, began in enumerate(self._began):
            first = 0
            for group in empty_groups(began):
                yield TrackGroup(track, first, group)
                first += group.frame_count


def _moving(mesh: Mesh, parts: Parts, number: int) -> Mesh:
    return with_ring(mesh, parts.segmentation.moving(number, mesh), parts.segmentation.cell, parts.outline)


def _stored(mesh: Mesh, step: float) -> tuple[bytes, Mesh]:
    """Return the payload of a background, and what it decodes to."""
    payload = encode_background(mesh, step)
    return payload, decode_background(payload)


def _is_near(mesh: Mesh, small: Mesh, most: float) -> bool:
    """Return whether a simplified mesh is within an RMS distance of the vertices of a mesh."""
    return not small.is_empty and float(np.sqrt((distances(mesh.vertices, small) ** 2).mean())) <= most
