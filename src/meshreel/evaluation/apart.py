"""Points measured in processes of their own: who crashes, hangs or returns nonsense costs a row, and not the sweep.

In: points, where their sequence is, a limit. Out: their rows, or some that say why there is none (`FAILED`). Points of
one call have one process, which may share work between them; the one that ends it fails, and the others go on in
another.
"""

from __future__ import annotations

import contextlib
import itertools
import json
import os
import pickle
import signal
import subprocess
import sys
import tempfile
import threading
from collections.abc import Iterator, Sequence
from typing import IO

from .bench import Bench
from .provenance import made_by
from .rows import FAILED, Point, Row
from .timer import ONE_THREAD

_LAST = 300  # characters of what a process said last
_RUNNING: set[subprocess.Popen[bytes]] = set()
_STARTING, _ENDED = threading.Lock(), threading.Event()


def measure_apart(points: Sequence[Point], bench: Bench, rows: Sequence[Row] = ()) -> Iterator[Row]:
    """The rows of some points, each as it is there; a point may take `bench.limit_s`. `rows` are those before them."""
    left = list(points)
    while left:
        with tempfile.TemporaryFile() as said:
            process = _started(said)
            limit = _Limit(process, bench.limit_s)
            try:
                for line in _lines(process, (left, bench, list(rows))):
                    limit.again()
                    row = dict(json.loads(line))
                    yield row if FAILED not in row else _failed(left[0], bench, row[FAILED])
                    left.pop(0)
            except BaseException:
                _end(process)
                raise
            finally:
                process.wait()
                limit.stop()
                _RUNNING.discard(process)
            if left and _ENDED.is_set():
                raise InterruptedError("the sweep has been ended")
            if left:
                yield _failed(left.pop(0), bench, limit.reached or _reason(process.returncode, said))


def _started(said: IO[bytes]) -> subprocess.Popen[bytes]:
    """A process that waits for its task. Raises InterruptedError where the sweep has been ended."""
    with _STARTING:
        if _ENDED.is_set():
            raise InterruptedError("the sweep has been ended")
        process = subprocess.Popen(
            [sys.executable, "-m", "meshreel.evaluation.apart"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=said,
            start_new_session=True,  # with all that it starts it is ended by one signal
            env=os.environ | ONE_THREAD,
        )
        _RUNNING.add(process)
    return process


def _lines(process: subprocess.Popen[bytes], task: object) -> Iterator[bytes]:
    """What a process answers to its task, line by line; not one that it was ended in."""
    assert process.stdin is not None and process.stdout is not None
    with contextlib.suppress(BrokenPipeError):  # it has ended, and said why
        process.stdin.write(pickle.dumps(task))
        process.stdin.close()
    yield from itertools.takewhile(lambda line: line.endswith(b"\n"), process.stdout)


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
            self._timer = threading.Timer(self._seconds, self._over)
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
    """Ends a process and, where the system can, those that it has started."""
    if hasattr(os, "killpg"):
        with contextlib.suppress(ProcessLookupError):  # it has just ended
            os.killpg(process.pid, signal.SIGKILL)
    else:
        process.kill()
    process.wait()


def _failed(point: Point, bench: Bench, reason: str) -> Row:
    head: Row = {"point": point.key, "kind": point.kind, "experiment": bench.experiment} | made_by()
    return head | {"sequence": point.sequence, "codec": point.codec, "options": point.options, FAILED: reason}


def _reason(code: int, said: IO[bytes]) -> str:
    said.seek(0)
    lines = said.read().decode(errors="replace").strip().splitlines()
    ended = f"ended by signal {-code}" if code < 0 else f"exit code {code}"
    return f"{ended}: {lines[-1][:_LAST]}" if lines else ended


def main() -> None:
    """In the fresh process: a task from standard input, pickled by whoever started it; rows to standard output.

    What libraries print goes where errors go.
    """
    rows = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)
    from .measure import measure_point

    points, bench, before = pickle.load(sys.stdin.buffer)
    for point in points:
        try:
            row = json.dumps(measure_point(point, bench, before), allow_nan=False)
        except Exception as error:  # whatever a codec raises is its row
            row = json.dumps({FAILED: f"{type(error).__name__}: {error}"[:_LAST]})
        rows.write(row + "\n")
        rows.flush()


if __name__ == "__main__":
    main()
