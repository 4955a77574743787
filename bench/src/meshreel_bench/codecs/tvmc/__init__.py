"""TVMC*: each group as one tracked reference and its displacements, both coded by Draco. A sequence <-> bytes.

The baseline of the TSMC paper (section 4.2), after "TVMC: Time-Varying Mesh Compression Using Volume-Tracked Reference
Meshes" (Chen, Hácha, Váša and Dasari, MMSys 2025). References and displacements are those of preset `paper`.

Differs from the publication:
- It decodes without the originals, where the published code looks displacements up: they keep their order, which costs
  bytes. Vertices are ordered along the reference's surface, so that Draco predicts each from a neighbour: fewer bytes.
- One quantization step in metres for all groups, with `qp` bits for the widest frame; there each frame has its own.
- Vertices are fitted to the surface with a smooth field; there each jumps to the nearest vertex of the frame.
- Groups are cut, and frames become Draco meshes, where no reference follows them, as in preset `paper`. The quality of
  these meshes follows from the number of vertices, not from `qp`; Draco meshes are never chosen for their size.
- Each body of a scene has its own references, so that curves differ from preset `paper` by the coding alone.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float64

from meshreel.analysis.survey import Survey, survey_sequence
from meshreel.coding.layers.patches import run_lengths
from meshreel.coding.mesh import CodedReference
from meshreel.encoder.group.forms import intra_only, target_of
from meshreel.encoder.group.interval import Interval
from meshreel.encoder.paper.recipe import FoundGroup, PaperOptions, displacement_field
from meshreel.encoder.scene.static import Static, encode_static
from meshreel.encoder.sequence import Encoder
from meshreel.encoder.settings.options import EncoderOptions
from meshreel.encoder.settings.settings import Settings
from meshreel.errors import InputError
from meshreel.types import Mesh

from ...codec import Progress
from ..meshreel import Prepared
from .stream import MOST_CELLS, Group, Kind, State, Stream, TvmcVideo, encode_tracked, pack_stream, unpack_stream

USUAL = 2000  # vertices of a reference
LEAST_QP, MOST_QP = 2, 16  # bits; guesses


def quality_of_vertices(vertices: int) -> float:
    """Return the quality, 0 to 100, whose reference mesh is nearest to this number of vertices."""
    return min(max(50 + 50 * math.log(max(vertices, 1) / USUAL, 2.5), 0.0), 100.0)


@dataclass(frozen=True, slots=True)
class TvmcCodec(Prepared):
    """TVMC* with displacements of `qp` bits; operating points that differ in `qp` alone share an analysis."""

    qp: int = 9  # bits along the longest side of the widest frame's displacements
    vertices: int = USUAL  # of the reference, before its subdivision
    group_size: int = 10  # largest number of frames in a group
    centers: int = 2000

    def __post_init__(self) -> None:
        if not LEAST_QP <= self.qp <= MOST_QP:
            raise InputError(f"qp {self.qp}: give {LEAST_QP} to {MOST_QP} bits")
        _ = self.encoder_options  # raises InputError for invalid options

    @property
    def name(self) -> str:
        """The name in rows and plots; a larger reference makes another curve."""
        return "tvmc" if self.vertices <= USUAL else f"tvmc, {self.vertices} vertices"

    @property
    def encoder_options(self) -> EncoderOptions:
        """Options of preset `paper` at the quality with `vertices` vertices, which sets the target of references."""
        quality = quality_of_vertices(self.vertices)
        options = Settings("paper", quality, group_size=self.group_size, centers=self.centers).resolved()
        assert isinstance(options.method, PaperOptions)
        reference = replace(options.method.reference, vertices=self.vertices)
        return replace(options, method=replace(options.method, reference=reference))

    def code(self, analysis: Encoder, progress: Progress | None = None) -> bytes:
        data, count = self.pack(track_sequence(analysis, self.encoder_options)), len(analysis.sequence)
        if progress is not None:
            progress("code", count, count)
        return data

    def pack(self, tracking: Tracking) -> bytes:
        """Return the stream of tracked groups."""
        survey, step = tracking.survey, self.step(tracking)
        bare = np.array([survey.is_bare(frame) for frame in range(len(survey.diagonals))])
        runs = tuple(run_lengths(bare).tolist()) if tracking.states and bare.any() else ()
        states = tuple(State(state.frame, state.payload) for state in tracking.states)
        groups = tuple(each.coded(step) if isinstance(each, Tracked) else each for each in tracking.groups)
        origin, scale, count = tuple(map(float, survey.center)), survey.unit, len(bare)
        record = Stream(
            frame_count=count, origin=origin, scale=scale, step=step, bare=runs, states=states, groups=groups
        )
        return pack_stream(record)

    def step(self, tracking: Tracking) -> float:
        """Return the step of displacements, normalised; one for all groups, so that still vertices stay."""
        fields = [group.field for group in tracking.groups if isinstance(group, Tracked)]
        width = max((float(np.ptp(field, axis=0).max()) for field in fields), default=0.0)  # of the widest frame's box
        largest = max((float(np.abs(field).max()) for field in fields), default=0.0)
        return max(width / (2**self.qp - 1), largest / MOST_CELLS) or 1.0

    def background_bytes(self, data: bytes) -> int:
        return sum(len(state.payload) for state in unpack_stream(data).states)

    def decode(self, data: bytes) -> Sequence[Mesh]:
        return TvmcVideo(data)


@dataclass(frozen=True, slots=True)
class Tracked:
    """A group of frames that one reference follows."""

    first_frame: int
    reference: CodedReference
    field: Float64[np.ndarray, "V T 3"]  # displacements of its base, normalised

    def coded(self, step: float) -> Group:
        """Return the group with displacements rounded to multiples of `step`."""
        payload = encode_tracked(self.reference, self.field, step)
        return Group(self.first_frame, self.field.shape[1], Kind.TRACKED, payload)


@dataclass(frozen=True, slots=True)
class Tracking:
    """A tracked sequence."""

    survey: Survey
    states: list[Static]  # of the background; empty: everything may move
    groups: list[Tracked | Group]  # of frames with surface, in the order of their first frames; others as Draco


def track_sequence(encoder: Encoder, options: EncoderOptions) -> Tracking:
    """Return the groups of each body, by a prepared encoder's analysis. Raises InputError for unusable frames."""
    sequence, parts, groups = encoder.sequence, encoder.parts(options), list[Tracked | Group]()
    assert isinstance(options.method, PaperOptions), "references are those of the paper's recipe"
    for interval in encoder.intervals(options):
        if not interval.frames[0].is_empty:
            groups += _groups(interval, encoder.find(interval, options.method), options.method)
    survey, states = survey_sequence(sequence) if parts is None else parts.survey, list[Static]()
    if parts is not None and options.scene is not None:
        states = encode_static(parts, len(sequence), sequence.frame_rate, options.scene)
    return Tracking(survey, states, sorted(groups, key=lambda group: group.first_frame))


def _groups(interval: Interval, found: Sequence[FoundGroup], options: PaperOptions) -> Iterator[Tracked | Group]:
    """Yield the groups of an interval; those that no reference follows are Draco meshes."""
    first = interval.first_frame
    for group in found:
        if group.fitted is None:
            target = target_of(group.frames, options.target, interval.noise)
            payload = intra_only(group.frames, target, options.intra).payload
            yield Group(first, len(group.frames), Kind.DRACO, payload)
        else:
            reference = group.fitted.reference
            yield Tracked(first, reference, displacement_field(reference, group.fitted.positions))
        first += len(group.frames)
