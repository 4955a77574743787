"""Intervals of a file that decode alone: whole groups of all tracks, and all chunks that these are predicted from.

In: a reader and frames. Out: the frames from which to which the file has to be kept, and the chunks of these.
"""

from __future__ import annotations

from ..container.reader import Chunk, ReelReader
from ..format.checks import COMPANIONS
from ..format.layout import ChunkKind


def interval_of(reader: ReelReader, frames: range) -> range:
    """Return the shortest interval that contains given frames, and begins and ends with groups of all tracks.

    It begins with groups that name no group before. Pictures of a background are counted from the first frame that it
    is shown in, which an interval then begins with. Hidden frames have numbers below 0, or from `frame_count` on.
    """
    start, end = frames.start, frames.stop
    while True:
        groups = [_group_at(own, start) for own in reader.tracks]
        earlier = min(_stands_alone(reader, group).first_frame for group in groups)
        later = max(own.first_frame + own.frame_count for own in (_group_at(of, end - 1) for of in reader.tracks))
        counted = [reader.shown_from(state) for state in _states(reader, range(start, end)) if _is_timed(reader, state)]
        if (found := (min([earlier, *counted]), later)) == (start, end):
            return range(start, end)
        start, end = found


def kept_chunks(reader: ReelReader, interval: range) -> list[int]:
    """Return the numbers of the chunks that an interval needs, and of audio, in the order of the file."""
    kept = {group.number for group in reader.groups if group.first_frame in interval}
    waiting = list(kept)
    while waiting:
        new = set(reader.chunks[waiting.pop()].depends_on) - kept
        kept |= new
        waiting += new
    kept |= {c.number for c in reader.chunks if c.kind in COMPANIONS and c.depends_on[0] in kept}
    return sorted(kept | ({reader.audio.number} if reader.audio else set()))


def _group_at(groups: tuple[Chunk, ...], frame: int) -> Chunk:
    return next(group for group in reversed(groups) if group.first_frame <= frame)


def _stands_alone(reader: ReelReader, group: Chunk) -> Chunk:
    """Return the first group of a group's chain of predictions."""
    while (before := reader.group_before(group)) is not None:
        group = before
    return group


def _states(reader: ReelReader, frames: range) -> list[Chunk]:
    some = [g for g in reader.groups if g.first_frame < frames.stop and g.first_frame + g.frame_count > frames.start]
    named = {number for group in some for number in group.depends_on}
    return [reader.chunks[number] for number in named if reader.chunks[number].kind == ChunkKind.STATIC]


def _is_timed(reader: ReelReader, state: Chunk) -> bool:
    kinds = (ChunkKind.PICTURES, ChunkKind.COMPATIBLE)
    return any(reader.companion_of(state, kind) is not None for kind in kinds)
