"""`meshreel bench run|report`: codecs swept over sequences into JSON rows, and tables and plots made from rows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

from cyclopts import App, Parameter
from rich.table import Table

from ..evaluation.experiments import experiment as find_experiment
from ..evaluation.promises import Promise
from ..evaluation.report import write_report
from ..evaluation.rows import Row, read_rows
from ..evaluation.runner import run_points
from ..metrics.report import ComparisonOptions
from .console import Common

command = App(name="bench", help="Measure codecs against each other, and make tables and plots of the rows.")
DATA = Path("../shared/data/performers")


@command.command
def run(
    experiment: str,
    /,
    *,
    output: Annotated[Path, Parameter(name=["--output", "-o"])],
    data: Path = DATA,
    small: bool = False,
    ssim: bool = True,
    common: Common = Common(),
) -> None:
    """Run an experiment and print what it promised and reached.

    Every row is appended to the output as soon as it is there, and rows that are there are not run again.

    Parameters
    ----------
    experiment
        Which one: `targets`.
    output
        A JSON-lines file.
    data
        The folder of the sequences.
    small
        A few points on a few frames only: minutes.
    ssim
        Render and compare pictures too (slower).
    """
    chosen = find_experiment(experiment)
    points = list(chosen.points(small))
    with common.stages(len(points)) as progress:

        def tell(row: Row, new: bool) -> None:
            done[0] += 1
            progress("points", done[0], len(points))
            common.note(f"{done[0]}/{len(points)} {describe(row)}{'' if new else ' (measured before)'}")

        done = [0]
        rows = run_points(points, data, output, ComparisonOptions(ssim=ssim), tell)
    reached = chosen.promises(rows)
    common.result({"output": str(output), "rows": len(rows)} | _promised(reached), promise_table(reached))


@command.command
def report(
    rows: Path,
    /,
    *,
    output: Annotated[Path, Parameter(name=["--output", "-o"])],
    experiment: str = "targets",
    common: Common = Common(),
) -> None:
    """Write results.md and plots from rows, and from nothing else.

    Parameters
    ----------
    rows
        A JSON-lines file that `run` wrote.
    output
        The folder to write into.
    experiment
        Whose promises to judge.
    """
    chosen, measured = find_experiment(experiment), read_rows(rows)
    written = [str(path) for path in write_report(measured, chosen, output)]
    reached = chosen.promises(measured)
    common.result({"files": written} | _promised(reached), promise_table(reached), *written)


def describe(row: Row) -> str:
    """A row in one line."""
    options = " ".join(f"{k} {v}" for k, v in row["options"].items() if v is not None)
    head = f"{row['sequence']} {row['codec']} {options}:"
    if row["kind"] == "memory":
        return f"{head} {row['frames']} frames, peak {row['peak_rss_mb']:.0f} MB"
    quality = f"{row['d2_psnr_paper']:.2f} dB, {row['normal_error_deg']:.2f} degrees"
    return f"{head} {row['mbps']:.3f} Mbps, {quality}, {row['encode_s']:.2f} s/frame"


def promise_table(promises: Sequence[Promise]) -> Table:
    """The targets, a line each."""
    table = Table("target", "bound", "measured", "")
    for promise in promises:
        table.add_row(promise.text, promise.bound, promise.value or "", promise.verdict)
    return table


def _promised(promises: Sequence[Promise]) -> dict[str, object]:
    return {"promises": [asdict(promise) for promise in promises]}
