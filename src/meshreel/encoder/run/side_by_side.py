"""Calls side by side in the workers of an executor, of which few are out at a time, and which end in any order.

In: an executor, calls by number, as they are asked for. Out: their results, as they come.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Executor, Future, wait
from itertools import islice
from typing import Any

AHEAD = 2  # calls for each worker, so that none waits for its next (guess)
UNKNOWN = 8  # workers of an executor that does not say how many it has (guess)
_LOOK = 0.5  # s, between two looks at what workers tell of calls that are not done (guess)

Call = tuple[int, Callable[..., Any], tuple[Any, ...]]  # number, function, arguments


def as_done(
    executor: Executor, calls: Iterable[Call], look: Callable[[], object] | None = None
) -> Iterator[tuple[int, Any]]:
    """Yield number and result of each call as it is done; calls are asked for when a worker is about to be free.

    Where calls fail, raises what the first of them raised, in the order of their numbers. `look` is called now and then
    while there is nothing to yield.
    """
    waiting, running = iter(calls), dict[Future[Any], int]()
    try:
        while True:
            for number, function, arguments in islice(waiting, max(AHEAD * workers_of(executor) - len(running), 0)):
                running[executor.submit(function, *arguments)] = number
            if not running:
                return
            done = wait(running, None if look is None else _LOOK, FIRST_COMPLETED).done
            if look is not None:
                look()
            failed = [running[future] for future in done if future.exception() is not None]
            for future in done:  # first what can be kept
                if future.exception() is None:
                    yield running.pop(future), future.result()
            if failed:  # all calls before one that failed have been submitted
                for future in sorted(running, key=running.__getitem__):
                    if running[future] <= min(failed):
                        future.result()
    finally:
        for future in running:
            future.cancel()


def workers_of(executor: Executor) -> int:
    """Return how many calls an executor can do at a time."""
    count: int | None = getattr(executor, "_max_workers", None)
    if count is None and (client := getattr(executor, "_client", None)) is not None:
        count = sum(client.nthreads().values())  # of a Dask cluster, which may grow
    return count or UNKNOWN
