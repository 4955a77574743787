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

import numpy as np

from .analysis.fit import Fit, FitOptions, fit_frames
from .analysis.groups import GroupOptions, cut_at
from .analysis.reference import Reference, ReferenceOptions, extract_reference, predict
from .analysis.survey import Survey, survey
from .analysis.track import TrackOptions, track_centers
from .choice import IntraOptions, Quality, cheapest_intra, finest_intra, measure
from .coding.displacements import DisplacementOptions
from .coding.group import CodedReference, code_reference, decode_group, encode_group
from .coding.intra import encode_empty
from .container.writer import ReelWriter
from .errors import InputError, NoReferenceError
from .format.layout import Form
from .types import Centers, Mesh, MeshSequence

Progress = Callable[[str, int, int], None]  # stage, frames done in it, frames of the sequence


@dataclass(frozen=True, slots=True)
class EncoderOptions:
    """How to encode; `preset_options` fills it from a preset's name and a quality."""

    preset: str = "paper"
    quality: float = 50.0  # 0 to 100
    group_size: int = 10  # most frames in a group, the paper's GoF
    reference_bits: int = 14  # of the reference's lattice (paper: qp = 14)
    levels: int = 1  # midpoint subdivisions of the decoded reference
    track: TrackOptions = TrackOptions()
    reference: ReferenceOptions = ReferenceOptions()
    fit: FitOptions = FitOptions()
    groups: GroupOptions = GroupOptions()
    displacements: DisplacementOptions = DisplacementOptions()
    intra: IntraOptions = IntraOptions()

    def __post_init__(self) -> None:
        if not 0 <= self.quality <= 100:
            raise InputError(f"quality must be in 0 to 100, got {self.quality:g}")
        if not 1 <= self.group_size <= MOST_FRAMES:
            raise InputError(f"group size must be in 1 to {MOST_FRAMES}, got {self.group_size}")


MOST_FRAMES = 64  # in a group: the tracker's distances and the basis grow with it


@dataclass(frozen=True, slots=True)
class EncodedGroup:
    """The payload of a group and what was measured on it."""

    form: Form
    frame_count: int
    payload: bytes
    layers: tuple[int, ...]  # a prefix of this length decodes with 0, 1, ... components
    quality: Quality


@dataclass(frozen=True, slots=True)
class Summary:
    """What an encode made; distances in metres."""

    size: int  # bytes of the file
    frame_count: int
    groups: tuple[EncodedGroup, ...]


def encode(
    sequence: MeshSequence,
    path: str | Path,
    options: EncoderOptions,
    executor: Executor | None = None,
    progress: Progress | None = None,
) -> Summary:
    """Writes `sequence` to a .reel file at `path`, which appears only when it is complete.

    With an executor, windows are encoded side by side; the bytes are the same. Raises InputError for frames that
    cannot be used, before anything is written.
    """
    stages = _Stages(progress or _silent, len(sequence))
    seen = survey(_Watched(sequence, stages))
    header = _header(sequence, seen, options)
    groups: list[EncodedGroup] = []
    with ReelWriter(path, header) as writer:
        for encoded in _encoded_windows(sequence, seen, options, (executor, stages)):
            for group in encoded:
                writer.add_group(group.frame_count, group.payload, group.layers)
                groups.append(replace(group, payload=b""))

def encode_window(frames: Sequence[Mesh], options: EncoderOptions, stages: _Stages | None = None) -> list[EncodedGroup]:
    """The groups that a window of frames in normalised coordinates becomes: one, or more where a reference does not
    follow all of them. Frames are all empty or all with a surface."""
    stages = stages or _Stages(_silent, len(frames))
    if frames[0].is_empty:
        return [EncodedGroup(Form.EMPTY, len(frames), encode_empty(), (), Quality(0.0, 0.0, 0.0))]
    if len(frames) == 1:
        return [_intra_only(frames, options)]
    centers = track_centers(frames, options.track)
    stages.add("track", len(frames))
    return _encode_span(frames, centers, options, stages)


def _encode_span(
    frames: Sequence[Mesh], centers: Centers, options: EncoderOptions, stages: _Stages
) -> list[EncodedGroup]:
    """Groups of a run of frames: cut where the fit fails, then the cheaper of both forms."""
    if len(frames) == 1:
        return [_intra_only(frames, options)]
    try:
        reference, fit = analyze(frames, centers, options)
    except NoReferenceError:
        return [_intra_only(frames, options)]
    cut = cut_at(fit, options.groups)
    if cut is not None:
        first, second = _slice(centers, slice(None, cut)), _slice(centers, slice(cut, None))
        return _encode_span(frames[:cut], first, options, stages) + _encode_span(frames[cut:], second, options, stages)
    stages.add("fit", len(frames))
    payload, layers = encode_group(reference, _field(fit, reference), options.displacements)
    quality = measure(frames, decode_group(payload))
    group = EncodedGroup(Form.LAPLACIAN, len(frames), payload, layers, quality)
    cheaper = cheapest_intra(frames, quality, len(payload), options.intra)
    stages.add("code", len(frames))
    return [group if cheaper is None else EncodedGroup(Form.DRACO, len(frames), cheaper[0], (), cheaper[1])]
