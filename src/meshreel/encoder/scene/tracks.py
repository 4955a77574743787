"""Tracks of bodies that never touch, of a sequence without a background: each is coded apart in every key interval.

In: a job, the survey of its sequence. Out: groups of all tracks, in the order of the file. The survey alone decides
which pieces of a frame are which body, so that workers read their frames themselves, and parts of a sequence have the
tracks of the whole.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import chain

import numpy as np
from jaxtyping import Float64, Int64

from ...analysis.survey import Piece, Survey, bodies_of, box_around, unlike
from ...geometry.strict import norm, rounded
from ...metrics.distance import PSNR_CEILING, psnr
from ..group.forms import EncodedGroup, empty_groups
from ..group.interval import BodyFrames, Interval, NormalisedFrames, Views
from ..run.schedule import Job, encode_intervals


@dataclass(frozen=True, slots=True)
class TrackGroup:
    """A group of frames of one track."""

    track: int
    first_frame: int
    group: EncodedGroup
    share: float = 1.0  # of the vertices of its frames


@dataclass(frozen=True, slots=True)
class Body:
    """A body of a key interval; the defaults are those of one that is all of its frames."""

    track: int
    number: int = 0  # among the bodies of the interval
    bodies: tuple[tuple[int, ...], ...] = ()  # of each frame, the number of the body of each piece
    diagonals: tuple[float, ...] = ()  # of its box in each frame, m
    share: float = 1.0  # of the vertices of the frames


Planned = list[tuple[range, list[Body]]]  # the key intervals of a sequence, each with its bodies


def tracked_bodies(job: Job, survey: Survey) -> tuple[Planned, int]:
    """Return the key intervals with their bodies: one, in track 0, where the recipe codes none apart.

    Where some frames are chosen, these are the key intervals of the whole sequence as far as those frames go. Also
    return the number of tracks of the whole sequence.
    """
    numbered = survey.intervals(job.recipe.longest(job.sequence.frame_rate))
    if job.recipe.bodies_apart:
        whole = list(zip(numbered, _tracked(survey, numbered), strict=True))
    else:
        whole = [(frames, [Body(0)]) for frames in numbered]
    tracks = 1 + max(body.track for _, bodies in whole for body in bodies)
    if (chosen := job.chosen) is None:
        return whole, tracks
    cut: Planned = []
    for frames, bodies in whole:
        some = range(max(frames.start, chosen.start), min(frames.stop, chosen.stop))
        if len(some):
            at = slice(some.start - frames.start, some.stop - frames.start)
            cut.append((some, [replace(b, bodies=b.bodies[at], diagonals=b.diagonals[at]) for b in bodies]))
    return cut, tracks


def intervals_of(job: Job, survey: Survey, planned: Planned) -> Iterator[Interval]:
    """Yield an interval for each body of each key interval, whose frames are read where it is encoded."""
    views = Views.of(job.sequence, survey)
    for frames, bodies in planned:
        whole = NormalisedFrames(job.sequence, survey, frames)
        interval = Interval(whole, first_frame=frames.start, up=job.sequence.up, views=views)
        for body in bodies:
            if not body.bodies:
                yield interval
                continue
            some = BodyFrames(job.sequence, survey, frames, body.number, body.bodies)
            larger = min(survey.diagonals[frames.start : frames.stop]) / min(body.diagonals)
            yield replace(interval, frames=some, track=body.track, weight=Fraction(1, len(bodies)), larger=larger)


def encode_tracked(job: Job, survey: Survey) -> Iterator[list[TrackGroup]]:
    """Yield the groups of each key interval in the order of the file, whose first frame has number 0.

    All tracks have all frames, some of them empty. The PSNR of a group is that of its whole frames; its other measures
    are its body's own.
    """
    (planned, count), first = tracked_bodies(job, survey), 0
    coded = encode_intervals(job, intervals_of(job, survey, planned))
    for frames, bodies in planned:
        found, groups = list[TrackGroup](), [next(coded) for _ in bodies]
        psnrs = _psnrs(survey, frames, bodies, groups) if len(bodies) > 1 else None
        for body, some in zip(bodies, groups, strict=True):
            own = placed(body.track, first, some, body.share)
            found += own if psnrs is None else [_with_psnr(each, first, psnrs) for each in own]
        for track in {*range(count)} - {body.track for body in bodies}:
            found += placed(track, first, empty_groups(len(frames)), 0.0)
        first += len(frames)
        yield sorted(found, key=lambda each: (each.first_frame, each.track))


def placed(track: int, first: int, groups: Iterable[EncodedGroup], share: float = 1.0) -> Iterator[TrackGroup]:
    """Yield the groups of a track from a frame on."""
    for group in groups:
        yield TrackGroup(track, first, group, share)
        first += group.frame_count


def _with_psnr(each: TrackGroup, first: int, psnrs: Float64[np.ndarray, " T"]) -> TrackGroup:
    """Return a group with the mean PSNR of its frames; those of a key interval begin with that of frame `first`."""
    start = each.first_frame - first
    psnr = float(psnrs[start : start + each.group.frame_count].mean())
    return replace(each, group=replace(each.group, fidelity=replace(each.group.fidelity, psnr=psnr)))


def _psnrs(
    survey: Survey, frames: range, bodies: Sequence[Body], groups: Sequence[Sequence[EncodedGroup]]
) -> Float64[np.ndarray, " T"]:
    """Return the d2_psnr_paper of frames from those of their bodies, dB, each relative to its own diagonal."""
    squares = np.zeros(len(frames))  # mean over the vertices, m^2
    for body, some in zip(bodies, groups, strict=True):
        of_peak = [rounded(10 ** (-group.fidelity.psnr / 10)) for group in some for _ in range(group.frame_count)]
        squares += body.share * np.array(of_peak) * np.square(body.diagonals)
    peaks = survey.diagonals[frames.start : frames.stop]
    return np.array([min(psnr(*both), PSNR_CEILING) for both in zip(squares.tolist(), peaks, strict=True)])


def _tracked(survey: Survey, numbered: Sequence[range]) -> Iterator[list[Body]]:
    """Yield the bodies of each key interval, each in the track whose last surface was most like it.

    A body that is all of its frames is in track 0.
    """
    last = np.zeros((0, 6))  # the box of each track, where it had one last
    for frames in numbered:
        pieces = survey.pieces[frames.start : frames.stop]
        if (numbers := bodies_of(pieces)) is None:
            yield [Body(0)]
            continue
        count = 1 + int(numbers[0].max())
        first, end = (_boxes(pieces[k], numbers[k], count) for k in (0, -1))
        tracks = _matched(last, first)
        last = np.concatenate([last, end[: max(0, count - len(last))]])
        last[tracks] = end
        found = [_body(track, k, pieces, numbers) for k, track in enumerate(tracks)]
        yield sorted(found, key=lambda body: body.track)


def _matched(last: Float64[np.ndarray, "K 6"], first: Float64[np.ndarray, "B 6"]) -> list[int]:
    """Return the track of each body: those most like each other first, then tracks that are new."""
    apart, found = unlike(first, last), [-1] * len(first)
    for _ in range(min(apart.shape)):
        body, track = np.unravel_index(int(apart.argmin()), apart.shape)
        found[int(body)] = int(track)
        apart[body, :] = apart[:, track] = np.inf
    more = iter(range(len(last), len(last) + len(first)))
    return [next(more) if track < 0 else track for track in found]


def _boxes(pieces: Sequence[Piece], numbers: Int64[np.ndarray, " P"], count: int) -> Float64[np.ndarray, "B 6"]:
    """Return the box of each body in a frame, without bits."""
    boxes = np.array([piece.box for piece in pieces])
    return np.array([box_around(boxes[numbers == body]) for body in range(count)])


def _body(
    track: int, number: int, pieces: Sequence[Sequence[Piece]], numbers: Sequence[Int64[np.ndarray, " P"]]
) -> Body:
    """Return the body of this number, in a track."""
    mine = [[some[k] for k in np.flatnonzero(of == number).tolist()] for some, of in zip(pieces, numbers, strict=True)]
    boxes = [box_around(np.array([piece.around for piece in some])) for some in mine]
    diagonals = tuple(norm(box[3:] - box[:3]) for box in boxes)
    ours, whole = (sum(piece.vertices for piece in chain.from_iterable(some)) for some in (mine, pieces))
    return Body(track, number, tuple(tuple(some.tolist()) for some in numbers), diagonals, ours / whole)
