"""Sweeps: points of an experiment become rows of a file, in this process or in others, one after the other or not.

In: points, the file that their rows belong in. Out: rows, each in the file as soon as it is there. What a row has is
in measure.py.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, Future
from pathlib import Path
from queue import PriorityQueue, SimpleQueue

from .apart import failed_row, make_apart, measure_apart
from .bench import Bench
from .codec import TwoStepCodec
from .codecs import make_codec
from .datasets import MADE, open_dataset, own_digest
from .identity import changed, check_same
from .measure import measure_point
from .rd_rows import KINDS as RATED_KINDS
from .row_form import FAILED
from .rows import Point, Row, append_row, check_appendable, check_folder, experiment_of, measured_rows, read_rows
from .scene_rows import KINDS as SCENE_KINDS

AFTER = ("decode",)  # kinds of points that compare with rows measured before
Source = tuple[str, int | None]  # a sequence, and how many frames of it
Tell = Callable[[Row, bool], None]  # a row, and whether it is new


def run_points(
    points: Sequence[Point],
    file: Path,
    bench: Bench,
    tell: Tell,
    executor: Executor | None = None,
) -> list[Row]:
    """Rows of all points, each appended to `file` as soon as it is there; `tell` hears each and whether it is new.

    Points that have a row in the file already are not run again, so an interrupted sweep goes on where it was; a row
    of an experiment that measures alike (`bench.alike`) is written again as one of this. With an executor points are
    measured side by side, but for those that compare with other rows (`AFTER`): they come last.
    """
    check_appendable(file)
    stored = read_rows(file) if file.exists() else []
    known = {row["point"]: row for row in _of(stored, bench.experiment) if not (bench.retry and FAILED in row)}
    others = {
        row["point"]: row for name in bench.alike for row in measured_rows(_of(stored, name)) if _alike(row, bench)
    }
    check_same(points, others | known, bench, file)
    for point in points:
        if FAILED in known.get(point.key, {FAILED: "not there"}) and point.key in others:
            known[point.key] = others[point.key] | {"experiment": bench.experiment}
            append_row(file, known[point.key])
        if point.key in known:
            tell(known[point.key], False)
    missing = [point for point in points if point.key not in known]
    for folder in (bench.cache, bench.pictures) if missing else ():
        if folder is not None:
            check_folder(folder)
    _check_sequences(missing, bench, executor is not None)
    began = {point.sequence: own_digest(point.sequence, bench.data, bench.own) for point in missing}
    asked = {point.key: point for point in missing}
    for found in _measured(missing, list(known.values()), bench, executor):
        why = changed(found, began, bench)
        row = found if why is None else failed_row(asked[found["point"]], bench, why)
        append_row(file, row)
        known[row["point"]] = row
        tell(row, True)
    return [known[point.key] for point in points]


def _of(rows: Sequence[Row], experiment: str) -> list[Row]:
    return [row for row in rows if experiment_of(row) == experiment]


def _alike(row: Row, bench: Bench) -> bool:
    """Whether a row of another experiment has what one of this would have."""
    return ("ssim" in row) == bench.comparison.ssim


def _measured(points: Sequence[Point], rows: list[Row], bench: Bench, executor: Executor | None) -> Iterator[Row]:
    """A row a point, as each is there."""
    runs = runs_of([point for point in points if point.kind not in AFTER])
    found = _side_by_side(runs, bench, executor) if executor else (row for run in runs for row in _rows_of(run, bench))
    for row in found:
        rows.append(row)
        yield row
    for point in points:
        if point.kind in AFTER:
            yield from _rows_of([point], bench, tuple(rows))


def runs_of(points: Sequence[Point]) -> list[list[Point]]:
    """The points in runs of those that share an analysis (`TwoStepCodec`), in the order of each run's first."""
    runs: dict[object, list[Point]] = {}
    for point in points:
        runs.setdefault(_shared(point), []).append(point)
    return list(runs.values())


def _shared(point: Point) -> object:
    """Equal for points that share an analysis."""
    if point.kind in RATED_KINDS:
        try:
            codec = make_codec(point.codec, point.options)
            if isinstance(codec, TwoStepCodec):
                return point.sequence, point.frames, point.kind, str(codec.analysis_key)
        except (Exception, SystemExit):  # whatever it is, it is told when the point is measured
            return point.key
    return point.key


def _side_by_side(runs: Sequence[list[Point]], bench: Bench, executor: Executor) -> Iterator[Row]:
    """The rows of all runs as they come; the longest begin first, so that no worker is left with one at the end.

    Runs wait for their own sequence only: one that takes long to make is made beside the runs of others.
    """
    arrived: SimpleQueue[Row | Future[None]] = SimpleQueue()
    ready: PriorityQueue[tuple[int, int]] = PriorityQueue()  # the longest first, then as they are in `runs`

    def submit(task: Callable[..., None], *about: object) -> None:
        executor.submit(task, *about).add_done_callback(arrived.put)

    def make(source: Source, numbers: list[int]) -> None:
        make_apart(*source, bench)
        begin(numbers)

    def begin(numbers: list[int]) -> None:
        for number in numbers:
            ready.put((-len(runs[number]), number))
        for _ in numbers:
            submit(measure)

    def measure() -> None:
        for row in _rows_of(runs[ready.get()[1]], bench):
            arrived.put(row)

    waiting: dict[Source | None, list[int]] = {}
    for number, run in enumerate(runs):
        waiting.setdefault(_made_first(run[0]), []).append(number)
    there = waiting.pop(None, [])
    left = len(waiting) + len(runs)
    for source, numbers in waiting.items():
        submit(make, source, numbers)
    begin(there)
    while left:
        if isinstance(came := arrived.get(), Future):
            came.result()  # raises what went wrong
            left -= 1
        else:
            yield came


def _made_first(point: Point) -> Source | None:
    """What must be made before a point is measured, where that takes long."""
    return (point.sequence, point.frames) if point.sequence in MADE and point.kind not in SCENE_KINDS else None


def _check_sequences(points: Sequence[Point], bench: Bench, side_by_side: bool) -> None:
    """Raises InputError where data are missing: that is no codec's failure; of what is made first it is told later."""
    for sequence, frames in dict.fromkeys(
        (p.sequence, p.frames) for p in points if p.kind not in SCENE_KINDS and not (side_by_side and _made_first(p))
    ):
        open_dataset(sequence, bench.data, frames, bench.cache, bench.own)


def _rows_of(run: Sequence[Point], bench: Bench, rows: Sequence[Row] = ()) -> Iterator[Row]:
    """As `measure_point`, of each; where there is a limit, in a process of their own."""
    if bench.limit_s is None:
        return (measure_point(point, bench, rows) for point in run)
    return measure_apart(run, bench, rows)
