"""What a TVMC* stream is made of, before a step is chosen: references, displacements, the background.

In: an encoder that found the spans, the options of preset `paper`. Out: Tracking; it does not depend on the rate.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from meshreel.analysis.survey import Survey, survey
from meshreel.coding.reference_mesh import CodedReference
from meshreel.encoder.forms import displacement_field, intra_only
from meshreel.encoder.interval import Interval
from meshreel.encoder.options import EncoderOptions, PaperOptions
from meshreel.encoder.paper import FoundGroup
from meshreel.encoder.scene import Static, encode_static
from meshreel.encoder.sequence import Encoder
from meshreel.encoder.target import target_of


@dataclass(frozen=True, slots=True)
class Tracked:
    """Frames that one reference follows."""

    first_frame: int
    reference: CodedReference
    field: Float64[np.ndarray, "V T 3"]  # displacements of its base, normalised

    @property
    def width(self) -> float:
        """The longest side of the box of a frame's displacements, the widest frame's."""
        return float(np.ptp(self.field, axis=0).max())

    @property
    def largest(self) -> float:
        """The largest magnitude of a displacement's coordinate."""
        return float(np.abs(self.field).max())


@dataclass(frozen=True, slots=True)
class Untracked:
    """Frames that none follows, as Draco meshes."""

    first_frame: int
    frame_count: int
    payload: bytes


@dataclass(frozen=True, slots=True)
class Tracking:
    """What is known of a sequence; groups are in the order of their first frames."""

    seen: Survey
    states: list[Static]  # of the background; none: everything may move
    groups: list[Tracked | Untracked]  # of frames with surface


def track_sequence(encoder: Encoder, options: EncoderOptions) -> Tracking:
    """The groups of a sequence, of each body of a scene. Raises InputError for frames that cannot be used.

    Spans that the encoder prepared are not looked for again.
    """
    sequence, parts, groups = encoder.sequence, encoder.parts(options), list[Tracked | Untracked]()
    assert isinstance(options.method, PaperOptions), "references are those of the paper's recipe"
    for interval in encoder.intervals(options):
        if not interval.frames[0].is_empty:
            groups += _groups(interval, encoder.store.find(interval, options.method), options.method)
    seen, states = survey(sequence) if parts is None else parts.seen, list[Static]()
    if parts is not None and options.scene is not None:
        states = encode_static(parts, len(sequence), sequence.frame_rate, options.scene.background)
    return Tracking(seen, states, sorted(groups, key=lambda group: group.first_frame))


def _groups(interval: Interval, found: Sequence[FoundGroup], options: PaperOptions) -> Iterator[Tracked | Untracked]:
    """The groups of an interval."""
    first = interval.first_frame
    for group in found:
        if group.fitted is None:
            target = target_of(group.frames, options.target, interval.noise)
            yield Untracked(first, len(group.frames), intra_only(group.frames, target, options.intra).payload)
        else:
            reference = group.fitted.reference
            yield Tracked(first, reference, displacement_field(reference, group.fitted.positions))
        first += len(group.frames)
