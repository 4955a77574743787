"""What is to be encoded, how, and what is known of it from before: what the stages of an encoder have in common."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field, replace

import numpy as np

from ..format.layout import Form
from ..types import Mesh, MeshSequence
from .paper import EncoderOptions, Fitted, Span, Stages, find_spans

Found = tuple[tuple[int, Fitted | None], ...]  # of each span its number of frames, and what follows them


class SpanStore:
    """Spans of windows that were looked at before, for who codes a sequence at several rates.

    Spans do not depend on how displacements are coded. Kept are references and positions, no frames.
    """

    def __init__(self) -> None:
        self._known: dict[bytes, Found] = {}

    def keep(self, frames: Sequence[Mesh], options: EncoderOptions, stages: Stages | None = None) -> None:
        """Finds the spans of a window, frames all empty or none is, and keeps them."""
        if not frames[0].is_empty and (key := _key(frames, options)) not in self._known:
            found = find_spans(frames, options, stages)
            self._known[key] = tuple((len(span.frames), span.fitted) for span in found)

    def find(self, frames: Sequence[Mesh], options: EncoderOptions, stages: Stages | None = None) -> list[Span]:
        """As `windows.find_spans`; those that were kept are not looked for again."""
        if not self._known or (known := self._known.get(_key(frames, options))) is None:
            return find_spans(frames, options, stages)
        spans, first = list[Span](), 0
        for count, fitted in known:
            spans.append(Span(frames[first : first + count], fitted))
            first += count
        return spans


@dataclass(frozen=True, slots=True)
class Work:
    """What is to be encoded, and how."""

    sequence: MeshSequence
    options: EncoderOptions
    executor: Executor | None
    stages: Stages
    spans: SpanStore = field(default_factory=SpanStore)


def shared_options(options: EncoderOptions) -> EncoderOptions:
    """What decides about that which encodes at several rates share: the others have their defaults.

    Of form LAPLACIAN all but how displacements are coded; of form LAYERS those alone that take a scene apart.
    """
    if options.form == Form.LAPLACIAN:
        plain = EncoderOptions()
        return replace(options, preset=plain.preset, quality=plain.quality, displacements=plain.displacements)
    apart = {name: getattr(options, name) for name in ("form", "dynamic_only", "segment", "background")}
    return EncoderOptions(**apart)


def _key(frames: Sequence[Mesh], options: EncoderOptions) -> bytes:
    """Equal where spans are."""
    plain = EncoderOptions()  # how a scene was taken apart shows in the frames
    decisive = replace(shared_options(options), segment=plain.segment, background=plain.background)
    digest = hashlib.sha256(repr(decisive).encode())
    for frame in frames:
        for array in (frame.vertices, frame.faces):
            digest.update(repr((array.shape, array.dtype)).encode())
            digest.update(np.ascontiguousarray(array).data)
    return digest.digest()
