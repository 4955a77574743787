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
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter
from rich import progress
from rich.console import Console
from rich.text import Text

from . import program, shown

if TYPE_CHECKING:
    from ..encoder.group.progress import Progress

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
    def stages(self, counted: str = "frames") -> Iterator[StageBars]:
        """Show progress on standard error: a bar per stage, or lines if it is no terminal; nothing if quiet."""
        console = Console(stderr=True)
        columns = (
            progress.SpinnerColumn(),
            progress.TextColumn("{task.description:<10}"),
            *(progress.BarColumn(), progress.TextColumn("{task.fields[count]}")),
            *(progress.TimeElapsedColumn(), progress.TextColumn("left {task.fields[left]}")),
        )
        visible = console.is_terminal and not self.quiet
        bars = progress.Progress(*columns, console=console, disable=not visible)
        with bars, nullcontext() if visible or self.quiet else _lines(bars):
            yield StageBars(bars, counted)


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
    """Progress as a bar for each stage of a command, of which an encode is one."""

    def __init__(self, bars: progress.Progress, counted: str = "frames") -> None:
        self.bars, self._counted = bars, counted
        self._tasks: dict[str, progress.Task] = {}

    def __call__(self, stage: str, done: int, total: int) -> None:
        """Show that `done` of `total` frames have passed `stage`."""
        task = self._show(stage, done, total, f"{done} of {total} {self._counted}")
        new = done - task.fields["first"]  # frames of an earlier run took no time
        if new > 0 and task.elapsed is not None:
            task.fields["left"] = _clock(task.elapsed * (total - done) / new)

    def encode(self, now: Progress, name: str = "encode") -> None:
        """Show how far an encode, or a part of one, is, and the stage that it is in."""
        task = self._show(name, now.share, 1.0, f"{100 * now.share:.0f} %, {now.stage}")
        task.fields["left"] = _clock(now.left)

    def _show(self, name: str, done: float, total: float, count: str) -> progress.Task:
        if name not in self._tasks:
            self.bars.add_task(name, total=total, count=count, left=_clock(None), first=done)
            self._tasks[name] = self.bars.tasks[-1]
        self.bars.update(self._tasks[name].id, completed=done, total=total, count=count)
        return self._tasks[name]


@contextmanager
def _lines(bars: progress.Progress) -> Iterator[None]:
    """Print a line of progress on standard error every `EVERY` seconds, until the block ends."""
    ended = threading.Event()

    def run() -> None:
        with suppress(OSError, ValueError):  # standard error is closed
            while not ended.wait(EVERY):
                if text := line_of(bars.tasks):
                    print(text, file=sys.stderr, flush=True)

    thread = threading.Thread(target=run, name="lines of progress", daemon=True)
    thread.start()
    try:
        yield
    finally:
        ended.set()
        thread.join()


def line_of(tasks: Iterable[progress.Task]) -> str:
    """Return a line with the progress of the first unfinished stage, or of the last one; empty before any."""
    if not (known := list(tasks)):
        return ""
    task = next((each for each in known if not each.finished), known[-1])
    so_far = _clock(task.get_time() - min(each.start_time or 0.0 for each in known))
    now = f"{program()}: {task.description} {task.fields['count']}"
    left = "" if task.fields["left"] == _clock(None) else f", about {task.fields['left']} left"
    return f"{now}; {so_far} so far{left}"


def _clock(seconds: float | None) -> str:
    return "-:--:--" if seconds is None else str(timedelta(seconds=round(seconds)))
