"""Rows of rate and distortion, alike for every codec and every sequence: the paper's figures and tables.

In: a point of one of `KINDS`. Out: its row: rate of all bytes, every metric against the input, encode times by stage,
decode times in a fresh process, and pictures in a folder beside the rows. Bodies are judged by all frames; scenes by
every second of `SOME` frames, from where their cameras stood, and where the truth is known against it too (`truth_`).
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

from meshreel.errors import InputError
from meshreel.geometry.derived_sequences import Chosen
from meshreel.io.sequence import SequenceOptions
from meshreel.metrics.render import Visible
from meshreel.metrics.scene_accuracy import Scene, scene_means, scene_row
from meshreel.metrics.scene_comparison import finite, true_scene
from meshreel.types import Frames, MeshSequence, evenly

from .bench import Bench
from .checked import check_told, compared, decoded_by, decoder_of
from .codec import Codec, TwoStepCodec, coded_row
from .codecs import make_codec
from .datasets import Dataset, open_known
from .filenames import file_name
from .fresh import peak_rss_mb
from .groups import group_records
from .identity import identity
from .originals import KEPT_PICTURES, KeptPictures
from .peers import measure_fresh_decode
from .pictures import draw_decoded, draw_original
from .row_form import UNPICTURED
from .rows import Point, Row
from .said import one_line
from .timer import StageTimer

RATED = "rated"  # the codec is given the whole sequence
SAMPLED = "sampled"  # it is given `SOME` frames of a scene, for single-frame and slow codecs; the rate is theirs
TRUTH_ITSELF = "the truth itself"  # beyond what it reaches against the input, noise is coded
FLOOR = "rated floor"  # no codec: what the truth itself reaches against the input
KINDS = (RATED, SAMPLED, FLOOR)
SOME = 10  # frames of a scene: what codecs of kind SAMPLED code, and of these every second is measured
KEPT = ("d2_psnr_paper", "normal_error_deg", "ssim", "ssim_masked")  # of each frame
TRUTH = ("d2_psnr_backward", "ssim_masked", "normal_error_deg", "people_ssim_masked", "people_normal_error_deg")


def measure_rated(point: Point, bench: Bench) -> Row:
    """The row of a point."""
    known = _opened(point.sequence, bench.data, point.frames, bench.cache, bench.own)
    count = len(known.sequence)
    some = evenly(count, SOME) if known.cameras else list(range(count))
    numbers = some[::2] if known.cameras else some
    head: Row = {"sequence": point.sequence, "frames": count, "frame_rate": known.sequence.frame_rate}
    head |= {"measured_frames": numbers} | identity(point, bench)
    if point.kind == FLOOR:
        return head | {"codec": TRUTH_ITSELF, "options": point.options} | _floor(known, numbers, bench)
    codec = make_codec(point.codec, point.options)
    decoder = decoder_of(codec)
    sampled = point.kind == SAMPLED
    source = Chosen(known.sequence, some) if sampled else known.sequence
    data, times = _encoded(codec, source, (point.sequence, point.frames, sampled))
    check_told(codec, data)
    head |= coded_row(codec, source, data) | {"coded_frames": len(source)}
    head |= times | {"encode_peak_rss_mb": peak_rss_mb()}
    head |= {"groups": group_records(data) if len(numbers) == count else []}  # which count in frames, as metrics do
    head["decode"], decoded = measure_fresh_decode(data, decoder, decoded_by(decoder, data, codec.name, source))
    shown = Chosen(decoded, [some.index(number) for number in numbers] if sampled else numbers)
    return head | _metrics(known, numbers, shown, bench) | _pictures(point, known, numbers, (shown, bench))


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
        key = (what, codec.analysis_key)
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


def _metrics(known: Dataset, numbers: Sequence[int], shown: Frames, bench: Bench) -> Row:
    """Of the frames that are measured, against the input and, where it is known, the truth."""
    row = _to_input(known, numbers, shown, bench)
    return row if known.truth is None else row | _to_truth(known, numbers, shown)


def _floor(known: Dataset, numbers: Sequence[int], bench: Bench) -> Row:
    """What the truth reaches against the input, by the names of metrics; and the input against the truth."""
    if known.truth is None:
        raise InputError("a noise floor needs the truth, which only simulated scenes have")
    clean = [known.truth[number].mesh for number in numbers]
    return _to_input(known, numbers, clean, bench) | _to_truth(known, numbers, Chosen(known.sequence, numbers))


def _to_input(known: Dataset, numbers: Sequence[int], shown: Frames, bench: Bench) -> Row:
    options = replace(bench.comparison, cameras=known.cameras or bench.comparison.cameras)
    seen = Visible if bench.cache is None else KeptPictures(bench.cache / KEPT_PICTURES)
    row = compared(Chosen(known.sequence, numbers), shown, options, seen)
    row["per_frame"] = [{key: frame[key] for key in KEPT if key in frame} for frame in row["per_frame"]]
    row.pop("cameras")
    return row


def _to_truth(known: Dataset, numbers: Sequence[int], shown: Frames) -> Row:
    pairs = zip((_true(known, number) for number in numbers), shown, strict=True)
    means = scene_means([scene_row(true, true.labelled(mesh)) for true, mesh in pairs])
    return {f"truth_{name}": value for name, value in finite(means).items() if name in TRUTH}


def _pictures(point: Point, known: Dataset, numbers: Sequence[int], shown: tuple[Frames, Bench]) -> Row:
    """Where the pictures of the frame in the middle are; no pictures where there is no folder for them."""
    meshes, bench = shown
    folder = bench.pictures
    if folder is None:
        return {}
    index = len(numbers) // 2
    original = known.sequence[numbers[index]]
    file = f"{file_name(point.sequence)}-{numbers[index]}-{len(known.sequence)}-original.png"
    decoded = meshes[index]
    name = hashlib.sha256(point.key.encode()).hexdigest()[:16]
    found: Row = {"frame": numbers[index], "original": file}
    try:
        camera = draw_original(folder / file, original, known.cameras)
        return {"pictures": found | draw_decoded(folder, name, (original, decoded), camera)}
    except InputError as error:  # the disk is full: what was measured for minutes is a row all the same
        return {UNPICTURED: one_line(str(error))}


@lru_cache(maxsize=1)
def _opened(name: str, data: Path, frames: int | None, cache: Path | None, own: SequenceOptions) -> Dataset:
    return open_known(name, data, frames, cache, own)


@lru_cache(maxsize=SOME)
def _true(known: Dataset, number: int) -> Scene:
    assert known.truth is not None
    return true_scene(known.truth, number)
