"""Content of a TVMC* stream that no rate changes. In: an encoder that has tracked the frames. Out: Tracking."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from meshreel.analysis.survey import Survey, survey
from meshreel.coding.reference_mesh import CodedReference
from meshreel.encoder.group.forms import intra_only
from meshreel.encoder.group.interval import Interval
from meshreel.encoder.group.target import target_of
from meshreel.encoder.paper.options import PaperOptions
from meshreel.encoder.paper.recipe import FoundGroup, displacement_field
from meshreel.encoder.scene.static import Static, encode_static
from meshreel.encoder.sequence import Encoder
from meshreel.encoder.settings.options import EncoderOptions


@dataclass(frozen=True, slots=True)
class Tracked:
    """A group of frames that one reference follows."""

    first_frame: int
    reference: CodedReference
    field: Float64[np.ndarray, "V T 3"]  # displacements of its base, normalised


@dataclass(frozen=True, slots=True)
class Untracked:
    """A group of frames that no reference follows, as Draco meshes."""

    first_frame: int
    frame_count: int
    payload: bytes


@dataclass(frozen=True, slots=True)
class Tracking:
    """A tracked sequence."""

    seen: Survey
    states: list[Static]  # of the background; empty: everything may move
    groups: list[Tracked | Untracked]  # of frames with surface, in the order of their first frames


def track_sequence(encoder: Encoder, options: EncoderOptions) -> Tracking:
    """Return the groups of each body, by a prepared encoder's analysis. Raises InputError for unusable frames."""
    sequence, parts, groups = encoder.sequence, encoder.parts(options), list[Tracked | Untracked]()
    assert isinstance(options.method, PaperOptions), "references are those of the paper's recipe"
    for interval in encoder.intervals(options):
        if not interval.frames[0].is_empty:
            groups += _groups(interval, encoder.find(interval, options.method, None), options.method)
    seen, states = survey(sequence) if parts is None else parts.seen, list[Static]()
    if parts is not None and options.scene is not None:
        states = encode_static(parts, len(sequence), sequence.frame_rate, options.scene)
    return Tracking(seen, states, sorted(groups, key=lambda group: group.first_frame))


def _groups(interval: Interval, found: Sequence[FoundGroup], options: PaperOptions) -> Iterator[Tracked | Untracked]:
    """Yield the groups of an interval."""
    first = interval.first_frame
    for group in found:
        if group.fitted is None:
            target = target_of(group.frames, options.target, interval.noise)
            yield Untracked(first, len(group.frames), intra_only(group.frames, target, options.intra).payload)
        else:
            reference = group.fitted.reference
            yield Tracked(first, reference, displacement_field(reference, group.fitted.positions))
        first += len(group.frames)
