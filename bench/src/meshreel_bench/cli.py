"""`meshreel-bench run|report|list|codecs`: codecs swept over sequences into JSON rows, and pages made from rows."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Annotated

import msgspec
from cyclopts import App, Parameter
from rich.table import Table

from meshreel.cli import run_app
from meshreel.cli.console import Common
from meshreel.cli.sources import Reading
from meshreel.errors import InputError

from .codecs import codec_names, codec_version, make_codec
from .datasets import Store, released_in, views_missing
from .experiments import EXPERIMENTS, find_experiment
from .experiments.study import Sweep
from .measure.digests import is_stale
from .measure.runner import Measuring, run_points
from .report.pages import mixtures, parts_of, write_report
from .report.values import value
from .report.verdicts import Verdict, verdicts
from .rows import Options, Point, Row, join_rows, parted, read_rows

HELP = "Measure codecs against each other, and make tables and plots of the rows."
CACHE = ".cache"  # ending of the folder beside the rows where sequences are kept
DATA = Path("../shared/data")
LONGEST = 1e6  # s, of a point: eleven days
Output = Annotated[Path, Parameter(name=["--output", "-o"])]
command = App(name="bench", help=HELP)  # of `meshreel bench`


@Parameter(name="*")
@dataclass(frozen=True, slots=True)
class Running:
    """Options of a run: time limit, processes, retries."""

    jobs: int = 1
    """Points to measure in parallel, each in a process of its own; only times change."""
    limit: float = 3600.0
    """Seconds per point; a point that takes longer, crashes or decodes invalid meshes is recorded as failed."""
    retry: Annotated[bool, Parameter(negative="")] = False
    """Measure failed points again; successful ones are never repeated."""
    stale: Annotated[bool, Parameter(negative="")] = False
    """Measure points again whose rows are of another encoder or other data, or do not say of which."""
    ssim: bool = True
    """Compare rendered pictures too (slower)."""

    def __post_init__(self) -> None:
        if self.jobs < 1 or not 0 < self.limit <= LONGEST:
            text = f"give at least 1, and seconds above 0, {LONGEST:g} at most"
            raise InputError(f"--jobs {self.jobs}, --limit {self.limit:g}: {text}")


@Parameter(name="*")
@dataclass(frozen=True, slots=True)
class Selection:
    """Selection of points and of their data."""

    data: Path = DATA
    """Folder of the benchmark data, or of the data that TSMC's authors release (answering/meshes/mesh_00.obj with
    answering/view_00.json)."""
    small: bool = False
    """One point per codec on a few procedural frames: takes minutes, needs no data."""
    only: Annotated[tuple[str, ...], Parameter(consume_multiple=True, negative="")] = ()
    """Only points of these codecs, e.g. `tvmc`."""
    on: Annotated[tuple[str, ...], Parameter(consume_multiple=True, negative="")] = ()
    """Only points on these sequences, e.g. `synthetic4`; also a name below the data, or a path."""
    add: Annotated[tuple[str, ...], Parameter(consume_multiple=True, negative="")] = ()
    """Additional operating points, e.g. `zipmesh`, `draco:qp=12` (`codec:option=value,option=value`) or `necgs:full`
    (`codec:configuration`)."""

    def points(self, name: str, ssim: bool) -> list[Point]:
        """Return the points of an experiment. Raises InputError where there are none."""
        study, on = find_experiment(name), self.on or (() if self.small else released_in(self.data))
        others = [each for each in on if each not in study.sequences]
        for each in others:
            if any("\ud800" <= sign <= "\udfff" for sign in each):
                raise InputError(f"--on {each!r}: the name is not UTF-8, which rows are; rename it")
        added = [Sweep(codec, {}, options) for codec, options in map(operating_point, self.add)]
        wider = replace(study, sequences=on if others else study.sequences, sweeps=(*study.sweeps, *added))
        points = list({point.key: point for point in wider.points(self.small)}.values())  # added ones may be there
        points = [point for point in points if point.codec in (self.only or [point.codec])]
        points = [point for point in points if point.sequence in (on or [point.sequence])]
        if not points:
            known = list(dict.fromkeys(point.codec for point in study.points(self.small)))
            of = f"{name}{' --small' if self.small else ''}"
            if not known:
                raise InputError(f"{of} has no points: it measures no codec; leave out --small")
            where = f" on {' '.join(on)}" if on else ""
            text = f"{of} has no points of {' '.join(self.only or known)}{where}"
            raise InputError(f"{text}; its codecs: {', '.join(known)}; --only leaves out what --add adds, too")
        return points if ssim else [msgspec.structs.replace(point, metrics="distances") for point in points]


def operating_point(point: str) -> tuple[str, Options]:
    """Return a codec and its options. Raises InputError where the text is neither `codec` nor `codec:option=value`."""
    codec, _, listed = point.partition(":")
    options: Options = {}
    for each in listed.split(",") if listed else ():
        name, sign, found = each.partition("=")
        if not sign and name.isidentifier():
            name, found = "configuration", name
        elif not (sign and name):
            raise InputError(f"operating point {point!r}: {each!r} is no option=value")
        try:
            options[name] = json.loads(found)
            if isinstance(options[name], (list, dict)):
                raise InputError(f"operating point {point!r}: {name} is a list or an object; give a number or a text")
        except json.JSONDecodeError:
            options[name] = found  # text without quotes
    make_codec(codec, options)  # refuses what it does not know
    return codec, options


@command.command
def run(
    experiment: str,
    /,
    *,
    output: Output,
    selection: Selection = Selection(),
    running: Running = Running(),
    reading: Reading = Reading(),
    common: Common = Common(),
) -> None:
    """Run an experiment and print its targets beside the measured values.

    Rows that the output already has are not measured again. Sequences that take long to make are kept beside it, in a
    folder whose name ends in `.cache`. `--fps`, `--frames` and `--scale` apply to your own sequences.

    Parameters
    ----------
    experiment
        Name of the experiment; `meshreel-bench list` shows all.
    output
        A JSON-lines file.
    """
    if not output.name or output.suffix == CACHE:
        raise InputError(f"--output {output}: give a file, as rows.jsonl; {CACHE} is a folder beside it")
    points = selection.points(experiment, running.ssim)
    store = Store(selection.data.absolute(), output.absolute().with_suffix(CACHE), reading.options())
    common.warn(views_missing(selection.data, [point.sequence for point in points]))
    how = Measuring(store, running.limit, running.retry, running.stale, running.jobs)
    with common.stages("points") as progress:
        done = 0

        def opening(sequence: str) -> None:
            common.note(f"opening {sequence}; scenes are simulated once, in minutes, and kept in {store.cache}")

        def report(row: Row, new: bool) -> None:
            nonlocal done
            done += 1
            if new:  # the others take no time, which the time left is reckoned from
                progress("measured", done, len(points))
            before = "" if new else " (before; --retry tries again)" if row.failed else " (measured before)"
            common.note(f"{done}/{len(points)} {describe(row)}{before}")

        rows = run_points(points, output, how, report, opening)
    measured, failed = parted(rows)
    common.warn(tuple(describe(row) for row in failed))
    if stale := sum(map(is_stale, rows)):
        text = f"{stale} of {len(rows)} rows are of another encoder than today's, or do not say of which"
        common.warn((f"{text}; --stale measures them again",))
    found = verdicts(find_experiment(experiment), measured)
    counts = {"output": str(output), "rows": len(rows), "failed": len(failed), "stale": stale}
    common.result(counts | {"promises": [asdict(verdict) for verdict in found]}, verdict_table(found))
    if len(failed) == len(rows):
        raise InputError(f"{output}: all {len(rows)} points failed; mend what they report, and run again with --retry")


@command.command
def report(rows: list[Path], /, *, output: Output, common: Common = Common()) -> None:
    """Write pages, plots and tables from measured rows alone.

    `results.md` is the first page; `results/` beside it has an appendix and a plot for each experiment; rows on the
    paper's sequences also make `reproducing.md`. Same rows, same bytes.

    Parameters
    ----------
    rows
        JSON-lines files that `run` wrote, of any experiments; if several have a point, the first counts.
    output
        The folder to write into.
    """
    files = {path: read_rows(path) for path in rows}
    if empty := [path for path, found in files.items() if not found]:
        raise InputError(f"{empty[0]}: has no rows; make some with `meshreel-bench run`")
    joined = join_rows(files.values())
    for part in parts_of(joined):
        if mixed := mixtures(part.rows):
            keys = {row.point.key for row in part.rows}
            paths = [path for path, own in files.items() if any(row.point.key in keys for row in own)]
            text = f"{' '.join(map(str, paths))}: rows of different states make no page: {'; '.join(mixed)}"
            raise InputError(f"{text}; measure them again: meshreel-bench run {part.name} --stale -o {paths[0]}")
    common.warn(tuple(describe(row) for row in parted(joined)[1]))
    written = [str(path) for path in write_report(joined, output)]
    found = [verdict for part in parts_of(joined) for verdict in verdicts(part.study, part.rows)]
    record = {"files": written, "promises": [asdict(verdict) for verdict in found]}
    common.result(record, verdict_table(found), *written)


@command.command(name="list")
def list_experiments(*, common: Common = Common()) -> None:
    """List the experiments, their sequences, and how many points each has."""
    table = Table("experiment", "title", "sequences", "points")
    records = []
    for name, study in EXPERIMENTS.items():
        count = sum(1 for _ in study.points())
        records.append({"experiment": name, "sequences": list(study.sequences), "points": count})
        table.add_row(name, study.title, ", ".join(study.sequences), str(count))
    common.result({"experiments": records}, table)


@command.command
def codecs(*, common: Common = Common()) -> None:
    """List the codecs that can be compared, and the distributions that bring them."""
    found = {name: codec_version(name) or "meshreel-bench" for name in codec_names()}
    table = Table("codec", "from")
    for name, version in found.items():
        table.add_row(name, version)
    common.result({"codecs": found}, table)


def describe(row: Row) -> str:
    """Return a row in one line: rate, quality and time of a point, or the reason of its failure."""
    options = " ".join(f"{name} {option}" for name, option in row.options.items() if option is not None)
    units = {"d2_psnr_paper": "dB", "truth_d2_psnr_backward": "dB to the truth", "encode_s": "s/frame"}
    found = [(value(row, key), unit) for key, unit in (units | {"iou_mean": "IoU"}).items()]
    parts = [f"{row.mbps:.3f} Mbps"] if row.stream else []
    parts += [f"{number:.2f} {unit}" for number, unit in found if number is not None]
    measured = f"failed: {row.failed}" if row.failed else ", ".join(parts)
    line = f"{row.point.sequence} {row.name} {options}: {measured}"
    return "".join(sign if sign.isprintable() else "?" for sign in " ".join(line.split()))


def verdict_table(found: Sequence[Verdict]) -> Table | str:
    """Return a table of the targets that rows decide, or a sentence if they decide none."""
    decided = [each for each in found if each.value is not None]
    if not decided:
        return f"these points decide none of {len(found)} targets; `meshreel-bench report` makes curves of them"
    table = Table("target", "bound", "measured", "")
    for verdict in decided:
        table.add_row(verdict.text, verdict.bound, verdict.value or "", verdict.word)
    return table


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the program `meshreel-bench`; exit codes are those of `meshreel`."""
    return run_app(make_app, arguments)


def make_app() -> App:
    """Return the parser of `meshreel-bench`."""
    app = App(name="meshreel-bench", help=HELP, suppress_keyboard_interrupt=False)
    app.update(command)
    return app
