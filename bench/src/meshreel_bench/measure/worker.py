"""Functions in a fresh process, with a time limit: a crash, an error or an endless loop costs its caller an exception.

It has one thread for numerical libraries, so that times can be compared, and ends with its parent.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import suppress
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from typing import Any

from meshreel.encoder.run.worker import end_with_parent

_SPAWN = multiprocessing.get_context("spawn")  # a forked process would have what its parent has in memory
_ONE_THREAD = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
_LONGEST = 300  # characters of an error's text
_LIVE: set[BaseProcess] = set()


class WorkerError(Exception):
    """Failure of a measuring process."""


def in_fresh_process(task: Callable[..., Iterator[Any]], *about: object, limit_s: float | None = None) -> Iterator[Any]:
    """Run `task(*about)` in a fresh process, and yield its items. WorkerError after `limit_s`, an error, an end."""
    os.environ.update(_ONE_THREAD)  # of processes that start from now on: libraries here have read theirs
    here, there = _SPAWN.Pipe(duplex=False)
    process = _SPAWN.Process(target=_answer, args=(there, task, about))
    process.start()
    _LIVE.add(process)
    there.close()
    try:
        while (value := _received(here, process, limit_s)) is not None:
            yield value[0]
    finally:
        _end(process)
        process.join()
        _LIVE.discard(process)
        here.close()


def end_all() -> None:
    """End all processes that other threads wait for."""
    for process in list(_LIVE):
        _end(process)


def _end(process: BaseProcess) -> None:
    """End a process that nobody has joined, and those that it has started, but for those that left its group."""
    if sys.platform != "win32" and process.pid:
        with suppress(ProcessLookupError, PermissionError):  # it ended before it had a group
            os.killpg(process.pid, signal.SIGKILL)
    process.kill()


def _received(here: Connection, process: BaseProcess, limit_s: float | None) -> tuple[Any] | None:
    """Return the next value; None after the last one."""
    if not here.poll(limit_s):
        raise WorkerError(f"took longer than {limit_s:g} s of wall time")
    try:
        kind, value = here.recv()
    except EOFError:
        process.join()
        code = process.exitcode or 0
        ended = f"signal {signal.Signals(-code).name}" if code < 0 else f"exit code {code}"
        raise WorkerError(f"its process ended by {ended}") from None
    if kind == "error":
        raise WorkerError(value)
    return (value,) if kind == "value" else None


def _answer(there: Connection, task: Callable[..., Iterator[Any]], about: tuple[object, ...]) -> None:
    """Run the task in the fresh process; its standard output goes to standard error."""
    os.dup2(2, 1)
    if sys.platform != "win32":
        os.setsid()  # what a codec starts is ended with it
    end_with_parent()
    try:
        for value in task(*about):
            there.send(("value", value))
        there.send(("end", None))
    except (Exception, SystemExit) as error:  # a codec may raise anything
        reason = str(error) if isinstance(error, WorkerError) else f"{type(error).__name__}: {error}"
        there.send(("error", " ".join(reason.split())[:_LONGEST]))
    there.close()
    os._exit(0)  # threads that a codec has left do not matter
