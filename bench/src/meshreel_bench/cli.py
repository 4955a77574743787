"""`meshreel bench run|report`: codecs swept over sequences into JSON rows, and pages made from rows."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from concurrent.futures import Executor, ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Annotated

from cyclopts import App, Parameter
from rich.table import Table

from meshreel.cli import run_app
from meshreel.cli.console import Common
from meshreel.cli.flags import Reading
from meshreel.errors import InputError

from .apart import begin, end_all
from .bench import PICTURES, Bench
from .datasets import own_digest
from .experiment import Experiment
from .experiments import EXPERIMENTS
from .experiments import experiment as find_experiment
from .identity import check_one_source
from .promises import Promise
from .rd_rows import FLOOR as RATED_FLOOR
from .report import write_report
from .row_form import FAILED, UNPICTURED
from .rows import Point, Row, experiment_of, failed_rows, join_rows, measured_rows, read_rows
from .runner import run_points
from .said import one_line
from .scene_rows import FLOOR, MEMORY, SCENE, SEGMENTATION
from .study import Study

HELP = "Measure codecs against each other, and make tables and plots of the rows."
command = App(name="bench", help=HELP)  # of `meshreel bench`
BESIDE = (".cache", PICTURES)  # endings of folders
DATA = Path("../shared/data")


@Parameter(name="*")
@dataclass(frozen=True, slots=True)
class Running:
    """How points are measured."""

    jobs: int = 1
    """Points to measure side by side, each in a process; the rows are the same but for times."""
    limit: float = 3600.0
    """Seconds that a point may take; one that takes longer, crashes or decodes nonsense becomes a row that says so."""
    retry: Annotated[bool, Parameter(negative="")] = False
    """Measure points again that failed before; those that were measured are never measured again."""
    ssim: bool = True
    """Render and compare pictures too (slower)."""

    def __post_init__(self) -> None:
        if self.jobs < 1 or not 0 < self.limit < math.inf:
            raise InputError(f"--jobs {self.jobs}, --limit {self.limit:g}: give at least 1, and seconds above 0")


@Parameter(name="*")
@dataclass(frozen=True, slots=True)
class Selection:
    """Which points, of which data."""

    data: Path = DATA
    """The folder of the sequences."""
    small: bool = False
    """A few points on a few frames only, minutes; the paper's experiments take procedural frames for that."""
    only: Annotated[tuple[str, ...], Parameter(consume_multiple=True, negative="")] = ()
    """Only the points of these codecs, as `tvmc`; the others keep the rows they have."""
    on: Annotated[tuple[str, ...], Parameter(consume_multiple=True, negative="")] = ()
    """Only the points on these sequences, as `synthetic4`; the paper's experiments are run on any other, too: a name
    below the folder of the sequences, or a path."""
    add: Annotated[tuple[str, ...], Parameter(consume_multiple=True, negative="")] = ()
    """Operating points more, of any codec, as `zipmesh` or `draco:qp=12` (`codec:option=value,option=value`)."""

    def of(self, chosen: Experiment, experiment: str) -> list[Point]:
        """The points of an experiment. InputError where there are none."""
        if isinstance(chosen, Study):
            known = {point.sequence for point in chosen.points(self.small)}
            chosen = chosen.extended([] if known.issuperset(self.on) else self.on, self.add)
        elif self.add:
            raise InputError(f"--add {' '.join(self.add)}: {experiment} has points of its own kinds; take figure6")
        points = list(chosen.points(self.small))
        for name, wanted, there in (("--only", self.only, _codecs(points)), ("--on", self.on, _sequences(points))):
            if unknown := [each for each in wanted if each not in there]:
                which = f"{experiment} --small" if self.small else experiment
                told = f"{which} has no such points; it has {', '.join(there)}"
                raise InputError(f"{name} {' '.join(unknown)}: {told}")
        found = [
            point
            for point in points
            if (not self.only or point.codec in self.only) and (not self.on or point.sequence in self.on)
        ]
        if not found:
            raise InputError(f"{experiment} has no points of {' '.join(self.only)} on {' '.join(self.on)}")
        return found


