"""Encoding of the intervals of a job, here or side by side in workers, in any order.

In -> out: a job, its intervals -> their groups, in order; those that an earlier run had done come from its journal.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from functools import partial
from typing import Any

from threadpoolctl import threadpool_limits

from ...geometry.work import add, heard, since, so_far
from ..appearance.options import AppearanceOptions
from ..group.digests import Digests
from ..group.forms import EncodedGroup
from ..group.interval import Interval
from ..group.progress import IntervalStages, Stages
from ..recipe import Recipe, encode_interval
from .job import Job
from .side_by_side import Call, as_done
from .worker import end_with_parent, tell


def encode_intervals(job: Job, intervals: Iterable[Interval]) -> Iterator[list[EncodedGroup]]:
    """Yield the groups of each interval, in order; with an executor, its workers encode them in any order.

    Where the job has a journal, the groups are those that it has, or are stored in it as soon as they are there: what
    waits here for an earlier interval has no payloads.
    """
    job.stages.add("code", 0)  # the time that a frame takes is counted from here
    for groups, lines in _one_by_one(job, intervals) if job.executor is None else _side_by_side(job, intervals):
        if job.digests is not None:
            job.digests(lines)
        yield groups


_Done = tuple[list[EncodedGroup], str]  # and lines of digests


def _one_by_one(job: Job, intervals: Iterable[Interval]) -> Iterator[_Done]:
    """Encode intervals here, each when it is asked for."""
    for interval in map(partial(_noting, job), intervals):
        stages = _stages_of(job, interval)
        if (known := _known(job, interval, stages)) is not None:
            yield known, ""
            continue
        with heard(stages.hear):
            groups = list(encode_interval(interval, job.recipe, job.options.appearance, stages))
        yield _kept(job, interval, groups)


def _side_by_side(job: Job, intervals: Iterable[Interval]) -> Iterator[_Done]:
    """Encode intervals in workers: which read their frames themselves, where frames are in files."""
    assert job.executor is not None
    ready, sent, next_one = dict[int, _Done](), dict[int, tuple[Interval, IntervalStages]](), 0
    told = getattr(job.executor, "told", None)  # workers of the command line tell of each frame

    def calls() -> Iterator[Call]:
        for number, interval in enumerate(map(partial(_noting, job), intervals)):
            stages = _stages_of(job, interval)
            if (known := _known(job, interval, stages)) is not None:
                ready[number] = known, ""
                continue
            sent[number] = interval, stages
            yield number, encode_sent, (interval.to_send(), job.recipe, job.options.appearance, number)

    def look() -> None:
        for number, stage, done in told() if told is not None else ():
            if number in sent:
                sent[number][1].reach_frame(stage, done)

    for number, (groups, observed) in as_done(job.executor, calls(), None if told is None else look):
        interval, stages = sent.pop(number)
        interval.learn(observed)
        stages.reach("code", 1.0)
        for group in groups:
            add(group.work)
        ready[number] = _kept(job, interval, groups)
        while next_one in ready:
            yield ready.pop(next_one)
            next_one += 1
    yield from (ready[number] for number in sorted(ready))


def _noting(job: Job, interval: Interval) -> Interval:
    """Return the interval with what collects its digests, where they are wanted."""
    if job.digests is None:
        return interval
    return replace(interval, digests=Digests(interval.track, interval.first_frame))


def _stages_of(job: Job, interval: Interval) -> IntervalStages:
    return IntervalStages(job.stages, len(interval.frames), job.recipe.group_size, interval.weight)


def _known(job: Job, interval: Interval, stages: IntervalStages) -> list[EncodedGroup] | None:
    """Return the groups of an interval from the journal of an earlier run, None where it has them not."""
    known = None if job.journal is None else job.journal.take(interval)
    if known is not None:
        stages.reach("code", 1.0)
    return known


def _kept(job: Job, interval: Interval, groups: list[EncodedGroup]) -> _Done:
    """Store the groups of an interval where there is a journal; return them and their lines of digests."""
    lines = "".join(line for group in groups for line in group.digests)
    return groups if job.journal is None else job.journal.keep(interval, groups), lines


def encode_sent(
    interval: Interval, recipe: Recipe, appearance: AppearanceOptions | None, number: int
) -> tuple[list[EncodedGroup], Any]:
    """Encode an interval in a worker process, which ends with its parent; the result can be pickled.

    Return the groups, and what reading the frames has shown.
    """
    end_with_parent()
    count = len(interval.frames)
    stages = IntervalStages(Stages(partial(tell, number), count), count, recipe.group_size)
    with threadpool_limits(1), heard(stages.hear):
        before = so_far()
        *others, last = encode_interval(interval, recipe, appearance, stages)
        return [*others, replace(last, work=since(before))], interval.observed
