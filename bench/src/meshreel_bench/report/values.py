"""Values and curves of rows. In -> out: a row and a name -> a number; rows of a sequence -> rate-distortion curves."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from heapq import heapreplace
from math import ceil, log1p, sqrt
from typing import Any

import numpy as np

from meshreel.encoder.layers.candidates import TOGETHER
from meshreel.encoder.layers.options import LayersOptions
from meshreel.encoder.run.surveying import SLICE
from meshreel.encoder.settings.options import EncoderOptions

from ..bd_rate import Curve, hull
from ..experiments.study import D2, FLOOR, Measure
from ..names import ONCE_SUBDIVIDED, SUBDIVIDED, USUAL
from ..rows import ColorBytes, Row, Stream

SECONDS = 10.0  # in which a background is sent once, for `mbps_background_10s`
HALF = 30  # frames of each half of a long sequence
# Time of `worker.reference_s`, s, on the machine that rows of speed were first measured on, an AMD EPYC with two cores
# that did nothing else: the fifth percentile of 300 runs.
REST_S = 0.0233
HOUR = 108_000  # frames
# Threads of an interval that a stage keeps busy: sides of a key, frames of either that are fitted at a time, frames of
# a group (the encoder's own numbers); others count as one thread's.
SIDE_BY_SIDE = {"track": 2, "fit": 2 * TOGETHER}
SIDE_BY_SIDE |= dict.fromkeys(("survey", "refine", "patch", "measure", "judge"), LayersOptions().group_size)
VARIATION, DRAWS = 0.35, 20  # of an interval's time: its deviation over its mean (guess), and draws to average over


def value(row: Row, key: str) -> float | None:
    """Return the value of a row by name: a metric, or one of `DERIVED`; None if it was not measured."""
    for prefix, found in (("encode_s.", row.encoding.stages_s), ("work.", row.encoding.work)) if row.encoding else ():
        if key.startswith(prefix):
            return found.get(key.removeprefix(prefix))
    name, *numbers = key.split(".")
    if name in WITH_NUMBERS and numbers:
        return WITH_NUMBERS[name](row, *map(int, numbers))
    return DERIVED[key](row) if key in DERIVED else row.metrics.get(key)


def _mbps_background_10s(row: Row) -> float | None:
    """Return the rate where a background counts as sent every ten seconds, whatever the sequence's length."""
    if row.stream is None:
        return None
    moving = (row.stream.bytes - row.stream.background_bytes) * row.frame_rate / row.stream.coded_frames
    return 8 * (moving + row.stream.background_bytes / SECONDS) / 1e6


def _without_keys(row: Row) -> float | None:
    """Return the mean of masked SSIM over frames that are no keys, which the file names, or the best of groups."""
    found = row.per_frame.get("ssim_masked")
    if row.stream is None or not row.stream.groups or not found or len(found) != row.frames:
        return None
    values = np.array([1.0 if each is None else each for each in found])
    groups = [(group, values[group.first_frame : group.first_frame + group.frames]) for group in row.stream.groups]
    keys = [g.first_frame + int(np.argmax(own)) if g.key is None else g.key for g, own in groups]
    others = np.setdiff1d(np.arange(len(values)), keys)
    return float(np.mean(values[others] if len(others) else values))


