"""Points measured in processes of their own: who crashes, hangs or returns nonsense costs a row, and not the sweep.

In: points, where their sequence is, a limit. Out: their rows, or some that say why there is none (`FAILED`). Points of
one call have one process, which may share work between them; the one that ends it fails, and the others go on in
another. Sequences that take long to make are made in such a process, too.
"""

from __future__ import annotations

import contextlib
import itertools
import json
import os
import pickle
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import traceback
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import IO

from meshreel.errors import InputError

from .bench import Bench
from .codecs import source_of
from .provenance import made_by
from .row_form import FAILED, problem_of
from .rows import Point, Row
from .said import LONGEST, last_words, one_line
from .timer import ONE_THREAD

_PREFIX = "meshreel-point-"  # of folders for temporary files
_RUNNING: set[subprocess.Popen[bytes]] = set()
_STARTING, _ENDED = threading.Lock(), threading.Event()


def measure_apart(points: Sequence[Point], bench: Bench, rows: Sequence[Row] = ()) -> Iterator[Row]:
    """The rows of some points, each as it is there; a point may take `bench.limit_s`. `rows` are those before them."""
    left, bench = list(points), bench.absolute()
    while left:
        with _process() as (process, said):
            limit = _Limit(process, bench.limit_s)
            try:
                for row in _answers(process, (_measured, left, bench, list(rows))):
                    if wrong := _problem(row, left[0]):
                        limit.reached = wrong
                        break
                    limit.again()
                    yield row if FAILED not in row else failed_row(left[0], bench, row[FAILED])
                    left.pop(0)
                    if not left:
                        break  # and whatever threads it has left do not matter
                else:
                    process.wait()  # by itself: its exit code tells why
            finally:
                limit.stop()
                _end(process)
            if left and _ENDED.is_set():
                raise InterruptedError("the sweep has been ended")
            if left:
                yield failed_row(left.pop(0), bench, limit.reached or last_words(process.returncode, said))


def make_apart(sequence: str, frames: int | None, bench: Bench) -> None:
    """Makes what is kept of a sequence (`open_dataset`). Raises InputError where that is not possible."""
    with _process() as (process, said):
        answers = list(_answers(process, (_made, sequence, frames, bench.absolute())))
        process.wait()
        if _ENDED.is_set():
            raise InterruptedError("the sweep has been ended")
        for answer in answers or [{FAILED: f"{sequence} was not made: {last_words(process.returncode, said)}"}]:
            if FAILED in answer:
                raise InputError(answer[FAILED])


@contextlib.contextmanager
def _process() -> Iterator[tuple[subprocess.Popen[bytes], IO[bytes]]]:
    """A process that waits for its task, and what it says; it has ended afterwards."""
    with tempfile.TemporaryFile() as said, _folder() as folder:
        process = _started(said, folder)
        try:
            yield process, said
        finally:
            _end(process)
            _close(process)
            _RUNNING.discard(process)


def _folder() -> tempfile.TemporaryDirectory[str]:
    """Where a process has its temporary files, which are removed with it, however it ends."""
    return tempfile.TemporaryDirectory(prefix=_PREFIX, ignore_cleanup_errors=True)


