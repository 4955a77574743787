"""Calls side by side in the threads of a process: cameras of a frame, frames of a group, bodies of a scene.

In: a function and its arguments. Out: its results, in the order of the arguments, so that they are the same with any
number of threads. The core gives up Python's lock while it works. A thread that waits for calls does some of them
itself: calls may be side by side within calls.
"""

from __future__ import annotations

import os
import sys
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sized
from concurrent.futures import Future, ThreadPoolExecutor, wait
from contextlib import ExitStack, contextmanager
from contextvars import ContextVar, copy_context
from functools import partial
from itertools import islice
from pathlib import Path
from threading import Lock
from typing import Any, TypeVar

from . import work

_T = TypeVar("_T")
_QUOTA = "/sys/fs/cgroup/cpu.max"  # of a container: microseconds of work a period, or "max", and the period


class _Pool(ThreadPoolExecutor):
    """Threads beside one that waits for calls."""

    def __init__(self, count: int) -> None:
        super().__init__(count)
        self.count = count


_pool = ContextVar[_Pool | None]("threads beside this one", default=None)


def cores() -> int:
    """Return the number of cores that this process may use: those that it is bound to, within a container's share."""
    count = len(os.sched_getaffinity(0)) if sys.platform == "linux" else os.cpu_count() or 1
    try:
        quota, period = Path(_QUOTA).read_text(encoding="ascii").split()
        return max(1, min(count, round(int(quota) / int(period))))
    except (OSError, ValueError):  # no container, or one without a limit
        return count


@contextmanager
def threads(count: int) -> Iterator[None]:
    """Let calls of `mapped` in the block use so many threads, this one included."""
    with ExitStack() as stack:
        token = _pool.set(stack.enter_context(_Pool(count - 1)) if count > 1 else None)
        try:
            yield
        finally:
            _pool.reset(token)


def mapped(function: Callable[..., _T], *arguments: Iterable[Any]) -> list[_T]:
    """Return the results of calls; raises what the first that fails raises, ValueError for arguments of unlike lengths.

    The work of calls in other threads is counted here.
    """
    return mapped_until(lambda _: False, function, *arguments)


def ahead(function: Callable[[Any], _T], arguments: Iterable[Any], most: int = 1 << 20) -> Iterator[_T]:
    """Yield the results of calls in order; other threads compute the next ones while a result is used.

    At most `most` results, and no more than there are threads, are in memory.
    """
    pool, waiting, begun = _pool.get(), iter(arguments), deque[_CallAhead]()
    together = 1 if pool is None else min(1 + pool.count, most)

    def begin(count: int) -> None:
        for argument in islice(waiting, count - len(begun)):
            begun.append(_CallAhead(function, argument, pool if together > 1 else None))

    try:
        begin(together)
        while begun:
            for call in begun:  # those that no other thread has taken, while one of these does the first
                if begun[0].is_done:
                    break
                call.take()
            result = begun.popleft().found()
            begin(together - 1)  # the one that is used counts, too
            yield result
            begin(together)
    finally:
        wait([beside for call in begun if (beside := call.beside) is not None and not beside.cancel()])


def mapped_until(enough: Callable[[_T], bool], function: Callable[..., _T], *arguments: Iterable[Any]) -> list[_T]:
    """Return the results of calls up to the first that is enough; other threads may do later ones in vain."""
    if len({len(each) for each in arguments if isinstance(each, Sized)}) > 1:  # beside `repeat`
        raise ValueError("arguments of different lengths")
    calls, pool = list(zip(*arguments, strict=False)), _pool.get()
    shared = _Calls(function, calls, enough)
    count = 0 if pool is None else min(pool.count, len(calls) - 1)
    beside = [pool.submit(copy_context().run, shared.help) for _ in range(count) if pool is not None]
    try:
        shared.do()
    finally:
        shared.stop()
        wait([future for future in beside if not future.cancel()])
    for done in shared.helped:
        work.add(done)
    return shared.found()


def _counted(call: Callable[[], _T], reporter: work.Reporter | None) -> tuple[_T, work.Work]:
    """Return the result of a call in another thread, which reports as the first does, and the work that it took."""
    before = work.so_far()
    with work.reporting_by(reporter):
        return call(), work.since(before)


class _CallAhead:
    """A call that another thread does, or the one that needs its result; its work is counted in the latter."""

    def __init__(self, function: Callable[[Any], Any], argument: Any, pool: _Pool | None) -> None:
        self._call, self._reporter = partial(function, argument), work.reporter()
        self._own = Future[Any]()
        self.beside = None if pool is None else pool.submit(copy_context().run, self._help)

    @property
    def is_done(self) -> bool:
        return self._own.done() or (self.beside is not None and self.beside.done())

    def take(self) -> None:
        """Do the call here unless another thread has begun it."""
        if self.is_done or not (self.beside is None or self.beside.cancel()):
            return
        try:
            self._own.set_result(self._call())
        except Exception as error:  # raised in its turn; what stops the program is raised at once
            self._own.set_exception(error)

    def found(self) -> Any:
        """Return the result, or raise the error, of the call."""
        if self._own.done() or self.beside is None:
            return self._own.result()
        result, done = self.beside.result()
        work.add(done)
        return result

    def _help(self) -> tuple[Any, work.Work]:
        return _counted(self._call, self._reporter)


class _Calls:
    """Calls that several threads take one after another."""

    def __init__(
        self, function: Callable[..., Any], calls: list[tuple[Any, ...]], enough: Callable[[Any], bool]
    ) -> None:
        self._function, self._calls, self._enough = function, calls, enough
        self._next, self._lock = 0, Lock()
        self._results, self._errors = dict[int, Any](), dict[int, BaseException]()
        self.helped, self._reporter = list[work.Work](), work.reporter()

    def help(self) -> None:
        """Do calls in another thread, which reports its work as the first does, and remember that work."""
        self.helped.append(_counted(self.do, self._reporter)[1])

    def do(self) -> None:
        """Do calls until none is left, one has failed, or one is enough: those before it have begun then."""
        while (number := self._take()) is not None:
            try:
                found = self._results[number] = self._function(*self._calls[number])
                if self._enough(found):
                    self.stop()
            except BaseException as error:  # which the thread that waits raises
                self._errors[number] = error
                self.stop()
                if not isinstance(error, Exception):  # what stops the program does so at once
                    raise

    def stop(self) -> None:
        """Let no thread begin another call."""
        with self._lock:
            self._next = len(self._calls)

    def found(self) -> list[Any]:
        """Return the results in order, up to the first that is enough; raises the error of a call before that."""
        results = list[Any]()
        for number in range(len(self._calls)):
            if number in self._errors:
                raise self._errors[number]
            results.append(self._results[number])
            if self._enough(results[-1]):
                break
        return results

    def _take(self) -> int | None:
        with self._lock:
            number = self._next
            if number == len(self._calls):
                return None
            self._next += 1
            return number
