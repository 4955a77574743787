"""Cache of groups that the paper's analysis finds, for encodes of one sequence at several rates.

In: an encoder, options. Out: the encoder, which analyses no more what it has analysed.
"""

from __future__ import annotations

import hashlib
from dataclasses import replace

import numpy as np
from threadpoolctl import threadpool_limits

from meshreel.encoder.group.interval import Interval
from meshreel.encoder.group.progress import Stages
from meshreel.encoder.paper.options import PaperOptions
from meshreel.encoder.paper.recipe import Fitted, FoundGroup, find_groups
from meshreel.encoder.sequence import Encoder
from meshreel.encoder.settings.options import EncoderOptions

Found = tuple[tuple[int, Fitted | None], ...]  # of each group its number of frames, and the reference that follows them


class GroupStore:
    """Groups by interval and options. It keeps references and positions, but no frames."""

    def __init__(self) -> None:
        self._known: dict[bytes, Found] = {}

    def keep(self, interval: Interval, options: PaperOptions, stages: Stages | None = None) -> None:
        """Find and keep the groups of an interval."""
        if not interval.frames[0].is_empty and (key := _key(interval, options)) not in self._known:
            found = find_groups(interval, options, stages)
            self._known[key] = tuple((len(group.frames), group.fitted) for group in found)

    def find(self, interval: Interval, options: PaperOptions, stages: Stages | None = None) -> list[FoundGroup]:
        """Return the groups of `paper.find_groups`, from the store if the interval is kept."""
        if (known := self._known.get(_key(interval, options))) is None:
            return find_groups(interval, options, stages)
        frames, groups, first = list(interval.frames), list[FoundGroup](), 0
        for count, fitted in known:
            groups.append(FoundGroup(frames[first : first + count], fitted))
            first += count
        return groups


@threadpool_limits.wrap(limits=1)
def prepare(encoder: Encoder, options: EncoderOptions) -> None:
    """Find in advance what `encode` finds before a rate is chosen; raises what `encode` raises.

    These are the parts of a scene and, for the paper's recipe, its groups for any size of the basis. They take a few
    hundred kB a frame, as long as the encoder lives.
    """
    parts, count = encoder.parts(options), len(encoder.sequence)
    if isinstance(options.method, PaperOptions):
        store, stages = GroupStore(), Stages(encoder.progress, count)
        encoder.find = store.find
        for interval in encoder.intervals(options):
            store.keep(interval, options.method, stages if parts is None else None)
            stages.reach("fit", interval.stop / count)


def shared_options(options: EncoderOptions) -> EncoderOptions:
    """Return the options with defaults for all that encodes at several rates need not share.

    The paper's recipe shares all but the coding of displacements; that of layers only how a scene is taken apart.
    """
    if isinstance(options.method, PaperOptions):
        return replace(options, method=_shared(options.method), quality=EncoderOptions().quality)
    return EncoderOptions(scene=options.scene)


def _shared(options: PaperOptions) -> PaperOptions:
    return replace(options, displacements=PaperOptions().displacements)


def _key(interval: Interval, options: PaperOptions) -> bytes:
    """Return a key that is equal where the groups are."""
    digest = hashlib.sha256(repr((_shared(options), interval.noise)).encode())
    for frame in interval.frames:
        for array in (frame.vertices, frame.faces):
            digest.update(repr((array.shape, array.dtype)).encode())
            digest.update(np.ascontiguousarray(array).data)
    return digest.digest()
