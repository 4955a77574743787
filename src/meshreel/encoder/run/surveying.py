"""The survey of a job's sequence: in workers, slice by slice, where frames are in files; else here.

In -> out: a job -> the Survey of its sequence, the same either way.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from threadpoolctl import threadpool_limits

from ...analysis.survey import Survey, joined, survey, survey_of
from ...geometry.derived_sequences import DerivedSequence
from ...geometry.work import Work, add, since, so_far
from .job import Job
from .side_by_side import Call, as_done
from .worker import end_with_parent

SLICE = 32  # frames that a worker surveys at once: some seconds (guess)


def surveyed(job: Job, cleaned: bool = True) -> Survey:
    """Survey the sequence of a job as `survey` does, with its errors; with an executor, workers read the files."""
    if job.executor is None or not job.sequence.is_stored:
        return survey(job.sequence, job.stages.add, cleaned)
    count, found = len(job.sequence), dict[int, Survey]()

    def calls() -> Iterator[Call]:
        for start in range(0, count, SLICE):
            numbers = range(start, min(start + SLICE, count))
            yield start, _survey_apart, (job.sequence.only(numbers), numbers, cleaned)

    for start, (seen, observed, work) in as_done(job.executor, calls()):
        job.sequence.learn(observed)
        add(work)
        found[start] = seen
        job.stages.add("survey", len(seen.diagonals))
    return joined([found[start] for start in sorted(found)])


def _survey_apart(sequence: DerivedSequence, numbers: range, cleaned: bool) -> tuple[Survey, Any, Work]:
    """Survey a slice in a worker process; also return what reading has shown, and the work."""
    end_with_parent()
    with threadpool_limits(1):
        before = so_far()
        seen = survey_of(sequence, numbers, cleaned=cleaned)
        return seen, sequence.observed, since(before)
