"""Rows of rate and distortion, alike for every codec and every sequence: the paper's figures and tables.

In: a point of one of `KINDS`. Out: its row: rate of all bytes, every metric against the input, encode times by stage,
decode times in a fresh process, and pictures in a folder beside the rows. Bodies are judged by all frames; scenes by
`MEASURED` of them, from where their cameras stood, and where the truth is known against it too (`truth_`).
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

from ..derived import Chosen
from ..errors import InputError
from ..metrics.report import ComparisonOptions, compare_sequences
from ..metrics.truth import Scene, scene_means, scene_row
from ..types import Frames, MeshSequence, evenly
from .checked import Checked
from .codec import Codec, TwoStepCodec
from .codecs import make_codec
from .datasets import Dataset, open_known
from .fresh import FIRST_FRAME, digest, peak_rss_mb
from .groups import group_records
from .peers import measure_fresh_decode
from .pictures import draw_decoded, draw_original
from .rows import Point, Row
from .timer import StageTimer
from .truth import finite, true_scene

RATED = "rated"  # the codec is given the whole sequence
SAMPLED = (
    "sampled"  # a codec of single frames, or a slow one, is given the frames that are measured; its rate is theirs
)
TRUTH_ITSELF = "the truth itself"  # beyond what it reaches against the input, noise is coded
FLOOR = "rated floor"  # no codec: what the truth itself reaches against the input
KINDS = (RATED, SAMPLED, FLOOR)
MEASURED = 10  # frames of a scene
KEPT = ("d2_psnr_paper", "normal_error_deg", "ssim", "ssim_masked")  # of each frame
TRUTH = ("d2_psnr_backward", "ssim_masked", "normal_error_deg", "people_ssim_masked", "people_normal_error_deg")


@dataclass(frozen=True, slots=True)
class Place:
    """Where a row's sequence is and where its pictures go."""

    data: Path
    cache: Path | None
    comparison: ComparisonOptions


def measure_rated(point: Point, place: Place) -> Row:
    """The row of a point."""
    known = _opened(point.sequence, place.data, point.frames, place.cache)
    count = len(known.sequence)
    numbers = evenly(count, MEASURED) if known.cameras else list(range(count))
    head: Row = {"sequence": point.sequence, "frames": count, "frame_rate": known.sequence.frame_rate}
    head |= {"measured_frames": numbers}
    if point.kind == FLOOR:
        return head | {"codec": TRUTH_ITSELF, "options": point.options} | _floor(known, numbers, place)
    codec = make_codec(point.codec, point.options)
    sampled = point.kind == SAMPLED
    source = Chosen(known.sequence, numbers) if sampled else known.sequence
    data, times = _encoded(codec, source, (point.sequence, point.frames, sampled))
    rate = len(data) * 8 * source.frame_rate / len(source) / 1e6
    head |= {"codec": codec.name, "options": codec.options, "bytes": len(data), "coded_frames": len(source)}
    head |= {"mbps": rate} | times | {"encode_peak_rss_mb": peak_rss_mb()}
    head |= {"groups": group_records(data) if len(numbers) == count else []}  # which count in frames, as metrics do
    decoded = Checked(codec.decode(data), codec.name, source)
    head["decode"] = _decoding(data, codec, decoded)
    shown = decoded if sampled else Chosen(decoded, numbers)
    return head | _metrics(known, numbers, shown, place) | _pictures(point, known, numbers, (shown, place))


@dataclass(slots=True)
class _Analysed:
    """The last analysis, for the points that share it."""

    key: object = None
    analysis: Any = None
    stages: dict[str, float] | None = None
    seconds: float = 0.0


_LAST = _Analysed()


def _encoded(codec: Codec, source: MeshSequence, what: object) -> tuple[bytes, Row]:
    """The bytes, and encode times, s a frame; those of an analysis that several points share count in each."""
    timer, seconds = StageTimer(), 0.0
    if isinstance(codec, TwoStepCodec):
        key = (what, type(codec), codec.analysis_key)
        if _LAST.key != key:
            _LAST.key = _LAST.analysis = None  # one in memory is enough
            _LAST.analysis = codec.analyse(source, timer)
            _LAST.seconds, _LAST.stages, _LAST.key = timer.stop(), dict(timer.seconds), key
            timer = StageTimer()
        data = codec.code(_LAST.analysis, timer)
        seconds, stages = _LAST.seconds, dict(_LAST.stages or {})
    else:
        data, stages = codec.encode(source, timer), {}
    seconds += timer.stop()
    for stage, spent in timer.seconds.items():
        stages[stage] = stages.get(stage, 0.0) + spent
    count = len(source)
    return data, {"encode_s": seconds / count, "encode_stages_s": {k: v / count for k, v in stages.items()}}


def _decoding(data: bytes, codec: Codec, decoded: Frames) -> Row:
    """Times of a fresh process. Raises InputError where its first frame is another than the one decoded here."""
    row = measure_fresh_decode(data, codec)
    if row.pop(FIRST_FRAME) != digest(decoded[0]):
        raise InputError(f"{codec.name} decodes another first frame in a fresh process; bytes alone must decide")
    return row


def _metrics(known: Dataset, numbers: Sequence[int], shown: Frames, place: Place) -> Row:
    """Of the frames that are measured, against the input and, where it is known, the truth."""
    options = replace(place.comparison, cameras=known.cameras or place.comparison.cameras)
    row = compare_sequences(Chosen(known.sequence, numbers), shown, options).to_row()
    row["per_frame"] = [{key: frame[key] for key in KEPT if key in frame} for frame in row["per_frame"]]
    row.pop("cameras")
    if known.truth is not None:
        clean = [_true(known, number) for number in numbers]
        means = scene_means([scene_row(a, a.labelled(b)) for a, b in zip(clean, shown, strict=True)])
        row |= {f"truth_{name}": value for name, value in finite(means).items() if name in TRUTH}
    return row


def _floor(known: Dataset, numbers: Sequence[int], place: Place) -> Row:
    """What the truth reaches against the input, by the names of metrics; and the input against the truth."""
    if known.truth is None:
        raise InputError("a noise floor needs the truth, which only simulated scenes have")
    clean = [known.truth[number].mesh for number in numbers]
    row = _metrics(known, numbers, clean, place)
    truths = [(_true(known, number), known.sequence[number]) for number in numbers]
    means = scene_means([scene_row(true, true.labelled(mesh)) for true, mesh in truths])
    return row | {f"truth_{name}": value for name, value in finite(means).items() if name in TRUTH}


def _pictures(point: Point, known: Dataset, numbers: Sequence[int], shown: tuple[Frames, Place]) -> Row:
    """Where the pictures of the frame in the middle are; no pictures where there is no folder for them."""
    meshes, place = shown
    if place.cache is None:
        return {}
    folder = place.cache.with_suffix(".pictures")
    index = len(numbers) // 2
    original = known.sequence[numbers[index]]
    file = f"{point.sequence}-{numbers[index]}-{len(known.sequence)}-original.png"
    camera = draw_original(folder / file, original, known.cameras)
    name = hashlib.sha256(point.key.encode()).hexdigest()[:16]
    return {
        "pictures": {"frame": numbers[index], "original": file}
        | draw_decoded(folder, name, (original, meshes[index]), camera)
    }


@lru_cache(maxsize=1)
def _opened(name: str, data: Path, frames: int | None, cache: Path | None) -> Dataset:
    return open_known(name, data, frames, cache)


@lru_cache(maxsize=MEASURED)
def _true(known: Dataset, number: int) -> Scene:
    assert known.truth is not None
    return true_scene(known.truth, number)
