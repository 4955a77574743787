"""What a TVMC* stream is made of, before a step is chosen: references, displacements, the background.

In: a sequence, the options of preset `paper`. Out: Tracking; it does not depend on the rate, so that points of one
curve may share it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from ....analysis.segment.probe import is_scene
from ....analysis.survey import Survey, survey
from ....coding.reference import CodedReference
from ....parts import take_apart
from ....scene import Static, Tracks, body_runs, encode_static, segments
from ....types import Mesh, MeshSequence
from ....windows import EncoderOptions, Stages, displacement_field, find_spans, intra_only


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


def track_sequence(sequence: MeshSequence, options: EncoderOptions, stages: Stages) -> Tracking:
    """The groups of a sequence, of each body of a scene. Raises InputError for frames that cannot be used."""
    if len(sequence) and is_scene(sequence):
        return _track_scene(sequence, options, stages)
    seen, groups = survey(sequence, stages), list[Tracked | Untracked]()
    for window in seen.windows(options.group_size):
        frames = [seen.normalise(sequence[number]) for number in window]
        groups += _groups(window.start, frames, options, stages)
    return Tracking(seen, [], groups)


def _track_scene(sequence: MeshSequence, options: EncoderOptions, stages: Stages) -> Tracking:
    parts = take_apart(sequence, survey(sequence, stages, cleaned=False), options, stages)
    states = encode_static(parts, len(sequence), sequence.frame_rate, options.background)
    tracks, groups = Tracks(parts.segmentation.cell, options), list[Tracked | Untracked]()
    for frames in segments(sequence, parts.segmentation, options):
        for run in body_runs(sequence, parts, frames, tracks):
            groups += _groups(run.first_frame, run.frames, options, Stages(None, len(run.frames)))
        stages.add("fit", len(frames))
    return Tracking(parts.seen, states, sorted(groups, key=lambda group: group.first_frame))


def _groups(first: int, frames: list[Mesh], options: EncoderOptions, stages: Stages) -> Iterator[Tracked | Untracked]:
    """The groups of a window; none where its frames are empty."""
    if frames[0].is_empty:
        return
    for span in find_spans(frames, options, stages):
        if span.fitted is None:
            yield Untracked(first, len(span.frames), intra_only(span.frames, options).payload)
        else:
            reference = span.fitted.reference
            yield Tracked(first, reference, displacement_field(reference, span.fitted.positions))
        first += len(span.frames)
