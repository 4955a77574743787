"""Terminal output: warnings, progress as a bar for each stage or as lines, results as text or JSON."""

from __future__ import annotations

import json
import shutil
import sys
import threading
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, nullcontext, suppress
from dataclasses import dataclass
from datetime import timedelta
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter
from rich import progress
from rich.console import Console
from rich.text import Text

from . import program, shown

Flag = Annotated[bool, Parameter(negative="")]
Force = Annotated[bool, Parameter(help="Replace files that are there and that were not named.", negative="")]
EVERY = 10.0  # s, between two lines of progress outside a terminal


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
                print(f"{program()}: warning: {shown(text)}", file=sys.stderr)

    def note(self, text: str) -> None:
        """Print a line on standard error, above the progress bars."""
        if not self.quiet:
            print(shown(text), file=sys.stderr)

    def result(self, row: dict[str, Any], *texts: object) -> None:
        """Print the result: `row` as JSON, or the texts and tables."""
        if self.json:
            print(json.dumps(row, allow_nan=False, default=str))
        elif not self.quiet:
            console = _Console(highlight=False, soft_wrap=True)
            for text in texts:
                console.print(text, markup=False)
        if sys.stdout is not None:  # None if the caller closed it
            sys.stdout.flush()  # a server prints its addresses and keeps running

    @contextmanager
    def stages(self, total: int, counted: str = "frames") -> Iterator[StageBars]:
        """Show progress on standard error: a bar per stage, or lines if it is no terminal; nothing if quiet."""
        console = Console(stderr=True)
        columns = (
            progress.SpinnerColumn(),
            progress.TextColumn("{task.description:<10}"),
            *(progress.BarColumn(), progress.MofNCompleteColumn(), progress.TextColumn(counted)),
            *(progress.TimeElapsedColumn(), progress.TextColumn("left"), _LeftColumn()),
        )
        visible = console.is_terminal and not self.quiet
        bars = progress.Progress(*columns, console=console, disable=not visible)
        with bars, nullcontext() if visible or self.quiet else _lines(bars, counted):
            yield StageBars(bars, total)


def called_as() -> str:
    """Return the command that called this program, for printed examples: name on PATH, path, or module."""
    called = Path(sys.argv[0])
    if called.stem == "__main__":
        return f"{sys.executable} -m meshreel"
    if called.stem != "meshreel":
        return "meshreel"  # another program uses it as a library
    on_path = shutil.which(called.name)
    return "meshreel" if on_path is not None and Path(on_path).resolve() == called.resolve() else str(called)


class _Console(Console):
    """A console on which texts command nothing, also in the cells of tables."""

    def render_str(self, text: str, **others: Any) -> Text:
        return super().render_str(shown(text), **others)


class StageBars:
    """Progress callback that opens a bar when a stage reports for the first time."""

    def __init__(self, bars: progress.Progress, total: int) -> None:
        self.bars = bars
        self.total = total
        self.tasks: dict[str, progress.TaskID] = {}

    def __call__(self, stage: str, done: int, total: int) -> None:
        """Show that `done` of `total` frames have passed `stage`."""
        if stage not in self.tasks:
            self.tasks[stage] = self.bars.add_task(stage, total=total, first=done)
        task = next(task for task in self.bars.tasks if task.id == self.tasks[stage])
        if done < task.completed:  # the next encode of a search for a target
            self.bars.reset(task.id, total=total, completed=done, first=done)
        self.bars.update(self.tasks[stage], completed=done, total=total)


def left(task: progress.Task) -> float | None:
    """Return the seconds that a stage still takes at its pace so far; None before its first frame."""
    gained = task.completed - task.fields["first"]  # frames of an earlier run took no time
    if gained <= 0 or task.elapsed is None or task.remaining is None:
        return None
    return task.elapsed * task.remaining / gained


class _LeftColumn(progress.ProgressColumn):
    """Column with the time left, from the mean time of all frames so far, because single frames vary."""

    def render(self, task: progress.Task) -> Text:
        return Text(_clock(left(task)), style="progress.remaining")


@contextmanager
def _lines(bars: progress.Progress, counted: str) -> Iterator[None]:
    """Print a line of progress on standard error every `EVERY` seconds, until the block ends."""
    ended = threading.Event()

    def run() -> None:
        with suppress(OSError, ValueError):  # standard error is closed
            while not ended.wait(EVERY):
                if text := line_of(bars.tasks, counted):
                    print(text, file=sys.stderr, flush=True)

    thread = threading.Thread(target=run, name="lines of progress", daemon=True)
    thread.start()
    try:
        yield
    finally:
        ended.set()
        thread.join()


def line_of(tasks: Iterable[progress.Task], counted: str = "frames") -> str:
    """Return a line with the progress of the unfinished stages, or the last finished stage; empty before any."""
    if not (all_of_them := list(tasks)):
        return ""
    began = min(task.start_time or 0.0 for task in all_of_them)
    so_far = f"{_clock(all_of_them[0].get_time() - began)} so far"
    open_ones = [task for task in all_of_them if not task.finished]
    if not open_ones:
        return f"{program()}: {all_of_them[-1].description} is done; {so_far}"
    counts = ", ".join(f"{task.description} {task.completed:.0f}" for task in open_ones)
    lefts = [seconds for task in open_ones if (seconds := left(task)) is not None]
    rest = f", about {_clock(max(lefts))} left" if lefts else ""
    return f"{program()}: {counts} of {open_ones[0].total:.0f} {counted}; {so_far}{rest}"


def _clock(seconds: float | None) -> str:
    return "-:--:--" if seconds is None else str(timedelta(seconds=round(seconds)))
