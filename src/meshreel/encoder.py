"""Encodes a mesh sequence: survey, then window by window track, reference, fit, code, choose, write.

Reads beside decoder.py. A window of frames is a value: `encode_window(frames, options)` needs nothing else, so windows
can be spread over processes, and memory does not grow with the length of the sequence.
"""

from __future__ import annotations

import json
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, Future
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float64

from .analysis.fit import Fit, FitOptions, fit_frames
from .analysis.groups import GroupOptions, cut_at
from .analysis.reference import ReferenceOptions, extract_reference, predict
from .analysis.survey import Survey, survey
from .analysis.track import TrackOptions, track_centers
from .choice import IntraOptions, Quality, cheapest_intra, finest_intra, measure
from .coding.displacements import DisplacementOptions
from .coding.group import CodedReference, code_reference, decode_group, encode_group
from .coding.intra import encode_empty
from .compact import CompactOptions, compact, displacements
from .container.writer import ReelWriter
from .errors import InputError, NoReferenceError
from .format.layout import Form, Header
from .types import Centers, Mesh, MeshSequence

Progress = Callable[[str, int, int], None]  # stage, frames done in it, frames of the sequence
MOST_FRAMES = 64  # in a group: the tracker's distances and the basis grow with it


@dataclass(frozen=True, slots=True)
class EncoderOptions:
    """How to encode; `presets.preset_options` fills it from a preset's name and a quality."""

    preset: str = "paper"
    quality: float = 50.0  # 0 to 100; what the other fields were made from, recorded in the file
    group_size: int = 10  # most frames in a group, the paper's GoF
    reference_bits: int = 14  # of the reference's lattice (paper: qp = 14)
    levels: int = 1  # midpoint subdivisions of the decoded reference
    target: Quality = Quality(0.0005, 6.0, 0.001)  # what frames are worth that no reference follows
    track: TrackOptions = TrackOptions()
    reference: ReferenceOptions = ReferenceOptions()
    fit: FitOptions = FitOptions()
    groups: GroupOptions = GroupOptions()
    compact: CompactOptions = CompactOptions()
    displacements: DisplacementOptions = DisplacementOptions()
    intra: IntraOptions = IntraOptions()

    def __post_init__(self) -> None:
        if not 0 <= self.quality <= 100:
            raise InputError(f"quality must be in 0 to 100, got {self.quality:g}")
        if not 1 <= self.group_size <= MOST_FRAMES:
            raise InputError(f"group size must be in 1 to {MOST_FRAMES}, got {self.group_size}")


@dataclass(frozen=True, slots=True)
class EncodedGroup:
    """The payload of a group and what was measured on it."""

    form: Form
    frame_count: int
    payload: bytes
    layers: tuple[int, ...]  # k + 1 layers decode with k components
    quality: Quality


@dataclass(frozen=True, slots=True)
class GroupSummary:
    """What is left of a group once it is written; distances in metres."""

    form: Form
    frame_count: int
    size: int  # bytes
    quality: Quality


@dataclass(frozen=True, slots=True)
class Summary:
    """What an encode made."""

    size: int  # bytes of the file
    groups: tuple[GroupSummary, ...]

    @property
    def frame_count(self) -> int:
        """Frames in all groups."""
        return sum(group.frame_count for group in self.groups)


def encode(
    sequence: MeshSequence,
    path: str | Path,
    options: EncoderOptions = EncoderOptions(),
    executor: Executor | None = None,
    progress: Progress | None = None,
) -> Summary:
    """Writes `sequence` to a .reel file at `path`, which appears only when it is complete.

    With an executor, windows are encoded side by side; the bytes are the same. Raises InputError for frames that
    cannot be used, before anything is coded.
    """
    stages = Stages(progress, len(sequence))
    seen = survey(sequence, stages)
    groups: list[GroupSummary] = []
    with ReelWriter(path, make_header(sequence.frame_rate, seen, {})) as writer:
        for encoded in _encoded_windows(sequence, seen, options, (executor, stages)):
            for group in encoded:
                writer.add_group(writer.frame_count, group.frame_count, group.payload, group.layers)
                quality = group.quality.scaled(seen.diagonal)
                groups.append(GroupSummary(group.form, group.frame_count, len(group.payload), quality))
        writer.header = make_header(sequence.frame_rate, seen, _metadata(options, groups))
    return Summary(Path(path).stat().st_size, tuple(groups))


def encode_window(frames: Sequence[Mesh], options: EncoderOptions, stages: Stages | None = None) -> list[EncodedGroup]:
    """The groups of a window of frames in normalised coordinates: one, or more where one reference cannot follow.

    Frames are all empty or all with a surface.
    """
    stages = stages or Stages(None, len(frames))
    if frames[0].is_empty:
        stages.add("code", len(frames))
        return [EncodedGroup(Form.EMPTY, len(frames), encode_empty(), (), Quality(0.0, 0.0, 0.0))]
    if len(frames) == 1:
        return [_intra_only(frames, options, stages)]
    centers = track_centers(frames, options.track)
    stages.add("track", len(frames))
    return _encode_span(frames, centers, options, stages)


def analyze(frames: Sequence[Mesh], centers: Centers, options: EncoderOptions) -> tuple[CodedReference, Fit]:
    """The reference of a group as decoded, and its fit to every frame (paper, sections 3.3.1 and 3.3.2).

    Raises NoReferenceError where no surface can be made of the frames.
    """
    reference = extract_reference(frames, centers, options.reference)
    if reference.mesh.is_empty:
        raise NoReferenceError("no surface is common to the frames")
    coded = code_reference(reference.mesh, options.reference_bits, options.levels)
    if coded.base.is_empty:
        raise NoReferenceError("the reference mesh has no faces left after Draco")
    predictions = predict(reference, coded.base, centers, options.reference.deform)
    return coded, fit_frames(coded.base.faces, predictions, frames, options.fit)


