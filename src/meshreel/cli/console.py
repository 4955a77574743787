"""The terminal: warnings, progress by stage with the time left, results as text or JSON."""

from __future__ import annotations

import json
import shutil
import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter
from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    SpinnerColumn,
    TaskID,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)


@Parameter(name="*")
@dataclass(frozen=True, slots=True)
class Common:
    """What every command takes."""

    quiet: Annotated[bool, Parameter(negative="")] = False
    """Say nothing but errors (and JSON, where asked for)."""
    json: Annotated[bool, Parameter(negative="")] = False
    """Print one JSON object instead of text."""
    debug: Annotated[bool, Parameter(negative="")] = False
    """Show the traceback of an error."""

    def warn(self, texts: Iterable[str]) -> None:
        """Warnings on standard error, a line each."""
        for text in texts:
            if not self.quiet:
                print(f"meshreel: warning: {text}", file=sys.stderr)

    def note(self, text: str) -> None:
        """One line about what goes on, on standard error; above the progress bars where there are any."""
        if not self.quiet:
            print(text, file=sys.stderr)

    def result(self, row: dict[str, Any], *texts: object) -> None:
        """The result: `row` as JSON, or the texts and tables."""
        if self.json:
            print(json.dumps(row, allow_nan=False, default=str))
        elif not self.quiet:
            console = Console(highlight=False, soft_wrap=True)
            for text in texts:
                console.print(text, markup=False)
        sys.stdout.flush()  # a server goes on after it

    @contextmanager
    def stages(self, total: int) -> Iterator[StageBars]:
        """Progress bars, one a stage, on standard error; nothing where quiet or not a terminal."""
        console = Console(stderr=True)
        columns = (
            SpinnerColumn(),
            TextColumn("{task.description:<10}"),
            BarColumn(),
            MofNCompleteColumn(),
            TextColumn("frames"),
            TimeElapsedColumn(),
            TextColumn("left"),
            TimeRemainingColumn(),
        )
        with Progress(*columns, console=console, disable=self.quiet or not console.is_terminal) as bars:
            yield StageBars(bars, total)


def called_as() -> str:
    """How this program was called, for a command that is shown: as found on PATH, by its path, or as a module."""
    called = Path(sys.argv[0])
    if called.stem == "__main__":
        return f"{sys.executable} -m meshreel"
    if called.stem != "meshreel":
        return "meshreel"  # from another program, which has it as a library
    found = shutil.which(called.name)
    return "meshreel" if found is not None and Path(found).resolve() == called.resolve() else str(called)


class StageBars:
    """A progress callback that opens a bar for each stage as it first reports."""

    def __init__(self, bars: Progress, total: int) -> None:
        self.bars = bars
        self.total = total
        self.tasks: dict[str, TaskID] = {}

    def __call__(self, stage: str, done: int, total: int) -> None:
        """`done` of `total` frames have passed `stage`."""
        if stage not in self.tasks:
            self.tasks[stage] = self.bars.add_task(stage, total=total)
        self.bars.update(self.tasks[stage], completed=done, total=total)
