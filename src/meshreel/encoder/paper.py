"""A window of frames becomes groups: track, reference, fit, cut where it fails, code, and choose the cheaper form.

In -> out: frames in normalised coordinates -> payloads with what was measured on them (paper, sections 3.1 and 3.3). A
window needs nothing but its frames, so windows can be spread over processes.

Differs from the paper: groups are not all of one length, and frames that no reference follows are coded one by one.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from jaxtyping import Float64

from ..analysis.fit.surface_fit import Fit, FitOptions, fit_frames
from ..analysis.follow.correspond import PLACES
from ..analysis.follow.embedded import EmbeddedOptions
from ..analysis.follow.fused_template import FusedOptions
from ..analysis.follow.template import TemplateOptions
from ..analysis.groups import GroupOptions, cut_at
from ..analysis.reference.extraction import ReferenceOptions, extract_reference, predict
from ..analysis.reference.track import TrackOptions, track_centers
from ..analysis.scene.background import BackgroundOptions
from ..analysis.scene.bodies import BodyOptions
from ..analysis.scene.segmentation import SegmentOptions
from ..coding.group import decode_group, encode_group
from ..coding.intra import encode_empty
from ..coding.layers.coder import LayersOptions
from ..coding.paper.displacements import DisplacementOptions
from ..coding.reference_mesh import CodedReference, code_reference
from ..errors import InputError, NoReferenceError
from ..format.layout import Form
from ..metrics.normals import WORST_ANGLE
from ..types import Centers, Frames, Mesh
from .draco import NO_ERROR, IntraOptions, Quality, cheapest_intra, finest_intra, measure
from .tails import TailOptions

Progress = Callable[[str, int, int], None]  # stage, frames done in it, frames of the sequence
MOST_FRAMES = 64  # in a group: the tracker's distances and the basis grow with it
MOST_FOR_HALF = 2  # times the bytes that half the distance (6 dB) may cost; a finer template gives 4 dB for that
MOST_NOISE = 0.05  # RMS, of the diagonal: beyond, nothing is left of a hand
MOST_SECONDS = 600  # of a key interval: whoever joins late decodes as much before a picture is there


@dataclass(frozen=True, slots=True)
class EncoderOptions:
    """How to encode; `presets.preset_options` fills it from a preset's name and a quality."""

    preset: str = "paper"
    quality: float = 50.0  # 0 to 100; what the other fields were made from, recorded in the file
    group_size: int = 10  # most frames in a group, the paper's GoF
    reference_bits: int = 14  # of the reference's lattice (paper: qp = 14)
    levels: int = 1  # midpoint subdivisions of the decoded reference
    target: Quality = Quality(0.0005, 7.0, 0.0008)  # what every frame should be worth, relative to its own diagonal
    track: TrackOptions = field(default_factory=TrackOptions)
    reference: ReferenceOptions = field(default_factory=ReferenceOptions)
    fit: FitOptions = field(default_factory=FitOptions)
    groups: GroupOptions = field(default_factory=GroupOptions)
    displacements: DisplacementOptions = field(default_factory=DisplacementOptions)
    intra: IntraOptions = field(default_factory=IntraOptions)
    form: Form = Form.LAPLACIAN  # of the groups that a template follows; or LAYERS
    keys: int = 5  # frames tried as the key of a group, at most (form LAYERS)
    predict: bool = True  # groups from the one before, where its template still fits (form LAYERS)
    key_interval: float = 4.0  # s, at most, from one random-access point to the next (form LAYERS)
    embedded: EmbeddedOptions = field(default_factory=EmbeddedOptions)
    template: TemplateOptions = field(default_factory=TemplateOptions)
    layers: LayersOptions = field(default_factory=LayersOptions)
    tails: TailOptions | None = field(default_factory=TailOptions)  # None: no patches (form LAYERS)
    noise: float = 0.0  # RMS distance of the frames from the truth, normalised; 0: a clean capture
    fused: FusedOptions = field(default_factory=FusedOptions)
    dynamic_only: bool = False  # True: no background is looked for, everything may move
    segment: SegmentOptions = field(default_factory=SegmentOptions)
    background: BackgroundOptions = field(default_factory=BackgroundOptions)
    bodies: BodyOptions = field(default_factory=BodyOptions)

    def __post_init__(self) -> None:
        if not 0 <= self.quality <= 100:
            raise InputError(f"quality must be in 0 to 100, got {self.quality:g}")
        if not 1 <= self.group_size <= MOST_FRAMES:
            raise InputError(f"group size must be in 1 to {MOST_FRAMES}, got {self.group_size}")
        if self.form not in (Form.LAPLACIAN, Form.LAYERS):
            raise InputError(f"form {self.form}: give LAPLACIAN or LAYERS; the others are taken where these cost more")
        if not 1 <= self.keys <= len(PLACES):
            raise InputError(f"{self.keys} keys: give 1 to {len(PLACES)}")
        if not 0 < self.key_interval <= MOST_SECONDS:
            raise InputError(f"key interval {self.key_interval:g}: give seconds, above 0 and at most {MOST_SECONDS}")
        if not 1 <= self.reference_bits <= 20 or not 0 <= self.levels <= 4:
            raise InputError(f"reference bits {self.reference_bits}, levels {self.levels}: give 1 to 20 and 0 to 4")
        if not 0 <= self.noise <= MOST_NOISE:
            raise InputError(f"noise {self.noise:g}: give it in units of the diagonal, 0 to {MOST_NOISE:g}")


