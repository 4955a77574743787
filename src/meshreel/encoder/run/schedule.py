"""Encoding job, and the encoding of its intervals: here, or side by side in workers, in any order.

In -> out: a job, its intervals -> their groups, in order; those that an earlier run had done come from their files.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Executor, Future, wait
from dataclasses import dataclass, replace
from functools import partial
from itertools import chain, islice
from typing import Any

from threadpoolctl import threadpool_limits

from ...format.layout import Header
from ...geometry.derived_sequences import DerivedSequence
from ...geometry.threads import ahead, threads
from ...geometry.work import Work, add, reporting, since, so_far
from ...types import evenly
from ..appearance.colors import colored_groups, has_pictures
from ..appearance.videos import AppearanceOptions
from ..group.digests import listener, note, noted
from ..group.forms import EncodedGroup
from ..group.interval import Interval
from ..group.progress import IntervalStages, Stages
from ..settings.options import EncoderOptions, Recipe, SceneOptions
from .interval_files import IntervalFiles, pack_interval
from .judge import judged
from .worker import end_with_parent, tell

BESIDE = 2  # intervals in one process: each holds its frames in memory (guess)
AHEAD = 2  # calls for each worker, so that none waits for its next (guess)
UNKNOWN = 8  # workers of an executor that does not say how many it has (guess)
_LOOK = 0.5  # s, between two looks at what workers tell of calls that are not done (guess)

Call = tuple[int, Callable[..., Any], tuple[Any, ...]]  # number, function, arguments
_Done = tuple[list[EncodedGroup], str]  # and lines of digests
LOOKED_AT = 3  # frames of an interval whose textures tell whether it has some (guess)
NEUTRAL = Header(1.0, (0.0, 0.0, 0.0), 1.0, (-1.0, -1.0, -1.0), (1.0, 1.0, 1.0), '{"encode":""}')  # in normalised units


@dataclass(frozen=True, slots=True)
class Job:
    """A sequence to encode, its options, and the means to do it."""

    sequence: DerivedSequence
    options: EncoderOptions
    executor: Executor | None
    stages: Stages
    recipe: Recipe
    files: IntervalFiles | None = None  # of the output, which the encoding of intervals needs
    head: Header = NEUTRAL  # of the files of intervals
    chosen: range | None = None  # the frames that are encoded; None: all
    cores: int = 1  # that a worker process may use

    @property
    def scene(self) -> SceneOptions:
        """The options of a scene, where the sequence is one."""
        assert self.options.scene is not None, "a sequence without scene options is not taken apart"
        return self.options.scene


@dataclass(frozen=True, slots=True)
class Task:
    """An interval to encode, here or in a worker process."""

    interval: Interval
    recipe: Recipe
    appearance: AppearanceOptions | None
    head: Header  # of its file
    noting: bool  # digests are wanted
    threads: int = 1  # of a worker process

    def done(self, stages: IntervalStages) -> tuple[bytes, str]:
        """Encode the interval; return its file and its lines of digests."""
        interval, lines = self.interval, list[str]()
        noting = noted(lines.append if self.noting else None, track=interval.track, frame=interval.first_frame)
        with reporting(stages.passed), noting:
            groups = list(encode_interval(interval, self.recipe, self.appearance))
        stages.end()
        return pack_interval(interval, groups, self.head), "".join(lines)


def encode_intervals(job: Job, intervals: Iterable[Interval]) -> Iterator[list[EncodedGroup]]:
    """Yield the groups of each interval, in order; with an executor, its workers encode them in any order.

    An interval that has a file is not encoded again, and others get one as soon as they are done: what waits here for
    an earlier interval has no payloads. An executor's `worth` is the least number of frames for which a worker pays:
    few or short intervals are encoded here, then, where threads share what was read.
    """
    intervals, encode = iter(intervals), _one_by_one if job.executor is None else _side_by_side
    if job.executor is not None and (worth := getattr(job.executor, "worth", 0)):
        count = workers_of(job.executor)
        first = list(islice(intervals, count))
        intervals = chain(first, intervals)
        if len(first) < 2 or sum(len(interval.frames) for interval in first) < worth * len(first):
            encode = _one_by_one
        job = replace(job, cores=count // max(1, len(first)))
    assert job.files is not None
    for groups, lines in encode(job, job.files, intervals):
        if lines and (write := listener()) is not None:
            write(lines)
        yield groups


def _one_by_one(job: Job, files: IntervalFiles, intervals: Iterable[Interval]) -> Iterator[_Done]:
    """Encode intervals here, a few at a time: bodies of the same frames share what was read."""

    def encoded(interval: Interval) -> _Done:
        stages, known = _begun(job, files, interval)
        if known is not None:
            return known, ""
        data, lines = _task(job, interval).done(stages)
        return files.keep(interval, data), lines

    return ahead(encoded, intervals, BESIDE)


def _side_by_side(job: Job, files: IntervalFiles, intervals: Iterable[Interval]) -> Iterator[_Done]:
    """Encode intervals in worker processes; workers read file-backed frames themselves."""
    assert job.executor is not None
    ready, sent, next_one = dict[int, _Done](), dict[int, tuple[Interval, IntervalStages]](), 0
    told = getattr(job.executor, "told", None)  # workers of the command line tell of each frame

    def calls() -> Iterator[Call]:
        for number, interval in enumerate(intervals):
            stages, known = _begun(job, files, interval)
            if known is not None:
                ready[number] = known, ""
                continue
            sent[number] = interval, stages
            yield number, encode_sent, (_task(job, interval.to_send()), number)

    def look() -> None:
        for number, stage, count in told() if told is not None else ():
            if number in sent:
                stages = sent[number][1]
                stages.reach(stage, stages.reached[stage] + count)

    for number, (data, lines, observed, work) in as_done(job.executor, calls(), None if told is None else look):
        interval, stages = sent.pop(number)
        interval.learn(observed)
        stages.end()
        add(work)
        ready[number] = files.keep(interval, data), lines
        while next_one in ready:
            yield ready.pop(next_one)
            next_one += 1
    yield from (ready[number] for number in sorted(ready))


def encode_interval(
    interval: Interval, recipe: Recipe, appearance: AppearanceOptions | None = None
) -> Iterator[EncodedGroup]:
    """Yield the groups of an interval, in order, with colours by `appearance`; None leaves colours out."""
    count = len(interval.frames)
    sample = (interval.frames[number] for number in evenly(count, LOOKED_AT))
    splats = appearance is not None and appearance.splats is not None
    interval = replace(interval, pictured=splats or has_pictures(interval, sample, appearance))
    for group in colored_groups(judged(interval, recipe), interval, appearance):
        note("payload", group.form.name, group.payload, *(one.read() for one in group.companions))
        yield group


def _task(job: Job, interval: Interval) -> Task:
    return Task(interval, job.recipe, job.options.appearance, job.head, listener() is not None, job.cores)


def _begun(job: Job, files: IntervalFiles, interval: Interval) -> tuple[IntervalStages, list[EncodedGroup] | None]:
    """Return the progress of an interval, and its groups if an earlier run encoded it."""
    stages = IntervalStages(job.stages.passed, len(interval.frames), job.recipe.options.group_size, interval.weight)
    known = files.take(interval, job.head)
    if known is not None:
        job.stages.skip(len(interval.frames) * interval.weight)
    return stages, known


def encode_sent(task: Task, number: int) -> tuple[bytes, str, Any, Work]:
    """Do a task in a worker process, which ends with its parent.

    Return what the task returns, what reading the frames has shown, and the work.
    """
    end_with_parent()
    count = len(task.interval.frames)
    stages = IntervalStages(partial(tell, number), count, task.recipe.options.group_size)
    with threadpool_limits(1), threads(task.threads):
        before = so_far()
        data, lines = task.done(stages)
        return data, lines, task.interval.observed, since(before)


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
