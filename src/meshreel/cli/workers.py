"""Workers of commands: processes here, which Ctrl-C reaches only through the command itself, or those of a cluster.

Imports nothing heavy: each worker imports this module before it can heed its parent's end.
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
from ..io.read import first_difference

if TYPE_CHECKING:
    from distributed import Client

_BLOCKS = hasattr(signal, "pthread_sigmask")
CONNECTS = 10.0  # s, in which a scheduler answers (guess)


@contextmanager
def workers(jobs: int, cluster: str | None = None) -> Iterator[Executor | None]:
    """Start processes that encode `jobs` intervals at a time, none for one job; an interrupt ends them at once.

    With the address of a Dask scheduler, its workers encode. Raises InputError where jobs are asked for, too.
    """
    if jobs < 1:
        raise InputError(f"--jobs must be at least 1, got {jobs}")
    if cluster is not None:
        if jobs > 1:
            raise InputError(
                f"--jobs {jobs} and --cluster {cluster}: the cluster has workers of its own, give one of both"
            )
        with _cluster(cluster) as executor:
            yield executor
        return
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


@contextmanager
def _cluster(address: str) -> Iterator[Executor]:
    """Connect to a Dask scheduler; an interrupt cancels what its workers still have to do."""
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
        own = installed()
        for worker, theirs in client.run(installed).items():
            if theirs != own:
                text = f"{worker}: is not installed as this machine is: {first_difference(theirs, own)}"
                raise InputError(f"{text} here; bytes would depend on who encodes: install the same versions")
        yield _ClusterWorkers(client)  # what is not done when the client leaves is cancelled


def installed() -> dict[str, Any]:
    """Return the versions on which bytes depend."""
    from ..encoder.group.digests import versions

    return {"meshreel": __version__, "libraries": versions()}


class _ClusterWorkers(Executor):
    """Workers of a Dask cluster.

    Not the client's own executor: it takes a result for an error where the worker dies right after it has sent it.
    """

    def __init__(self, client: Client) -> None:
        self._client = client

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        """Have a worker call a function; a worker that is lost has its call done by another one."""
        future = Future[Any]()
        call = self._client.submit(fn, *args, pure=False, **kwargs)  # what is at a path may change
        future.add_done_callback(lambda done: call.cancel() if done.cancelled() else None)
        call.add_done_callback(partial(_hand_over, future))
        return future


def _hand_over(future: Future[Any], call: Any) -> None:
    """Give the future what the call returned or raised."""
    if not future.set_running_or_notify_cancel():
        return
    try:
        future.set_result(call.result())
    except BaseException as error:
        future.set_exception(error)


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
    die_with_parent()  # the command's main thread, which started it: this is not for an executor of a caller's own
    end_with_parent()