def make_header(frame_rate: float, seen: Survey, metadata: dict[str, Any]) -> Header:
    """The header of a file whose coordinates are normalised by `seen`."""
    low, high = ((corner - seen.center) / seen.diagonal for corner in (seen.low, seen.high))
    return Header(
        frame_rate=frame_rate,
        origin=tuple(map(float, seen.center)),
        scale=seen.diagonal,
        minimum=tuple(map(float, low)),
        maximum=tuple(map(float, high)),
        metadata=json.dumps(metadata, separators=(",", ":")),
    )


class Stages:
    """Counts frames through the stages for a progress callback."""

    def __init__(self, progress: Progress | None, total: int) -> None:
        self._progress = progress
        self._total = total
        self._done: dict[str, int] = {}

    def add(self, stage: str, count: int) -> None:
        """`count` more frames have passed `stage`."""
        self._done[stage] = self._done.get(stage, 0) + count
        if self._progress is not None:
            self._progress(stage, self._done[stage], self._total)


def _encode_span(
    frames: Sequence[Mesh], centers: Centers, options: EncoderOptions, stages: Stages
) -> list[EncodedGroup]:
    """Groups of a run of frames: cut where the fit fails, then the cheaper of both forms."""
    if len(frames) == 1:
        return [_intra_only(frames, options, stages)]
    try:
        reference, fit = analyze(frames, centers, options)
    except NoReferenceError:
        return [_intra_only(frames, options, stages)]
    cut = cut_at(np.array([residual.rms for residual in fit.residuals]), options.groups)
    if cut is not None:
        halves = (slice(None, cut), slice(cut, None))
        return [g for h in halves for g in _encode_span(frames[h], _part(centers, h), options, stages)]
    if options.displacements.basis_size is not None:
        fit = compact(fit, reference.base, frames, options.displacements.basis_size, options.compact)
    stages.add("fit", len(frames))
    group = _laplacian(frames, reference, displacements(fit, reference.base), options.displacements)
    if options.displacements.basis_size is None:
        group = _cheaper(frames, group, options)
    stages.add("code", len(frames))
    return [group]


def _laplacian(
    frames: Sequence[Mesh],
    reference: CodedReference,
    field: Float64[np.ndarray, "V T 3"],
    options: DisplacementOptions,
) -> EncodedGroup:
    payload, layers = encode_group(reference, field, options)
    quality = measure(frames, decode_group(payload, len(frames)))
    return EncodedGroup(Form.LAPLACIAN, len(frames), payload, layers, quality)


def _cheaper(frames: Sequence[Mesh], group: EncodedGroup, options: EncoderOptions) -> EncodedGroup:
    """The group, or its `draco` form where that is as good and smaller."""
    found = cheapest_intra(frames, group.quality, len(group.payload), options.intra)
    return group if found is None else EncodedGroup(Form.DRACO, len(frames), found[0], (), found[1])


def _intra_only(frames: Sequence[Mesh], options: EncoderOptions, stages: Stages) -> EncodedGroup:
    """The `draco` form at the target's quality, relative to the size of these frames."""
    scale = float(np.median([frame.diagonal for frame in frames]))
    target = options.target.scaled(scale or 1.0)
    payload, quality = cheapest_intra(frames, target, np.inf, options.intra) or finest_intra(frames, target.distance)
    stages.add("code", len(frames))
    return EncodedGroup(Form.DRACO, len(frames), payload, (), quality)


def _part(centers: Centers, frames: slice) -> Centers:
    return replace(centers, positions=centers.positions[frames])


def _encoded_windows(
    sequence: MeshSequence, seen: Survey, options: EncoderOptions, run: tuple[Executor | None, Stages]
) -> Iterator[list[EncodedGroup]]:
    """The groups of each window in order; a few windows ahead where an executor has workers for them."""
    executor, stages = run
    windows = ([seen.normalise(sequence[i]) for i in window] for window in seen.windows(options.group_size))
    if executor is None:
        for frames in windows:
            yield encode_window(frames, options, stages)
        return
    ahead = 2 * getattr(executor, "_max_workers", 8)
    waiting: deque[tuple[int, Future[list[EncodedGroup]]]] = deque()
    for frames in windows:
        waiting.append((len(frames), executor.submit(encode_window, frames, options)))
        if len(waiting) > ahead:
            yield _arrived(waiting, stages)
    while waiting:
        yield _arrived(waiting, stages)


def _arrived(waiting: deque[tuple[int, Future[list[EncodedGroup]]]], stages: Stages) -> list[EncodedGroup]:
    count, future = waiting.popleft()
    groups = future.result()
    stages.add("code", count)
    return groups


def _metadata(options: EncoderOptions, groups: Sequence[GroupSummary]) -> dict[str, Any]:
    """What `info` shows of the encoding: not needed to decode, but counted in the rate."""
    frames = sum(group.frame_count for group in groups)
    mean_square = sum(group.frame_count * group.quality.distance**2 for group in groups) / frames
    return {
        "preset": options.preset,
        "quality": options.quality,
        "rms_m": _rounded(mean_square**0.5),
        "worst_rms_m": _rounded(max(group.quality.worst for group in groups)),
        "normal_error_deg": _rounded(sum(g.frame_count * g.quality.angle for g in groups) / frames),
    }


def _rounded(value: float) -> float | None:
    """Four digits; None for what JSON has no number for."""
    return float(f"{value:.4g}") if np.isfinite(value) else None
