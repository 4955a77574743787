"""Executors for commands: local processes that ignore SIGINT, or a Dask cluster.

Imports nothing heavy: each worker imports this module before it can react to its parent's end.
"""

from __future__ import annotations

import multiprocessing
import signal
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future, ProcessPoolExecutor
from contextlib import contextmanager
from functools import partial
from multiprocessing.context import SpawnContext, SpawnProcess
from multiprocessing.queues import SimpleQueue
from typing import TYPE_CHECKING, Any

from .. import __version__
from ..encoder.run.worker import Told, die_with_parent, end_with_parent, tell_to
from ..errors import InputError
from ..geometry.threads import cores
from ..io.files import first_difference

if TYPE_CHECKING:
    from distributed import Client

_BLOCKS = hasattr(signal, "pthread_sigmask")
CONNECTS = 10.0  # s, longest time until a scheduler answers (guess)


@contextmanager
def workers(jobs: int | None, cluster: str | None = None) -> Iterator[Executor | None]:
    """Yield processes for `jobs` intervals at a time, which start when they are needed, or a Dask scheduler's.

    None of both for one job; None jobs are as many as there are cores. Raises InputError.
    """
    if jobs is not None and jobs < 1:
        raise InputError(f"--jobs must be at least 1, got {jobs}")
    if cluster is not None:
        if jobs is not None and jobs > 1:
            text = "the cluster has workers of its own, give one of both"
            raise InputError(f"--jobs {jobs} and --cluster {cluster}: {text}")
        with _cluster(cluster) as executor:
            yield executor
        return
    if (count := cores() if jobs is None else jobs) == 1:
        yield None
        return
    executor = _Workers(count)
    try:
        yield executor
    except BaseException:
        executor.shutdown(wait=False, cancel_futures=True)
        for child in multiprocessing.active_children():
            child.terminate()
        raise
    executor.shutdown()


@contextmanager
def _cluster(address: str) -> Iterator[Executor]:
    """Connect to a Dask scheduler; an interrupt cancels the pending calls of its workers."""
    try:
        from distributed import Client
    except ModuleNotFoundError as error:
        raise InputError("--cluster needs the extra `cluster`: pip install 'meshreel[cluster]'") from error
    try:
        connected = Client(address, timeout=CONNECTS)
    except (ValueError, OSError) as error:
        text = f"--cluster {address}: no scheduler answers ({error})"
        raise InputError(f"{text}; start one, or give its address, as tcp://10.0.0.7:8786") from error
    with connected as client:
        local = installed()
        for worker, remote in client.run(installed).items():
            if remote != local:
                text = f"{worker}: is not installed as this machine is: {first_difference(remote, local)}"
                raise InputError(f"{text} here; bytes would depend on who encodes: install the same versions")
        yield _ClusterWorkers(client)  # pending calls are cancelled when the client leaves


def installed() -> dict[str, Any]:
    """Return the versions of libraries on which the bytes of files depend."""
    from ..encoder.group.digests import versions

    return {"meshreel": __version__, "libraries": versions()}


class _ClusterWorkers(Executor):
    """Workers of a Dask cluster. The client's own executor fails if a worker dies after it has sent its result."""

    def __init__(self, client: Client) -> None:
        self._client = client

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        """Let a worker call a function; if the worker is lost, another one repeats the call."""
        future = Future[Any]()
        call = self._client.submit(fn, *args, pure=False, **kwargs)  # the file at a path may change
        future.add_done_callback(lambda done: call.cancel() if done.cancelled() else None)
        call.add_done_callback(partial(_hand_over, future))
        return future


def _hand_over(future: Future[Any], call: Any) -> None:
    """Pass the result or error of a call on to the future."""
    if not future.set_running_or_notify_cancel():
        return
    try:
        future.set_result(call.result())
    except BaseException as error:
        future.set_exception(error)


class _Workers(Executor):
    """Worker processes that report their progress; the first call starts them."""

    worth = 15  # frames of an interval, at least: a process takes 2 s to begin (guess)

    def __init__(self, jobs: int) -> None:
        self._max_workers = jobs
        self._pool: ProcessPoolExecutor | None = None
        self._queue: SimpleQueue[Told] | None = None

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        """Let a process call a function."""
        if self._pool is None:
            context = _Context()
            self._queue = context.SimpleQueue()
            self._pool = ProcessPoolExecutor(self._max_workers, context, _begin, (self._queue,))
        return self._pool.submit(fn, *args, **kwargs)

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """End the processes that were started."""
        if self._pool is not None:
            self._pool.shutdown(wait, cancel_futures=cancel_futures)

    def told(self) -> Iterator[Told]:
        """Yield the workers' reports since the last call."""
        while self._queue is not None and not self._queue.empty():
            yield self._queue.get()


class _DeafProcess(SpawnProcess):
    """Worker process that ignores Ctrl-C from its first moment: it inherits a mask that blocks the signal."""

    def start(self) -> None:
        before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT}) if _BLOCKS else set()
        try:
            super().start()
        finally:
            if _BLOCKS:
                signal.pthread_sigmask(signal.SIG_SETMASK, before)


class _Context(SpawnContext):
    """Context that spawns processes: a fork would lose the threads of the progress display and of Open3D."""

    Process = _DeafProcess


def _begin(queue: SimpleQueue[Told]) -> None:
    """Leave Ctrl-C to the parent, and end the worker silently on SIGTERM or when the parent ends."""
    tell_to(queue.put)
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    die_with_parent()  # the command's main thread, which started it: this is not for an executor of a caller's own
    end_with_parent()