def _started(said: IO[bytes], folder: str) -> subprocess.Popen[bytes]:
    """A process that waits for its task. Raises InterruptedError where the sweep has been ended."""
    with _STARTING:
        if _ENDED.is_set():
            raise InterruptedError("the sweep has been ended")
        process = subprocess.Popen(
            [sys.executable, "-m", "meshreel_bench.apart"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=said,
            start_new_session=True,  # with all that it starts it is ended by one signal
            env=os.environ | ONE_THREAD | dict.fromkeys(("TMPDIR", "TEMP", "TMP"), folder),
        )
        _RUNNING.add(process)
    return process


def _answers(process: subprocess.Popen[bytes], task: tuple[object, ...]) -> Iterator[Row]:
    """What a process answers to its task, line by line; not one that it was ended in."""
    assert process.stdin is not None and process.stdout is not None
    with contextlib.suppress(BrokenPipeError):  # it has ended, and said why
        process.stdin.write(pickle.dumps(task))
        process.stdin.flush()  # and it stays open: its end is ours
    lines = itertools.takewhile(lambda line: line.endswith(b"\n"), process.stdout)
    return (_read(line) for line in lines)


def _read(line: bytes) -> Row:
    """One answer; an empty one where it is none."""
    try:
        found = json.loads(line)
    except (ValueError, RecursionError):
        return {}
    return found if isinstance(found, dict) else {}


def _problem(row: Row, point: Point) -> str | None:
    """Why an answer is none of the point that was asked for: codecs may write anywhere. None where it is one."""
    if isinstance(row.get(FAILED), str):
        return None
    if FAILED in row or row.get("point") != point.key:
        return "wrote among the answers of its process"
    wrong = problem_of(row)
    return wrong and f"has no row that can be kept: {wrong}"


class _Limit:
    """Ends a process that gives no row for so long."""

    def __init__(self, process: subprocess.Popen[bytes], seconds: float | None) -> None:
        self.reached: str | None = None
        self._process, self._seconds = process, seconds
        self._timer: threading.Timer | None = None
        self.again()

    def again(self) -> None:
        """A row has come."""
        self.stop()
        if self._seconds is not None:
            self._timer = threading.Timer(min(self._seconds, threading.TIMEOUT_MAX), self._over)
            self._timer.daemon = True
            self._timer.start()

    def stop(self) -> None:
        """No more rows are waited for."""
        if self._timer is not None:
            self._timer.cancel()

    def _over(self) -> None:
        if self._process.poll() is not None:
            return
        self.reached = f"took longer than {self._seconds:g} s of wall time"
        _end(self._process)


def begin() -> None:
    """A new sweep may start processes, also where one before was ended."""
    _ENDED.clear()


def end_all() -> None:
    """Ends what other threads wait for, and lets them start no more: they raise InterruptedError."""
    with _STARTING:
        _ENDED.set()
    for process in list(_RUNNING):
        _end(process)


def _end(process: subprocess.Popen[bytes]) -> None:
    """Ends a process, if it has not ended, and, where the system can, those that it has started and left behind."""
    if hasattr(os, "killpg"):
        with contextlib.suppress(ProcessLookupError, PermissionError):  # it has just ended, and all that it started
            os.killpg(process.pid, signal.SIGKILL)
    else:
        process.kill()
    process.wait()


def _close(process: subprocess.Popen[bytes]) -> None:
    """Closes what is still open to a process that has ended."""
    for pipe in (process.stdin, process.stdout):
        with contextlib.suppress(BrokenPipeError):  # it has not read all that it was told
            if pipe is not None:
                pipe.close()


def failed_row(point: Point, bench: Bench, reason: str) -> Row:
    """The row of a point of which nothing was measured, and why."""
    head: Row = {"point": point.key, "kind": point.kind, "experiment": bench.experiment} | made_by()
    return head | {"sequence": point.sequence, "codec": point.codec, "options": point.options, FAILED: one_line(reason)}


def main() -> None:
    """In the fresh process: a task from standard input, pickled by whoever started it; answers to standard output.

    What libraries print goes where errors go.
    """
    answers = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)
    task, *about = pickle.load(sys.stdin.buffer)
    _end_with_parent()
    for answer in task(*about):
        answers.write(answer + "\n")
        answers.flush()


def _measured(points: Sequence[Point], bench: Bench, before: Sequence[Row]) -> Iterator[str]:
    """The task of `measure_apart`."""
    from .measure import measure_point

    here = Path.cwd()
    for point in points:
        try:
            os.chdir(here)  # where a codec may have left
            yield json.dumps(measure_point(point, bench, before), allow_nan=False)
        except (Exception, SystemExit) as error:  # whatever a codec raises is its row
            yield json.dumps({FAILED: f"{type(error).__name__}: {error}"[:LONGEST] + _where(point.codec, error)})


def _where(codec: str, error: BaseException) -> str:
    """The line of somebody else's codec that an error came by last; empty for ours."""
    own = source_of(codec)
    lines = [
        each for each in traceback.extract_tb(error.__traceback__) if own and Path(each.filename).is_relative_to(own)
    ]
    return f" ({Path(lines[-1].filename).name}, line {lines[-1].lineno})" if lines else ""


def _made(sequence: str, frames: int | None, bench: Bench) -> Iterator[str]:
    """The task of `make_apart`."""
    from .datasets import open_dataset

    try:
        open_dataset(sequence, bench.data, frames, bench.cache, bench.own)
        yield json.dumps({})
    except InputError as error:
        yield json.dumps({FAILED: str(error)})


def _end_with_parent() -> None:
    """Ends this process and those that it starts when standard input does: nobody is left to hear of rows."""
    parent = os.dup(0)
    with Path(os.devnull).open("rb") as nothing:
        os.dup2(nothing.fileno(), 0)  # a codec that asks gets no answer

    def watch() -> None:
        while os.read(parent, 1):
            pass
        if (folder := Path(tempfile.gettempdir())).name.startswith(_PREFIX):  # who would remove it is no more
            shutil.rmtree(folder, ignore_errors=True)
        if hasattr(os, "killpg") and os.getpgrp() == os.getpid():
            os.killpg(os.getpgrp(), signal.SIGKILL)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


if __name__ == "__main__":
    main()
