"""Worker processes of commands, which Ctrl-C in the terminal reaches only through the command itself.

Imports nothing heavy: each worker imports this module before it can heed its parent's end.
"""

from __future__ import annotations

import multiprocessing
import signal
import sys
from collections.abc import Iterator
from concurrent.futures import Executor, ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing.context import SpawnContext, SpawnProcess
from multiprocessing.queues import SimpleQueue

from ..encoder.worker import Told, end_with_parent, tell_to

_BLOCKS = hasattr(signal, "pthread_sigmask")
_DEATH_SIGNAL = 1  # PR_SET_PDEATHSIG of Linux's prctl


@contextmanager
def workers(jobs: int) -> Iterator[Executor | None]:
    """Start processes that encode `jobs` intervals at a time, none for one job; an interrupt ends them at once."""
    if jobs == 1:
        yield None
        return
    executor = _Workers(jobs)
    try:
        yield executor
    except BaseException:
        executor.shutdown(wait=False, cancel_futures=True)
        for child in multiprocessing.active_children():
            child.terminate()
        raise
    executor.shutdown()


class _Workers(ProcessPoolExecutor):
    """Worker processes that tell how far they are."""

    def __init__(self, jobs: int) -> None:
        context = _Context()
        self._queue = context.SimpleQueue()
        super().__init__(jobs, mp_context=context, initializer=_begin, initargs=(self._queue,))

    def told(self) -> Iterator[Told]:
        """Yield what the workers have told since the last call."""
        while not self._queue.empty():
            yield self._queue.get()


class _Process(SpawnProcess):
    """A worker that is deaf to Ctrl-C from its first moment: it inherits that the signal is blocked."""

    def start(self) -> None:
        """Start the process."""
        before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT}) if _BLOCKS else set()
        try:
            super().start()
        finally:
            if _BLOCKS:
                signal.pthread_sigmask(signal.SIG_SETMASK, before)


class _Context(SpawnContext):
    """Spawned, not forked: the progress display and Open3D have threads, which a fork would lose."""

    Process = _Process


def _begin(queue: SimpleQueue[Told]) -> None:
    """Let the parent heed Ctrl-C, and let SIGTERM and the parent's end end a worker without a message."""
    tell_to(queue.put)
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    # At once, too, where a library holds Python's lock. The signal follows the thread that started the worker:
    # here the command's main thread, so it is not for an executor of a caller's own.
    if sys.platform == "linux":
        import ctypes

        ctypes.CDLL(None).prctl(_DEATH_SIGNAL, signal.SIGKILL)
    end_with_parent()