def _codecs(points: Sequence[Point]) -> list[str]:
    return list(dict.fromkeys(point.codec for point in points))


def _sequences(points: Sequence[Point]) -> list[str]:
    return list(dict.fromkeys(point.sequence for point in points))


@contextmanager
def side_by_side(jobs: int) -> Iterator[Executor | None]:
    """Threads that wait for so many processes, none for one; an interrupt ends these at once."""
    begin()
    if jobs == 1:
        yield None
        return
    with ThreadPoolExecutor(jobs) as executor:
        try:
            yield executor
        except BaseException:
            executor.shutdown(wait=False, cancel_futures=True)
            end_all()
            raise


@command.command
def run(
    experiment: str,
    /,
    *,
    output: Annotated[Path, Parameter(name=["--output", "-o"])],
    selection: Selection = Selection(),
    running: Running = Running(),
    reading: Reading = Reading(),
    common: Common = Common(),
) -> None:
    """Run an experiment and print what it promised and reached.

    Every row is appended to the output as soon as it is there, and rows that are there are not run again. Sequences
    that take long to make are kept in a folder beside it, whose name ends in `.cache`. How files are read (`--fps`,
    `--frames`, `--scale`) is about sequences of your own.

    Parameters
    ----------
    experiment
        Which one: the paper's `figure6`, `table1`, `table2`, `ablation_centers`, `ablation_gof`, `ablation_basis` and
        `ablation_stages`, which share the rows of points that they have in common; or `scenes`, `layers`, `targets`.
    output
        A JSON-lines file.
    """
    chosen = find_experiment(experiment)
    if not output.name or output.suffix in BESIDE:
        raise InputError(f"--output {output}: give a file, as rows.jsonl; {' and '.join(BESIDE)} are folders beside it")
    points = selection.of(chosen, experiment)
    comparison, cache = replace(chosen.COMPARISON, ssim=running.ssim), output.with_suffix(".cache")
    alike = [name for name, other in EXPERIMENTS.items() if isinstance(other, Study) and isinstance(chosen, Study)]
    bench = Bench(
        selection.data, experiment, comparison, cache, running.limit, running.retry, tuple(alike), reading.options()
    )
    if reading != Reading() and not any(own_digest(name, bench.data, bench.own) for name in _sequences(points)):
        raise InputError("--fps, --frames, --scale: the benchmark's sequences are what they are; name one with --on")
    with common.stages(len(points)) as progress, side_by_side(running.jobs) as executor:

        def tell(row: Row, new: bool) -> None:
            done[0] += 1
            progress("points", done[0], len(points))
            before = "" if new else " (before; --retry tries again)" if FAILED in row else " (measured before)"
            common.note(f"{done[0]}/{len(points)} {describe(row)}{before}")

        done = [0]
        rows = run_points(points, output, bench, tell, executor)
    failed = failed_rows(rows)
    common.warn(tuple(describe(row) for row in failed))
    promises = chosen.promises(measured_rows(rows))
    reached = [each for each in promises if each.value is not None] or promises  # of a part, what it tells
    told = {"output": str(output), "rows": len(rows), "failed": len(failed)}
    common.result(told | _promised(reached), promise_table(reached))
    if len(failed) == len(rows):
        raise InputError(f"{output}: all {len(rows)} points failed; mend what they say, and run again with --retry")


