"""Encoding job: a sequence, its options, and analyses reused when the same sequence is encoded at several rates."""

from __future__ import annotations

import hashlib
from concurrent.futures import Executor
from dataclasses import dataclass, field, replace

import numpy as np

from ..geometry.derived_sequences import DerivedSequence
from .digests import WriteLines, line_of
from .excerpt import Excerpt
from .interval import Interval
from .journal import Journal
from .options import EncoderOptions, PaperOptions, SceneOptions
from .paper import Fitted, FoundGroup, find_groups
from .progress import Stages

Found = tuple[tuple[int, Fitted | None], ...]  # of each group its number of frames, and the reference that follows them


class GroupStore:
    """Groups found by the paper's analysis, kept for encodes of the same sequence at several rates.

    They do not depend on how displacements are coded. The store keeps references and positions, but no frames.
    """

    def __init__(self) -> None:
        self._known: dict[bytes, Found] = {}

    def keep(self, interval: Interval, options: PaperOptions, stages: Stages | None = None) -> None:
        """Find and keep the groups of an interval."""
        if not interval.frames[0].is_empty and (key := _key(interval, options)) not in self._known:
            found = find_groups(interval, options, stages)
            self._known[key] = tuple((len(group.frames), group.fitted) for group in found)

    def find(self, interval: Interval, options: PaperOptions, stages: Stages | None = None) -> list[FoundGroup]:
        """Return what `paper.find_groups` returns, from the store where the interval is kept."""
        if not self._known or (known := self._known.get(_key(interval, options))) is None:
            return find_groups(interval, options, stages)
        frames, groups, first = list(interval.frames), list[FoundGroup](), 0
        for count, fitted in known:
            groups.append(FoundGroup(frames[first : first + count], fitted))
            first += count
        return groups


@dataclass(frozen=True, slots=True)
class Job:
    """A sequence to encode, its options, and the means to do it."""

    sequence: DerivedSequence
    options: EncoderOptions
    executor: Executor | None
    stages: Stages
    store: GroupStore = field(default_factory=GroupStore)
    journal: Journal | None = None  # of the output; None where groups are not kept
    digests: WriteLines | None = None  # of what the stages compute; None where nobody asks
    excerpt: Excerpt | None = None  # the frames that are encoded; None: all

    def note(self, stage: str, *values: object) -> None:
        """Write the line of a stage where digests are wanted."""
        if self.digests is not None:
            self.digests(line_of(stage, *values))

    @property
    def scene(self) -> SceneOptions:
        """The options of a scene, where the sequence is one."""
        assert self.options.scene is not None, "a sequence without scene options is not taken apart"
        return self.options.scene


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
