"""Terminal output: warnings, a progress bar for each stage, results as text or JSON."""

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
    """Flags of every command, and output that follows them."""

    quiet: Annotated[bool, Parameter(negative="")] = False
    """Print errors only (and JSON, if requested)."""
    json: Annotated[bool, Parameter(negative="")] = False
    """Print one JSON object instead of text."""
    debug: Annotated[bool, Parameter(negative="")] = False
    """Show the traceback of an error."""

    def warn(self, texts: Iterable[str]) -> None:
        """Print warnings on standard error, one per line."""
        for text in texts:
            if not self.quiet:
                print(f"meshreel: warning: {text}", file=sys.stderr)

    def note(self, text: str) -> None:
        """Print a line on standard error, above the progress bars."""
        if not self.quiet:
            print(text, file=sys.stderr)

    def result(self, row: dict[str, Any], *texts: object) -> None:
        """Print the result: `row` as JSON, or the texts and tables."""
        if self.json:
            print(json.dumps(row, allow_nan=False, default=str))
        elif not self.quiet:
            console = Console(highlight=False, soft_wrap=True)
            for text in texts:
                console.print(text, markup=False)
        if sys.stdout is not None:  # it is closed where the caller has none
            sys.stdout.flush()  # a server prints its addresses and keeps running

    @contextmanager
    def stages(self, total: int) -> Iterator[StageBars]:
        """Show progress bars, one per stage, on standard error; none if quiet or not a terminal."""
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
    """Return how this program was called, for printed commands: by its name on PATH, by its path, or as a module."""
    called = Path(sys.argv[0])
    if called.stem == "__main__":
        return f"{sys.executable} -m meshreel"
    if called.stem != "meshreel":
        return "meshreel"  # from another program, which uses it as a library
    found = shutil.which(called.name)
    return "meshreel" if found is not None and Path(found).resolve() == called.resolve() else str(called)


class StageBars:
    """Progress callback that opens a bar when a stage reports for the first time."""

    def __init__(self, bars: Progress, total: int) -> None:
        self.bars = bars
        self.total = total
        self.tasks: dict[str, TaskID] = {}

    def __call__(self, stage: str, done: int, total: int) -> None:
        """Show that `done` of `total` frames have passed `stage`."""
        if stage not in self.tasks:
            self.tasks[stage] = self.bars.add_task(stage, total=total)
        self.bars.update(self.tasks[stage], completed=done, total=total)