def _second_half_over_first(row: Row) -> float | None:
    """Return the bytes of frames 31 to 60 over those of 1 to 30; a group's are spread evenly over its frames."""
    if row.frames < 2 * HALF or row.stream is None or not row.stream.groups:
        return None
    halves = [0.0, 0.0]
    for group in row.stream.groups:
        for frame in range(group.first_frame, group.first_frame + group.frames):
            halves[min(frame // HALF, 1)] += group.bytes / group.frames
    return halves[1] / halves[0]


def _border_step(row: Row) -> float | None:
    """Return the largest step of D2 from the last frame of a group to the first of the next, dB."""
    found, groups = row.per_frame.get("d2_psnr_paper", []), row.stream.groups if row.stream else []
    borders = {group.first_frame for group in groups if group.first_frame} if len(found) == row.frames else set[int]()
    pairs = [(found[border - 1], found[border]) for border in borders]
    return max((abs(a - b) for a, b in pairs if a is not None and b is not None), default=None)


def _of_groups(row: Row, forms: Sequence[str], total: Callable[[list[int]], float]) -> float | None:
    """Return a total of the lengths of groups in some of the forms with surface; None without groups."""
    groups = [group for group in row.stream.groups if group.form != "empty"] if row.stream else []
    return total([group.frames for group in groups if group.form in (forms or [group.form])]) if groups else None


def _at_rest(seconds: float | None, reference_s: float | None) -> float | None:
    """Return a time as it would be on the machine at rest, by the fixed loop's time beside it."""
    return None if seconds is None or reference_s is None else seconds * REST_S / reference_s


def _efficiency(row: Row, workers: int, interval: int) -> float | None:
    """Return the share of their time that workers are busy with an hour of frames, by a row's times."""
    stages = row.encoding.stages_s if row.encoding else {}
    if "survey" not in stages:
        return None
    surveyed, spread = np.full(HOUR // SLICE, stages["survey"] * SLICE), log1p(VARIATION**2)
    drawn = np.random.default_rng(0).lognormal(-spread / 2, sqrt(spread), (DRAWS, HOUR // interval))
    coded = drawn * interval * (sum(stages.values()) - stages["survey"])
    ends = [_end(surveyed, workers) + _end(times, workers) for times in coded]
    return float(np.mean((surveyed.sum() + coded.sum(axis=1)) / ends)) / workers


def _of_cores(row: Row, cores: int, seconds: int) -> float | None:
    """Return the share of their time that cores are busy with a clip, by a row's times: intervals side by side.

    Cores that are left over share in what each interval does side by side.
    """
    stages = row.encoding.stages_s if row.encoding else {}
    intervals, whole = ceil(seconds / EncoderOptions().key_interval), sum(stages.values())
    beside = min(cores, intervals)
    one = sum(each / min(cores / beside, SIDE_BY_SIDE.get(stage, 1)) for stage, each in stages.items())
    return whole * intervals / (cores * one * ceil(intervals / beside)) if whole else None


def _end(times: np.ndarray, workers: int) -> float:
    """Return the time at which the last of several calls is done, s."""
    free = [0.0] * workers
    for seconds in times.tolist():
        heapreplace(free, free[0] + seconds)
    return max(free)


def _of_key(row: Row, what: str, frames: int) -> float | None:
    """Return a rate, Mbps, of so many frames, if a chain went on: its beginning once, the mean of what follows."""
    known = None if row.stream is None else row.stream.colors
    if row.stream is None or known is None or known.chains > 1:
        return row.mbps if row.stream and what == "all" else None
    first, *others = known.pictures or [0]
    texture = known.atlas + first + (frames - 1) * sum(others) / max(len(others), 1)
    sizes = {"vertices": known.vertices, "texture": texture}
    rest = row.stream.bytes - known.all - known.base
    sizes["all"] = sum(sizes.values()) + known.base + rest * frames / row.stream.coded_frames
    return 8 * sizes[what] * row.frame_rate / frames / 1e6


WITH_NUMBERS: dict[str, Callable[..., float | None]] = {
    "cores": _of_cores,
    "efficiency": _efficiency,
    "mbps": lambda row, frames: _of_key(row, "all", frames),
    "texture_mbps": lambda row, frames: _of_key(row, "texture", frames),
    "vertices_mbps": lambda row, frames: _of_key(row, "vertices", frames),
}


def _color_mbps(row: Row, share: Callable[[ColorBytes], int]) -> float | None:
    """Return the rate of some bytes of colours over the whole sequence."""
    if row.stream is None or row.stream.colors is None:
        return None
    return row.mbps * share(row.stream.colors) / row.stream.bytes


def _of_background(stream: Stream) -> int:
    """Return the bytes of the background with its colours."""
    return stream.background_bytes + (stream.colors.background if stream.colors else 0)


DERIVED: dict[str, Callable[[Row], float | None]] = {
    "mbps": lambda row: row.mbps if row.stream else None,
    "mbps_background_10s": _mbps_background_10s,
    "color_mbps": lambda row: _color_mbps(row, lambda known: known.all),
    "background_color_mbps": lambda row: _color_mbps(row, lambda known: known.background),
    "color_share": lambda row: found / row.mbps if (found := _color_mbps(row, lambda known: known.all)) else None,
    "bodies_mbps": lambda row: row.mbps * (1 - _of_background(row.stream) / row.stream.bytes) if row.stream else None,
    "tracks": lambda row: row.stream.tracks if row.stream else None,
    "background_bytes": lambda row: row.stream.background_bytes if row.stream else None,
    "background_mbps": lambda row: row.mbps * _of_background(row.stream) / row.stream.bytes if row.stream else None,
    "border_step_db": _border_step,
    "group_frames": lambda row: _of_groups(row, (), lambda lengths: float(np.mean(lengths))),
    "draco_groups": lambda row: _of_groups(row, ("draco",), len),
    "draco_frames": lambda row: _of_groups(row, ("draco",), sum),
    "canonical_groups": lambda row: row.stream.canonical if row.stream else None,
    "encode_s": lambda row: row.encoding.s if row.encoding else None,
    "encode_s_at_rest": lambda row: _at_rest(row.encoding.s, row.encoding.reference_s) if row.encoding else None,
    "encode_mb": lambda row: row.encoding.peak_rss_mb if row.encoding else None,
    "decode_ms": lambda row: row.decoding.frame_ms if row.decoding else None,
    "decode_ms_at_rest": lambda row: _at_rest(d.frame_ms, d.reference_s) if (d := row.decoding) else None,
    "first_frame_ms": lambda row: row.decoding.first_frame_ms if row.decoding else None,
    "decode_mb": lambda row: row.decoding.peak_rss_mb if row.decoding else None,
    "ssim_masked_without_keys": _without_keys,
    "second_half_over_first": _second_half_over_first,
}


def curve_of(row: Row) -> str:
    """Return the curve of a point: its codec and, if the basis is fixed, other options that differ from the preset."""
    if row.options.get("basis_size") is None:
        return row.name
    quality = row.options.get("quality")
    parts = [f"quality {quality:g}"] if isinstance(quality, (int, float)) else []
    for key, usual in USUAL.items():
        parts += [f"{key} {row.options[key]}"] if row.options.get(key) not in (None, usual) else []
    return ", ".join([row.name, *parts])


def is_twin(name: str, measure: Measure) -> bool:
    """Return whether a curve is another one's by this measure: midpoints of flat faces move no surface."""
    return measure.key == D2.key and name in (SUBDIVIDED, ONCE_SUBDIVIDED)


def rated(rows: Iterable[Row], sequence: str | None = None) -> list[Row]:
    """Return the rows that have a rate and a quality, of one sequence where it is given."""
    own = (row for row in rows if row.stream and row.metrics)
    return [row for row in own if sequence in (None, row.point.sequence)]


def sequences(rows: Iterable[Row]) -> list[str]:
    """Return the names of sequences whose rows have a rate and a quality."""
    return list(dict.fromkeys(row.point.sequence for row in rated(rows)))


def curve(rows: Sequence[Row], name: str, measure: Measure) -> Curve:
    """Return the points of a curve that have the measure; larger is better."""
    found = [(row.mbps, value(row, measure.key)) for row in rows if curve_of(row) == name]
    points = [(mbps, measure.sign * quality) for mbps, quality in found if quality is not None]
    return Curve(name, [p[0] for p in points], [p[1] for p in points])


def hull_of(rows: Sequence[Row], names: Sequence[str], measure: Measure) -> Curve:
    """Return the hull of several curves: at every rate the best of them."""
    there = set(map(curve_of, rows))
    return hull(f"hull of {', '.join(names)}", [curve(rows, name, measure) for name in names if name in there])


def floors(rows: Iterable[Row]) -> dict[str, float]:
    """Return the values of the truth itself by metric; those against the input are the input's against the truth."""
    found = [row for row in rows if row.point.codec == FLOOR and not row.failed]
    known: dict[str, Any] = dict(found[0].metrics) if found else {}
    if found and found[0].point.metrics == "regions":
        for name in ("ssim_masked", "people_ssim_masked"):
            known[f"input_{name}"] = known.get(f"truth_{name}")
        known["input_d2_psnr_forward"] = known.get("truth_d2_psnr_backward")
    return {key: number for key, number in known.items() if number is not None}
