"""Summary of an encode, and the writing of a file: its header, its groups in order, and its metadata.

In: encoded groups, a writer. Out: their summaries, warnings of what the file lacks, and the errors of the written file.
Decoding needs none of the metadata, but the rate includes them.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any, BinaryIO

import numpy as np

from ...analysis.survey import Survey
from ...container.writer import ReelWriter
from ...decoder.video import open as open_video
from ...edit.metadata import CANONICAL, KEYS, LEAST_COVERED, PART, Totals, shortened, up_metadata
from ...format.layout import Form, Header
from ...geometry.closest_points import distances
from ...geometry.topology import drop_unreferenced
from ...geometry.work import Work
from ...metrics.distance import PSNR_CEILING, psnr
from ...types import MeshSequence, Up
from ..group.forms import Fidelity
from ..run.interval_files import write_companions, write_group
from ..scene.parts import Parts
from ..scene.static import Static
from ..scene.tracks import TrackGroup
from ..settings.options import EncoderOptions


@dataclass(frozen=True, slots=True)
class GroupSummary:
    """Form, size and fidelity of a written group; distances in metres."""

    form: Form
    frame_count: int
    size: int  # bytes
    fidelity: Fidelity
    predicted: bool = False  # from the group before
    key: int | None = None  # the frame of the sequence whose surface the others follow
    track: int = 0  # the body
    share: float = 1.0  # of the vertices of its frames that the track has, where there is no background
    colors: int = 0  # bytes of its colours and pictures, beyond `size`
    lost_colors: bool = False  # its frames have colours that a reader would refuse
    canonical: bool = False  # its reference lies in the pose of eq. 5
    mended: bool = False  # what was tried first did not hold


@dataclass(frozen=True, slots=True)
class SceneSummary:
    """Sizes and measurements of the parts of a scene."""

    background: int  # bytes, of all its states
    faces: int  # of the first of them, as decoded
    noise: float  # m, RMS distance of a frame's still surface from the background
    psnr: float  # d2_psnr_paper of some frames, the scene's diagonal as peak, dB
    measured: tuple[int, ...]  # these frames
    tracks: int
    guessed: float  # m^2 of the background, where planes go on through holes that no camera saw into


@dataclass(frozen=True, slots=True)
class Summary:
    """Size, groups and warnings of a written file."""

    size: int  # bytes of the file
    groups: tuple[GroupSummary, ...]
    warnings: tuple[str, ...] = ()  # about surface that was not kept, a line each
    scene: SceneSummary | None = None  # of a scene with a background
    continued: int = 0  # intervals that an earlier run, which was stopped, had done
    audio: int = 0  # bytes of the audio file
    work: Work = field(default_factory=dict)  # that this run did

    @property
    def frame_count(self) -> int:
        """Number of frames of the sequence."""
        return sum(group.frame_count for group in self.groups if group.track == 0)

    @property
    def psnr(self) -> float:
        """Mean d2_psnr_paper over the frames, dB; of a scene, over the measured frames."""
        if self.scene is not None:
            return self.scene.psnr
        return sum(group.share * group.frame_count * group.fidelity.psnr for group in self.groups) / self.frame_count


def warnings_of(survey: Survey) -> Iterator[str]:
    """Yield warnings of surface that no file of the sequence has."""
    if survey.dropped:
        yield f"{survey.dropped} faces without area or with the vertices of another face are not kept"
    if survey.flattened:
        count, first = len(survey.flattened), survey.flattened[0]
        yield f"{count} frames have faces, but none with an area: they count as empty (first frame {first} of these)"


def warnings_of_scene(parts: Parts, moves: bool, dropped: int) -> Iterator[str]:
    """Yield warnings of a scene in which nothing moves, or of `dropped` faces that the file lacks."""
    if not moves:
        least = 2 * parts.segmentation.cell
        text = f"nothing moves by more than {least:.2g} m, or no view sees it: the whole scene is background"
        yield f"{text}; if something does, encode with --dynamic-only"
    if dropped:
        text = f"{dropped} faces of bits that move or that the room lacks, far from all bodies, are not kept:"
        yield f"{text} they are small, or there only for a moment; to keep all, encode with --dynamic-only"


def least_covered(groups: Sequence[GroupSummary]) -> GroupSummary | None:
    """Return the group with the frame of whose surface the least share is decoded; None where none is judged.

    Of equal ones it is that of the first track and frame, as where parts of a file are joined.
    """
    judged = [group for group in groups if math.isfinite(group.fidelity.covered)]
    return min(judged, key=lambda one: (shortened(one.fidelity.covered), one.track, one.fidelity.least), default=None)


def warnings_of_groups(groups: Sequence[GroupSummary]) -> Iterator[str]:
    """Yield a warning of the frames that were encoded again, because what was made first did not show them."""
    again = [group for group in groups if group.mended]
    if again:
        count = sum(group.frame_count for group in again)
        forms = " and ".join(sorted({group.form.name.lower() for group in again}))
        first = f"frame {again[0].fidelity.least:.0f} of track {again[0].track} is one of them"
        yield f"{count} frames were not shown by what was tried first, and are encoded again, as {forms}: {first}"


def warnings_of_colors(groups: Sequence[GroupSummary], states: Sequence[Static] = ()) -> Iterator[str]:
    """Yield a warning of what has colours that the file has not."""
    frames = sum(group.frame_count for group in groups if group.lost_colors)
    bare = [f"{frames} frames"] * (frames > 0) + ["the background"] * any(state.lost_colors for state in states)
    if bare:
        yield f"no colours of {' and of '.join(bare)}: they would cost a reader too much"


def write_in_order(
    writer: ReelWriter, coded: Sequence[TrackGroup], states: Sequence[Static], survey: Survey
) -> list[GroupSummary]:
    """Write all groups, and each state of the background before the first group that is shown with it."""
    groups, waiting, static = list[GroupSummary](), deque(states), list[int]()
    for each in coded:
        while waiting and waiting[0].frame <= each.first_frame:
            state = waiting.popleft()
            static = [writer.add_static(state.payload, depends_on=static if state.is_patch else ())]
            write_companions(writer, static[0], state.companions, None)
        with_static = each.track == 0 and not survey.is_bare(each.first_frame)
        groups.append(write_tracked(writer, each, static if with_static else [], survey.unit))
    return groups


def write_tracked(writer: ReelWriter, each: TrackGroup, static: list[int], unit: float) -> GroupSummary:
    """Write a group of a track, with the chunk of the background that its frames are shown with."""
    group = each.group
    write_group(writer, each.first_frame, group, each.track, static)
    key = None if group.key is None else each.first_frame + group.key
    fidelity = group.fidelity.scaled(unit)
    colors = sum(map(len, group.companions))
    facts = (group.form, group.frame_count, len(group.stored or group.payload), fidelity, group.predicted)
    return GroupSummary(*facts, key, each.track, each.share, colors, group.lost_colors, group.canonical, group.mended)


def mean_psnr(sequence: MeshSequence, file: BinaryIO, diagonal: float, numbers: Sequence[int]) -> float:
    """Return the mean d2_psnr_paper, dB, over some frames of a file."""
    with open_video(file) as video:
        surfaces, found = video.at(colors=False), []
        for number in numbers:
            points, shown = drop_unreferenced(sequence[number]).vertices, surfaces[number]
            if not len(points) or shown.is_empty:
                found.append(PSNR_CEILING if not len(points) and shown.is_empty else 0.0)
                continue
            gap = float((distances(points, shown) ** 2).mean())
            found.append(min(psnr(gap, diagonal), PSNR_CEILING))
    return float(np.mean(found))


def make_header(frame_rate: float, survey: Survey, metadata: dict[str, Any]) -> Header:
    """Return the header of a file whose coordinates are normalised by a survey."""
    low, high = ((corner - survey.center) / survey.unit for corner in (survey.low, survey.high))
    return Header(
        frame_rate=frame_rate,
        origin=tuple(map(float, survey.center)),
        scale=survey.unit,
        minimum=tuple(map(float, low)),
        maximum=tuple(map(float, high)),
        metadata=json.dumps(metadata, separators=(",", ":")),
    )


def metadata_of(
    options: EncoderOptions, groups: Sequence[GroupSummary], up: Up, part: tuple[int, int] | None = None
) -> dict[str, Any]:
    """Return the metadata of a file that is no scene; a `part` is its first frame, and the frames of the whole."""
    totals = Totals.added(
        [
            Totals(
                group.frame_count if group.track == 0 else 0,
                (count := group.share * group.frame_count) * group.fidelity.distance**2,  # bodies count by their share
                group.fidelity.worst,
                count * group.fidelity.psnr,
                count * group.fidelity.angle,
            )
            for group in groups
        ]
    )
    keys = sorted({group.key for group in groups if group.key is not None})
    found = {**chosen_options(options, groups), KEYS: keys, **totals.means}
    if part is None:
        return found | up_metadata(up)
    digest = hashlib.sha256(repr(asdict(options)).encode()).hexdigest()[:16]
    place = {"first_frame": part[0], "of": part[1]}
    return found | up_metadata(up) | {PART: place | {"totals": totals.exact, "options": digest}}


def chosen_options(options: EncoderOptions, groups: Sequence[GroupSummary]) -> dict[str, Any]:
    """Return the preset and the quality; of the paper's recipe also how many references lie in the pose of eq. 5."""
    found: dict[str, Any] = {"preset": options.preset, "quality": shortened(options.quality)}
    if (worst := least_covered(groups)) is not None:
        found[LEAST_COVERED] = [shortened(worst.fidelity.covered), worst.track, round(worst.fidelity.least)]
    return found | ({} if options.preset == "best" else {CANONICAL: sum(group.canonical for group in groups)})
