"""The chunks of a scene: its background once, and each moving body as groups of its own track (paper, section 3.2).

In: a job, the parts of its scene. Out: the payloads of the file, in the order of time. A key interval is read once; in
memory is its moving surface.

Normalised coordinates have the middle of the scene's box as origin and the size of what moves as unit, so that a
quality means the same for a person in a room as for one alone.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import replace
from fractions import Fraction
from itertools import pairwise

import numpy as np
from jaxtyping import Bool, UInt16
from scipy.spatial import cKDTree

from ...analysis.front import Body, bodies_of, frames_looked_at
from ...analysis.scene.bodies import NEAR, at_most, find_bodies, same_bodies, with_ring
from ...analysis.scene.labelling import ByRest, Segmentation
from ...analysis.survey import Survey
from ...format.checks import MOST_TRACKS
from ...geometry.closest_points import area_samples
from ...geometry.derived_sequences import digest
from ...geometry.threads import ahead
from ...geometry.topology import part_of
from ...types import Mesh, MeshSequence, Placement, evenly
from ..group.forms import empty_groups
from ..group.interval import Interval, frames_in
from ..run.schedule import Job, encode_intervals
from ..settings.options import EncoderOptions
from .parts import Parts
from .static import refreshes
from .tracks import TrackGroup, placed

MEASURED, SAMPLES = 4, 1000  # frames of a body, and vertices of each, at whose places its noise is taken (guess)
MOST_NOISE = 0.05  # RMS, of the diagonal of a body: beyond, nothing is left of a hand (guess)


def encode_bodies(job: Job, parts: Parts) -> tuple[list[TrackGroup], Tracks]:
    """Encode the groups of all tracks; each track has all frames, and no group has frames with surface and without.

    Return them in the order of the file, and the tracks. The intervals of the whole scene are one stream: workers need
    not wait for the last body of a key interval.
    """
    tracks, found = Tracks(parts.segmentation, job.scene.near), list[TrackGroup]()
    places = deque[tuple[int, int]]()  # track and first frame of intervals that are not encoded yet

    def intervals() -> Iterator[Interval]:
        for interval in scene_intervals(job, parts, tracks):
            places.append((interval.track, interval.first_frame))
            yield interval

    for groups in encode_intervals(job, intervals()):
        found += placed(*places.popleft(), groups)
    for track, began in enumerate(tracks.began):
        found += placed(track, 0, empty_groups(began))
    return sorted(found, key=lambda each: (each.first_frame, each.track)), tracks


def scene_intervals(job: Job, parts: Parts, tracks: Tracks) -> Iterator[Interval]:
    """Yield the intervals of all tracks of a scene, in the order of time.

    The moving surface of a key interval is assigned to tracks, and each track is cut where frames cannot share an
    interval: they can where all have a surface or none has, and where they are of about one scale.
    """
    sequence, survey = job.sequence, parts.survey
    place = Placement(survey.unit, tuple(survey.center))
    longest = job.recipe.longest(sequence.frame_rate)
    looked_at = set(frames_looked_at(len(sequence), sequence.frame_rate))
    for frames in key_intervals(sequence, parts.segmentation, job.options):
        found = list[Interval]()
        moving, lost = zip(*ahead(lambda number: parts.moving(number, sequence[number]), frames), strict=True)
        tracks.dropped += sum(lost)
        of_tracks = tracks.of(moving)
        for number in looked_at.intersection(frames):
            bodies = (meshes[number - frames.start] for _, meshes in of_tracks)
            tracks.seen[number] = bodies_of(bodies, sequence.up)
        for track, meshes in of_tracks:
            normalised = [survey.normalise(mesh) for mesh in meshes]
            for cut in _cut(normalised, frames, survey, longest):
                some = normalised[cut.start : cut.stop]
                noise = _noise(meshes[cut.start : cut.stop], parts)
                one = Interval(some, noise, frames.start + cut.start, track, digest(some))
                one = replace(one, up=sequence.up, frame_rate=sequence.frame_rate, local=parts.noise, place=place)
                found.append(replace(one, views=parts.views, depth=sequence.depth))
        sizes = [1 + sum(len(mesh.vertices) for mesh in interval.frames) for interval in found]
        job.stages.bodies = sum(sizes) / max(sizes)
        for interval, size in zip(found, sizes, strict=True):
            yield replace(interval, weight=Fraction(len(frames) * size, sum(sizes) * len(interval.frames)))


def _noise(meshes: Sequence[Mesh], parts: Parts) -> float:
    """Return the RMS noise of a body, normalised: that of the places most like its own where surface rests."""
    some = [meshes[number] for number in evenly(len(meshes), MEASURED)]
    points = np.concatenate([mesh.vertices[area_samples(mesh, SAMPLES)] for mesh in some])
    squared = float((parts.noise.at(points)[0] ** 2).mean()) if len(points) else 0.0
    return min(squared**0.5, MOST_NOISE * max(mesh.diagonal for mesh in some)) / parts.survey.unit


def key_intervals(sequence: MeshSequence, segmentation: Segmentation, options: EncoderOptions) -> Iterator[range]:
    """Yield the key intervals of a scene, of even lengths, cut also where the background changes or is sent again."""
    count, frame_rate = len(sequence), sequence.frame_rate
    longest = frames_in(options.key_interval, frame_rate)
    others = set(segmentation.changes)
    if options.scene is not None:
        others |= set(refreshes(count, frame_rate, options.scene))
    for start, stop in pairwise(sorted({0, count} | others)):
        pieces = -(-(stop - start) // longest)
        yield from (range(a, b) for a, b in pairwise(start + (stop - start) * k // pieces for k in range(pieces + 1)))


def _cut(meshes: Sequence[Mesh], frames: range, survey: Survey, longest: int) -> list[range]:
    """Cut a body's frames into intervals of at most `longest` frames.

    They are cut, too, where the scene begins or ends to have a surface: frames without are shown without background.
    """
    cuts = [k for k in range(1, len(frames)) if survey.is_bare(frames[k]) != survey.is_bare(frames[k - 1])]
    found = []
    for start, stop in pairwise([0, *cuts, len(frames)]):
        sizes = replace(survey, diagonals=tuple(mesh.diagonal for mesh in meshes[start:stop]))
        found += [range(start + some.start, start + some.stop) for some in sizes.intervals(longest)]
    return found


class Tracks:
    """Assigns the bodies of each key interval to tracks: to their own from before, or to one that is free."""

    def __init__(self, segmentation: Segmentation, near: float) -> None:
        self._cell, self._near, self._clean = segmentation.cell, near, isinstance(segmentation, ByRest)
        self._last: list[Mesh] = []  # of each track, in the last frame so far
        self._frames = 0
        self.began: list[int] = []  # the first frame of each track's first key interval: before, it is empty
        self.dropped = 0  # faces that are in no track: of pieces that were there for a moment only
        self.seen = dict[int, list[Body]]()  # what the bodies of some frames tell of the first view

    def of(self, moving: Sequence[Mesh]) -> list[tuple[int, list[Mesh]]]:
        """Return each track's mesh in each frame of the next key interval."""
        apart = find_bodies(moving, self._cell, self._near, self._clean)
        bodies, self.dropped = at_most(apart.meshes, MOST_TRACKS), self.dropped + apart.dropped
        before = same_bodies(self._last, [body[0] for body in bodies], self._cell, self._near)
        free = [number for number in range(len(self._last) + len(bodies) + 1) if number not in before]
        numbers = [free.pop(0) if old < 0 else old for old in before]
        count = max([len(self._last), 1, *(number + 1 for number in numbers)])
        found = [[Mesh.empty()] * len(moving)] * count
        for number, body in zip(numbers, bodies, strict=True):
            found[number] = body
        self.began += [self._frames] * (count - len(self.began))
        self._last = [meshes[-1] for meshes in found]
        self._frames += len(moving)
        return list(enumerate(found))


