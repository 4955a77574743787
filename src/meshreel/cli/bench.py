"""`meshreel bench run|report`: codecs swept over sequences into JSON rows, and tables and plots made from rows."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import App, Parameter

from ..evaluation.experiments import EXPERIMENTS
from ..evaluation.report import read_rows, table, write_report
from ..evaluation.runner import run_experiment
from .console import Common

command = App(name="bench", help="Measure codecs against each other.")


@command.command
def run(
    experiment: str,
    *,
    output: Annotated[Path, Parameter(name=["--output", "-o"])],
    data: Path = Path("../shared/data/performers"),
    small: bool = False,
    ssim: bool = True,
    common: Common = Common(),
) -> None:
    """Run an experiment; every row is appended to the output as soon as it is there, and rows there are not run again.

    Parameters
    ----------
    experiment
        Which one: `targets`.
    output
        A JSON-lines file.
    data
        The folder of the sequences.
    small
        A few points only: minutes.
    ssim
        Render and compare pictures too (slower).
    """
    rows = run_experiment(experiment, data, output, small, ssim, common)