@command.command
def report(
    rows: list[Path],
    /,
    *,
    output: Annotated[Path, Parameter(name=["--output", "-o"])],
    common: Common = Common(),
) -> None:
    """Write pages, plots and tables from rows, and from nothing else.

    `index.html` has all in one file; `results.md` is the same with the plots beside it, as PNG and SVG, in `results/`.
    Rows on the paper's sequences also make `reproducing.md`: its numbers beside ours.
    Points that failed are listed with their reasons. Same rows, same bytes.

    Parameters
    ----------
    rows
        JSON-lines files that `run` wrote, of any experiments; of a point that several have, the first counts. The
        pictures that rows name are in a folder beside their file, whose name ends in `.pictures`: they make sheets.
    output
        The folder to write into.
    """
    files = [_reported(path) for path in rows]
    check_one_source([row for file in files for row in measured_rows(file)])
    joined = join_rows(files)
    measured = measured_rows(joined)
    common.warn(tuple(describe(row) for row in failed_rows(joined)))
    pictures = [path.with_suffix(PICTURES) for path in rows]
    written = [str(path) for path in write_report(joined, EXPERIMENTS, output, pictures)]
    reached = [
        promise
        for name, chosen in EXPERIMENTS.items()
        if (own := [row for row in measured if experiment_of(row) == name])
        for promise in chosen.promises(own)
    ]
    common.result({"files": written} | _promised(reached), promise_table(reached), *written)


def _reported(path: Path) -> list[Row]:
    """The rows of a file. Raises InputError where a report of them would lack all or some of them."""
    rows = read_rows(path)
    if not rows:
        raise InputError(f"{path}: has no rows; make some with `meshreel bench run`")
    for number, row in enumerate(rows, 1):
        if (name := experiment_of(row)) not in EXPERIMENTS:
            known = ", ".join(EXPERIMENTS)
            raise InputError(
                f"{path}, line {number}: no experiment is called {name!r}; known: {known}; delete that line"
            )
    return rows


def describe(row: Row) -> str:
    """A row in one line."""
    options = " ".join(f"{k} {v}" for k, v in row["options"].items() if v is not None)
    return one_line(f"{row['sequence']} {row['codec']} {options}: {_measured(row)}")


def _measured(row: Row) -> str:
    """What was measured of a point, or why nothing was."""
    if FAILED in row:
        return f"failed: {row[FAILED]}"
    if row["kind"] == "decode":
        peer = f"DracoPy {row['draco_ms']:.2f}, with subdivision {row['subdivided_ms']:.2f}"
        return f"{row['frame_ms']:.2f} ms/frame, {peer}"
    if row["kind"] in ("memory", MEMORY):
        return f"{row['frames']} frames, peak {row['peak_rss_mb']:.0f} MB"
    if row["kind"] == SEGMENTATION:
        return f"IoU {row['iou_mean']:.3f}, worst frame {row['iou_worst']:.3f}"
    if row["kind"] == RATED_FLOOR:
        return f"{_told(row, 'd2_psnr_paper', 'dB')} to the input"
    if row["kind"] in (FLOOR, SCENE):
        rate = f"{row['mbps']:.3f} Mbps, " if "mbps" in row else ""
        return f"{rate}to the truth {row['truth_d2_psnr_backward']:.2f} dB, SSIM {row['truth_ssim_masked']:.3f}"
    values = (("d2_psnr_paper", "dB"), ("normal_error_deg", "degrees"), ("encode_s", "s/frame"))
    told = [_told(row, key, unit) for key, unit in values]
    without = f"; no pictures: {row[UNPICTURED]}" if UNPICTURED in row else ""
    return f"{row['mbps']:.3f} Mbps, {', '.join(told)}{without}"


def _told(row: Row, key: str, unit: str) -> str:
    """A value with two digits; a metric that is not finite is null in rows."""
    return f"no {unit}" if row.get(key) is None else f"{row[key]:.2f} {unit}"


def promise_table(promises: Sequence[Promise]) -> Table:
    """The targets, a line each."""
    table = Table("target", "bound", "measured", "")
    for promise in promises:
        table.add_row(promise.text, promise.bound, promise.value or "", promise.verdict)
    return table


def _promised(promises: Sequence[Promise]) -> dict[str, object]:
    return {"promises": [asdict(promise) for promise in promises]}


def main(arguments: Sequence[str] | None = None) -> int:
    """The program `meshreel-bench`; exit codes are those of `meshreel`."""
    return run_app(make_app, arguments)


def make_app() -> App:
    """The parser of `meshreel-bench`."""
    app = App(name="meshreel-bench", help=HELP, suppress_keyboard_interrupt=False)
    for each in (run, report):
        app.command(each)
    return app