@dataclass(frozen=True, slots=True)
class EncodedGroup:
    """The payload of a group and what was measured on it."""

    form: Form
    frame_count: int
    payload: bytes
    layers: tuple[int, ...]  # k + 1 layers decode with k components, or to k levels
    quality: Quality
    predicted: bool = False  # from the group before
    key: int | None = None  # the frame, counted in the group, whose surface the others follow


@dataclass(frozen=True, slots=True)
class Fitted:
    """A reference that follows a run of frames, and where it is in each."""

    reference: CodedReference
    positions: Float64[np.ndarray, "T V 3"]  # of its base's vertices, normalised


@dataclass(frozen=True, slots=True)
class Span:
    """A run of frames that become one group."""

    frames: Sequence[Mesh]
    fitted: Fitted | None  # None: no reference follows them


FindSpans = Callable[[Sequence[Mesh], EncoderOptions, "Stages | None"], list[Span]]


class Stages:
    """Counts frames through the stages for a progress callback."""

    def __init__(self, progress: Progress | None, total: int) -> None:
        self._progress = progress
        self._total = total
        self._done: dict[str, int] = {}

    def reach(self, stage: str, share: float) -> None:
        """As many frames have passed `stage` as this share of all."""
        self.add(stage, max(round(share * self._total) - self._done.get(stage, 0), 0))

    def add(self, stage: str, count: int) -> None:
        """`count` more frames have passed `stage`."""
        self._done[stage] = self._done.get(stage, 0) + count
        if self._progress is not None:
            self._progress(stage, self._done[stage], self._total)


def encode_window(
    frames: Frames, options: EncoderOptions, stages: Stages | None = None, find: FindSpans | None = None
) -> list[EncodedGroup]:
    """The groups of a window: one, or more where one reference cannot follow. Frames are all empty or none is.

    `find` is `find_spans`, or who knows its answer.
    """
    stages, frames = stages or Stages(None, len(frames)), list(frames)
    if frames[0].is_empty:
        groups = [EncodedGroup(Form.EMPTY, len(frames), encode_empty(), (), NO_ERROR)]
    else:
        groups = [_encode_span(span, options) for span in (find or find_spans)(frames, options, stages)]
    stages.add("code", len(frames))
    return groups


def find_spans(frames: Frames, options: EncoderOptions, stages: Stages | None = None) -> list[Span]:
    """The runs of a window that one reference follows each, or none; every frame has a surface.

    The window is cut where the fit fails, `options.groups.depth` times at most.
    """
    stages, frames = stages or Stages(None, len(frames)), list(frames)
    if len(frames) == 1:
        return [Span(frames, None)]
    centers = track_centers(frames, options.track)
    stages.add("track", len(frames))
    return _spans(frames, centers, options, options.groups.depth, stages)


def analyze(
    frames: Sequence[Mesh], centers: Centers, options: EncoderOptions, stages: Stages
) -> tuple[CodedReference, Fit]:
    """The reference of a group as decoded, and its fit to every frame (paper, sections 3.3.1 and 3.3.2).

    Raises NoReferenceError where no surface can be made of the frames.
    """
    reference = extract_reference(frames, centers, options.reference)
    if reference.mesh.is_empty:
        raise NoReferenceError("no surface is common to the frames")
    stages.add("reference", len(frames))
    coded = code_reference(reference.mesh, options.reference_bits, options.levels)
    if coded.base.is_empty:
        raise NoReferenceError("the reference mesh has no faces left after Draco")
    predictions = predict(reference, coded.base, centers, options.reference.deform)
    fit = fit_frames(coded.base.faces, predictions, frames, replace(options.fit, key=reference.key))
    stages.add("fit", len(frames))
    return coded, fit