def label_frames(
    sequence: MeshSequence, segmentation: Segmentation, options: EncoderOptions
) -> Iterator[tuple[Bool[np.ndarray, " F"], UInt16[np.ndarray, " F"]]]:
    """Yield which faces of each frame move, and the body of each: 1 + its track; 0: it stands still, or is of none."""
    cell = segmentation.cell
    tracks = Tracks(segmentation, options.scene.near if options.scene else NEAR)
    for frames in key_intervals(sequence, segmentation, options):
        moving = list[Bool[np.ndarray, " F"]]()
        parts, coded = list[Mesh](), list[Mesh]()
        for number in frames:
            mesh = sequence[number]
            moving.append(segmentation.moving(number, mesh))
            parts.append(part_of(mesh, moving[-1]))
            coded.append(with_ring(mesh, moving[-1], cell))
        bodies = tracks.of(coded)
        for place, (chosen, part) in enumerate(zip(moving, parts, strict=True)):
            labels = np.zeros(len(chosen), np.uint16)
            labels[chosen] = _numbers(part, [(track + 1, meshes[place]) for track, meshes in bodies])
            yield chosen, labels


def _numbers(part: Mesh, bodies: list[tuple[int, Mesh]]) -> UInt16[np.ndarray, " F"]:
    """Return the number of the body that has each moving face; bodies are connected pieces and a ring around them."""
    found = np.zeros(len(part.faces), np.uint16)
    corners = part.vertices[part.faces[:, 0]]
    for number, body in bodies:
        if not body.is_empty and len(corners):
            found[cKDTree(body.vertices).query(corners)[0] == 0] = number  # a body has the frame's vertices
    return found
