"""The choice of the recipe: an interval becomes groups by the paper's recipe or by that of layers.

In -> out: an interval, the options of a recipe -> groups, in order. An interval needs no other frames, so that
intervals can be encoded side by side, and those that an earlier run had done are taken from its journal.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace

from threadpoolctl import threadpool_limits

from ..geometry.work import add, since, so_far
from . import layers, paper
from .digests import Digests, note
from .forms import EncodedGroup
from .interval import Interval
from .job import Job
from .options import EncoderOptions, LayersOptions, MethodOptions
from .progress import Stages
from .worker import end_with_parent


def encode_intervals(job: Job, intervals: Iterable[Interval], stages: Stages) -> Iterator[list[EncodedGroup]]:
    """Yield the groups of each interval, in order; with an executor, as many intervals ahead as it has workers.

    Where the job has a journal, the groups are those that it has, or are stored in it.
    """
    ahead = 0 if job.executor is None else getattr(job.executor, "_max_workers", 8)
    waiting: deque[Callable[[], list[EncodedGroup]]] = deque()
    for interval in intervals:
        waiting.append(_begun(job, interval, stages))
        if len(waiting) > ahead:
            yield waiting.popleft()()
    while waiting:
        yield waiting.popleft()()


def _begun(job: Job, interval: Interval, stages: Stages) -> Callable[[], list[EncodedGroup]]:
    """Begin with an interval; return what waits for its groups."""
    method, journal, count = job.options.method, job.journal, len(interval.frames)
    if job.digests is not None:
        interval = replace(interval, digests=Digests(interval.track, interval.first_frame))

    def arrived(groups: list[EncodedGroup]) -> list[EncodedGroup]:
        stages.add("code", count)
        for group in groups:
            add(group.work)
        return groups

    def kept(groups: list[EncodedGroup]) -> list[EncodedGroup]:
        if job.digests is not None:
            job.digests("".join(line for group in groups for line in group.digests))
        return groups if journal is None else journal.keep(interval, groups)

    if journal is not None and (known := journal.take(interval)) is not None:
        return lambda: arrived(known)
    if job.executor is None:
        return lambda: kept(list(encode_interval(interval, method, stages, job.store.find)))
    future = job.executor.submit(encode_apart, interval.in_memory(), method)
    return lambda: kept(arrived(future.result()))


def encode_interval(
    interval: Interval, options: MethodOptions, stages: Stages | None = None, find: paper.FindGroups | None = None
) -> Iterator[EncodedGroup]:
    """Encode an interval as groups, in order, by the recipe whose options are given.

    `find` finds the groups of the paper's recipe; pass a store's `find` to reuse an earlier analysis.
    """
    if isinstance(options, LayersOptions):
        groups = layers.encode_interval(interval, options, stages)
    else:
        groups = iter(paper.encode_interval(interval, options, stages, find))
    for group in groups:
        note(interval.digests, "payload", group.form.name, group.payload)
        yield group if interval.digests is None else replace(group, digests=interval.digests.take())


def encode_apart(interval: Interval, options: MethodOptions) -> list[EncodedGroup]:
    """Encode an interval in a worker process, which ends with its parent; the result can be pickled."""
    end_with_parent()
    with threadpool_limits(1):
        before = so_far()
        *others, last = encode_interval(interval, options)
        return [*others, replace(last, work=since(before))]


def longest_interval(options: EncoderOptions, frame_rate: float) -> int:
    """Return how many frames an interval has at most: a key interval of layers, or one group of the paper's recipe."""
    if isinstance(options.method, LayersOptions):
        return max(1, round(options.key_interval * frame_rate))
    return options.method.group_size