def _spans(frames: Sequence[Mesh], centers: Centers, options: EncoderOptions, depth: int, stages: Stages) -> list[Span]:
    """As `find_spans`, from tracked centers; cut `depth` times at most."""
    if len(frames) == 1:
        return [Span(frames, None)]
    try:
        reference, fit = analyze(frames, centers, options, stages)
    except NoReferenceError:
        return [Span(frames, None)]
    residuals = np.array([residual.rms for residual in fit.residuals])
    target = target_of(frames, options)
    cut = cut_at(residuals / target.distance, options.groups)
    if cut is None:
        return [Span(frames, Fitted(reference, fit.positions))]
    if depth == 0:
        return [Span(frames, None)]
    head, tail = frames[:cut], frames[cut:]
    known = replace(centers, positions=centers.positions[:cut])
    anew = track_centers(tail, options.track)  # centers that were lost before the cut would spoil what follows
    quick = replace(options, reference=options.reference.fewer_trials())
    again = Stages(None, len(frames))  # these frames have been through the stages once
    return [*_spans(head, known, quick, depth - 1, again), *_spans(tail, anew, quick, depth - 1, again)]


def _encode_span(span: Span, options: EncoderOptions) -> EncodedGroup:
    """The cheaper of both forms, or the only one."""
    if span.fitted is None:
        return intra_only(span.frames, options)
    group = laplacian(span.frames, span.fitted.reference, span.fitted.positions, options.displacements)
    return group if options.displacements.basis_size is not None else cheaper(span.frames, group, options)


def laplacian(
    frames: Sequence[Mesh],
    reference: CodedReference,
    positions: Float64[np.ndarray, "T V 3"],
    options: DisplacementOptions,
) -> EncodedGroup:
    """The `laplacian` form of a group."""
    payload, layers = encode_group(reference, displacement_field(reference, positions), options)
    quality = measure(frames, decode_group(payload, len(frames)))
    return EncodedGroup(Form.LAPLACIAN, len(frames), payload, layers, quality)


def displacement_field(
    reference: CodedReference, positions: Float64[np.ndarray, "T V 3"]
) -> Float64[np.ndarray, "V T 3"]:
    """From the vertices of a reference's base to where they are in each frame (paper, section 3.3.2)."""
    return np.ascontiguousarray(np.moveaxis(positions, 0, 1) - reference.base.vertices[:, None])


def cheaper(frames: Sequence[Mesh], group: EncodedGroup, options: EncoderOptions) -> EncodedGroup:
    """The group, or its `draco` form where that is the better bargain.

    As good and smaller; or so much better that no finer template would get there for the bytes, as on bodies of few,
    large faces.
    """
    size = len(group.payload)
    found = cheapest_intra(frames, group.quality, MOST_FOR_HALF * size, options.intra)
    if found is None:
        return group
    payload, quality = found
    if len(payload) >= size and quality.distance > group.quality.distance / 2:
        return group
    return EncodedGroup(Form.DRACO, len(frames), payload, (), quality)


def intra_only(frames: Sequence[Mesh], options: EncoderOptions) -> EncodedGroup:
    """The `draco` form at the target's quality."""
    target = target_of(frames, options)
    payload, quality = cheapest_intra(frames, target, np.inf, options.intra) or finest_intra(frames, target.distance)
    return EncodedGroup(Form.DRACO, len(frames), payload, (), quality)


def target_of(frames: Sequence[Mesh], options: EncoderOptions) -> Quality:
    """What these frames should be worth, normalised: relative to the smallest of them, so that none is lost.

    As far from noisy frames as the truth is; how their normals are turned says nothing then.
    """
    diagonal = min(frame.diagonal for frame in frames)
    target, noise = options.target.scaled(diagonal or 1.0), options.noise
    if noise == 0:
        return target
    distance, worst = math.hypot(target.distance, noise), math.hypot(target.worst, noise)
    return replace(target, distance=distance, worst=worst, angle=WORST_ANGLE)
