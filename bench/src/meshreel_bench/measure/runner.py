"""Sweeps: points become rows of a file, one after another or in parallel, each appended when it is measured.

A point whose codec crashes, raises, takes too long or decodes invalid meshes has a row with the reason.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass
from pathlib import Path

import msgspec

from meshreel.geometry.derived_sequences import digest

from ..codec import TwoStepCodec
from ..codecs import codec_version, make_codec
from ..datasets import Store
from ..experiments.study import HEADSET
from ..rows import Point, Row, append_row, check_writable, read_rows
from .digests import encoder_digest, is_stale
from .point import empty_row, measure_points
from .worker import WorkerError, end_all, in_fresh_process

Report = Callable[[Row, bool], None]  # of a row, and whether it is new


@dataclass(frozen=True, slots=True)
class Measuring:
    """Options of a sweep."""

    store: Store
    limit_s: float | None = None  # wall time of a point
    retry: bool = False  # points that failed before are measured again
    stale: bool = False  # so are those of other encoders or data
    jobs: int = 1  # points side by side


def run_points(
    points: Sequence[Point],
    file: Path,
    how: Measuring,
    report: Report = lambda *_: None,
    opening: Callable[[str], None] = lambda _: None,
) -> list[Row]:
    """Return the rows of all points, and append each new one to the file as soon as it is there.

    Those that are in the file count, unless sequence or codec have changed. `opening` is told each sequence before it
    is opened, which takes minutes where it has to be made. InputError where a sequence is missing.
    """
    wanted, stored = {point.key for point in points}, read_rows(file) if file.exists() else []
    found = {row.point.key: row for row in stored if row.point.key in wanted and _is_valid(row, how)}
    if how.stale:
        found = _of_today(found, how, opening)
    missing = [point for point in points if point.key not in found]
    for row in [found[point.key] for point in points if point.key in found]:
        report(row, False)
    if missing:
        check_writable(file)
    for sequence, frames in dict.fromkeys((point.sequence, point.frames) for point in missing):
        opening(sequence)
        how.store.open(sequence, frames)  # what takes long to make is made once, before processes need it
    for measured in _measured(runs_of(missing), how):
        state = None if measured.failed else encoder_digest(measured.point)
        row = msgspec.structs.replace(measured, encoder=state)
        append_row(file, row)
        found[row.point.key] = row
        report(row, True)
    return [found[point.key] for point in points]


def _of_today(found: dict[str, Row], how: Measuring, opening: Callable[[str], None]) -> dict[str, Row]:
    """Return the rows of today's encoders and data, by the keys of their points, and those that failed."""
    found = {key: row for key, row in found.items() if not is_stale(row)}
    today = dict[tuple[str, int | None], str]()
    for place in dict.fromkeys((row.point.sequence, row.point.frames) for row in found.values() if not row.failed):
        opening(place[0])
        today[place] = digest([how.store.open(*place).sequence[0]])
    return {k: r for k, r in found.items() if r.failed or r.data == today[r.point.sequence, r.point.frames]}


def _is_valid(row: Row, how: Measuring) -> bool:
    """Return whether sequence and codec of a row are unchanged."""
    if row.failed and how.retry:
        return False
    return row.source == how.store.digest(row.point.sequence) and row.codec_version == codec_version(row.point.codec)


def runs_of(points: Sequence[Point]) -> list[list[Point]]:
    """Return the points in runs of those that share an analysis (`TwoStepCodec`)."""
    runs: dict[object, list[Point]] = {}
    for point in points:
        runs.setdefault(_shared(point), []).append(point)
    return list(runs.values())


def _shared(point: Point) -> object:
    """Return a key that is equal for points that share an analysis, or a played file."""
    if point.codec == HEADSET:
        return point.sequence, point.codec
    try:
        codec = make_codec(point.codec, point.options)
        if isinstance(codec, TwoStepCodec):
            return point.sequence, point.frames, point.sampled, str(codec.analysis_key)
    except (Exception, SystemExit):  # its row reports it
        pass
    return point.key


def _measured(runs: Sequence[list[Point]], how: Measuring) -> Iterator[Row]:
    if how.jobs == 1:
        for run in runs:
            yield from _rows_of(run, how)
        return
    with ThreadPoolExecutor(how.jobs) as executor:
        longest_first = sorted(runs, key=len, reverse=True)
        try:
            calls = [executor.submit(lambda run: list(_rows_of(run, how)), each) for each in longest_first]
            for done in as_completed(calls):
                yield from done.result()
        except BaseException:
            executor.shutdown(wait=False, cancel_futures=True)
            end_all()
            raise


def _rows_of(run: Sequence[Point], how: Measuring) -> Iterator[Row]:
    """Yield the rows of a run from a process of its own, and from another one after a point that ends it."""
    left = list(run)
    while left:
        try:
            for row in in_fresh_process(measure_points, left, how.store, limit_s=how.limit_s):
                yield row
                left.pop(0)
        except WorkerError as error:
            if not left:
                return
            row = empty_row(left.pop(0), how.store)
            yield msgspec.structs.replace(row, failed=str(error))
