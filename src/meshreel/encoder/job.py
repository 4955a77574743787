"""Encoding job: a sequence, its options, and analyses reused when the same sequence is encoded at several rates."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field, replace

import numpy as np

from ..format.layout import Form
from ..types import Mesh, MeshSequence
from .options import EncoderOptions
from .paper import Fitted, FoundGroup, find_groups
from .progress import Stages

Found = tuple[tuple[int, Fitted | None], ...]  # of each group its number of frames, and the reference that follows them


class GroupStore:
    """Groups found by the paper's analysis, kept for encodes of the same sequence at several rates.

    They do not depend on how displacements are coded. The store keeps references and positions, but no frames.
    """

    def __init__(self) -> None:
        self._known: dict[bytes, Found] = {}

    def keep(self, frames: Sequence[Mesh], options: EncoderOptions, stages: Stages | None = None) -> None:
        """Find and keep the groups of an interval, whose frames are all empty or none is."""
        if not frames[0].is_empty and (key := _key(frames, options)) not in self._known:
            found = find_groups(frames, options, stages)
            self._known[key] = tuple((len(group.frames), group.fitted) for group in found)

    def find(self, frames: Sequence[Mesh], options: EncoderOptions, stages: Stages | None = None) -> list[FoundGroup]:
        """Return what `paper.find_groups` returns, from the store where the interval is kept."""
        if not self._known or (known := self._known.get(_key(frames, options))) is None:
            return find_groups(frames, options, stages)
        groups, first = list[FoundGroup](), 0
        for count, fitted in known:
            groups.append(FoundGroup(frames[first : first + count], fitted))
            first += count
        return groups


@dataclass(frozen=True, slots=True)
class Job:
    """A sequence to encode, its options, and the means to do it."""

    sequence: MeshSequence
    options: EncoderOptions
    executor: Executor | None
    stages: Stages
    store: GroupStore = field(default_factory=GroupStore)


def shared_options(options: EncoderOptions) -> EncoderOptions:
    """Return the options with defaults for all that encodes at several rates need not share.

    Form LAPLACIAN shares all but the coding of displacements; form LAYERS shares only how a scene is taken apart.
    """
    if options.form == Form.LAPLACIAN:
        plain = EncoderOptions()
        return replace(options, preset=plain.preset, quality=plain.quality, displacements=plain.displacements)
    apart = {name: getattr(options, name) for name in ("form", "dynamic_only", "segment", "background")}
    return EncoderOptions(**apart)


def _key(frames: Sequence[Mesh], options: EncoderOptions) -> bytes:
    """Return a key that is equal where the groups are."""
    plain = EncoderOptions()  # how a scene was taken apart shows in the frames
    decisive = replace(shared_options(options), segment=plain.segment, background=plain.background)
    digest = hashlib.sha256(repr(decisive).encode())
    for frame in frames:
        for array in (frame.vertices, frame.faces):
            digest.update(repr((array.shape, array.dtype)).encode())
            digest.update(np.ascontiguousarray(array).data)
    return digest.digest()
