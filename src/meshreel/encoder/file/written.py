"""Writing of a file: its header, its groups in order, each after the state of the background that it is shown with.

In: encoded groups, a writer. Out: their summaries, and the errors of the written file.
"""

from __future__ import annotations

import json
from collections import deque
from collections.abc import Sequence
from typing import Any, BinaryIO

import numpy as np

from ...analysis.survey import Survey
from ...container.writer import ReelWriter
from ...decoder.video import open as open_video
from ...format.layout import Header
from ...geometry.closest_points import distances
from ...geometry.topology import drop_unreferenced
from ...metrics.distance import PSNR_CEILING, psnr
from ...types import MeshSequence
from ..file.summary import GroupSummary
from ..run.interval_files import write_companions, write_group
from ..scene.static import Static
from ..scene.tracks import TrackGroup


def write_in_order(
    writer: ReelWriter, coded: Sequence[TrackGroup], states: Sequence[Static], seen: Survey
) -> list[GroupSummary]:
    """Write all groups, and each state of the background before the first group that is shown with it."""
    groups, waiting, static = list[GroupSummary](), deque(states), list[int]()
    for each in coded:
        while waiting and waiting[0].frame <= each.first_frame:
            state = waiting.popleft()
            static = [writer.add_static(state.payload, depends_on=static if state.is_patch else ())]
            write_companions(writer, static[0], state.companions, None)
        with_static = each.track == 0 and not seen.is_bare(each.first_frame)
        groups.append(write_tracked(writer, each, static if with_static else [], seen.unit))
    return groups


def write_tracked(writer: ReelWriter, each: TrackGroup, static: list[int], unit: float) -> GroupSummary:
    """Write a group of a track, with the chunk of the background that its frames are shown with."""
    group = each.group
    write_group(writer, each.first_frame, group, each.track, static)
    key = None if group.key is None else each.first_frame + group.key
    fidelity = group.fidelity.scaled(unit)
    colors = sum(map(len, group.companions))
    facts = (group.form, group.frame_count, len(group.stored or group.payload), fidelity, group.predicted)
    return GroupSummary(*facts, key, each.track, each.share, colors, group.lost_colors, group.canonical)


def mean_psnr(sequence: MeshSequence, file: BinaryIO, diagonal: float, numbers: Sequence[int]) -> float:
    """Return the mean d2_psnr_paper, dB, over some frames of a file."""
    with open_video(file) as video:
        found = []
        for number in numbers:
            points, shown = drop_unreferenced(sequence[number]).vertices, video[number]
            if not len(points) or shown.is_empty:
                found.append(PSNR_CEILING if not len(points) and shown.is_empty else 0.0)
                continue
            gap = float((distances(points, shown) ** 2).mean())
            found.append(min(psnr(gap, diagonal), PSNR_CEILING))
    return float(np.mean(found))


def make_header(frame_rate: float, seen: Survey, metadata: dict[str, Any]) -> Header:
    """Return the header of a file whose coordinates are normalised by a survey."""
    low, high = ((corner - seen.center) / seen.unit for corner in (seen.low, seen.high))
    return Header(
        frame_rate=frame_rate,
        origin=tuple(map(float, seen.center)),
        scale=seen.unit,
        minimum=tuple(map(float, low)),
        maximum=tuple(map(float, high)),
        metadata=json.dumps(metadata, separators=(",", ":")),
    )
