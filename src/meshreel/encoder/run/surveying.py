"""The survey of a whole sequence: made here or in workers, kept as JSON, and shared by encodes of some of its frames.

In -> out: a job -> the Survey of its sequence; a file of `meshreel survey` -> a SurveyFile. Parts that are encoded from
one survey join without being encoded again (`edit`), whatever machine encoded them.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from ...analysis.survey import Piece, Survey, joined, survey_frames, survey_sequence
from ...errors import InputError
from ...format.checks import LARGEST
from ...geometry.derived_sequences import DerivedSequence
from ...geometry.work import Work, add, passed, since, so_far
from ...io.files import Place, read_input
from ...io.write import write_file
from ...texts import json_of
from .schedule import Call, Job, as_done
from .worker import end_with_parent

KIND = "meshreel survey 2"
SLICE = 32  # frames that a worker surveys at once: some seconds (guess)
_DAMAGED = (KeyError, TypeError, ValueError, OverflowError)  # of a record that no encoder wrote


def survey_job(job: Job, cleaned: bool = True) -> Survey:
    """Survey the sequence of a job, with the errors of `survey_sequence`; an executor's workers read the files."""
    short = getattr(job.executor, "worth", 0) and len(job.sequence) < 2 * SLICE
    if job.executor is None or short or not job.sequence.is_stored:
        return survey_sequence(job.sequence, cleaned)
    count, found = len(job.sequence), dict[int, Survey]()

    def calls() -> Iterator[Call]:
        for start in range(0, count, SLICE):
            numbers = range(start, min(start + SLICE, count))
            yield start, _survey_in_worker, (job.sequence.only(numbers), numbers, cleaned)

    for start, (survey, observed, work) in as_done(job.executor, calls()):
        job.sequence.learn(observed)
        add(work)
        found[start] = survey
        passed("survey", len(survey.diagonals))
    return joined([found[start] for start in sorted(found)])


def _survey_in_worker(sequence: DerivedSequence, numbers: range, cleaned: bool) -> tuple[Survey, Any, Work]:
    """Survey a slice in a worker process; also return what reading has shown, and the work."""
    end_with_parent()
    with threadpool_limits(1):
        before = so_far()
        return survey_frames(sequence, numbers, cleaned), sequence.observed, since(before)


def survey_from_facts(sequence: DerivedSequence, whole: dict[str, Any]) -> Survey | None:
    """Return the survey in the facts of `facts_of`, without reading the frames; None where they may be others.

    Frames that are read later, and differ, raise InputError.
    """
    if whole.get("inputs") is None or whole["inputs"] != _digest_of_inputs(sequence):
        return None
    try:
        survey, digests = _unpacked(whole["survey"]), dict(enumerate(map(str, whole["made"]["surfaces"])))
    except _DAMAGED:
        return None
    if len(survey.diagonals) != len(digests) or any(digests[k] != now for k, now in sequence.observed[0].items()):
        return None  # they are read with other options
    sequence.learn((digests, None))
    return survey


def facts_of(sequence: DerivedSequence, survey: Survey) -> dict[str, Any]:
    """Return the survey of a sequence, and of which files it is, for `survey_from_facts`."""
    return {"inputs": _digest_of_inputs(sequence), "survey": _packed(survey)}


def _digest_of_inputs(sequence: DerivedSequence) -> str | None:
    """Return a digest of the files that frames are made of; None where reading tells more than the frames."""
    if not sequence.files or sequence.observed[1] is not None:
        return None
    found = hashlib.sha256()
    for path in sequence.files:
        with path.open("rb") as file:
            found.update(hashlib.file_digest(file, "sha256").digest())
    return found.hexdigest()


@dataclass(frozen=True, slots=True)
class Excerpt:
    """Frames of a surveyed sequence that become a file of their own."""

    whole: SurveyFile
    frames: range


@dataclass(frozen=True, slots=True)
class SurveyFile:
    """The survey of a whole sequence, and the digest of each of its frames."""

    name: str  # in error messages
    survey: Survey
    about: dict[str, Any]  # number of frames, frame rate, up axis
    digests: list[str]

    def check(self, sequence: DerivedSequence) -> None:
        """Let a sequence refuse frames that are not the surveyed ones. Raises InputError for another sequence."""
        for name, value in _about(sequence).items():
            if self.about[name] != value:
                text = f"{self.name}: is of another sequence: {name} {self.about[name]}, and here {value}"
                raise InputError(f"{text}; give the same inputs, --fps and --up, or survey these")
        sequence.learn((dict(enumerate(self.digests)), None))

    def part(self, number: int, count: int, longest: int) -> Excerpt:
        """Return part `number`, from 1, of `count` parts of about as many intervals of at most `longest` frames.

        Raises InputError where there is no such part.
        """
        if not 1 <= number <= count:
            raise InputError(f"part {number}/{count}: give 1/{count} to {count}/{count}")
        intervals = self.survey.intervals(longest)
        if count > len(intervals):
            text = f"part {number}/{count}: the sequence has {len(intervals)} key intervals"
            raise InputError(f"{text}; give at most as many parts, or a shorter --key-interval")
        ends = [len(intervals) * k // count for k in (number - 1, number)]
        return Excerpt(self, range(intervals[ends[0]].start, intervals[ends[1] - 1].stop))


def write_survey(survey: Survey, sequence: DerivedSequence, path: Path) -> None:
    """Write the survey of a sequence, each frame of which has been read, to a file of JSON."""
    record = {"kind": KIND, **_about(sequence), **_packed(survey), "digests": sequence.digests}
    write_file(path, json.dumps(record).encode())


def read_survey(path: Place) -> SurveyFile:
    """Read the file of a survey. Raises InputError for any other file."""
    data = read_input(path)
    try:
        record = json_of(data)
        if record["kind"] != KIND:
            raise ValueError(record["kind"])
        about, digests = {name: record[name] for name in _ABOUT}, [str(value) for value in record["digests"]]
        survey = _unpacked(record)
        if not len(survey.diagonals) == len(survey.pieces) == len(digests) == about["frames"]:
            raise ValueError("its parts are of different lengths")
        return SurveyFile(str(path), survey, about, digests)
    except _DAMAGED as error:
        text = f"{path}: is no survey that this version of meshreel wrote ({type(error).__name__}: {error})"
        raise InputError(f"{text}; write it again with meshreel survey") from None


_ABOUT = ("frames", "frame_rate", "up")


def _about(sequence: DerivedSequence) -> dict[str, Any]:
    """Return the facts in which a survey must agree with the sequence that it is used for."""
    return dict(zip(_ABOUT, (len(sequence), sequence.frame_rate, sequence.up), strict=True))


def _packed(survey: Survey) -> dict[str, Any]:
    return asdict(survey) | {"low": survey.low.tolist(), "high": survey.high.tolist()}


def _unpacked(record: dict[str, Any]) -> Survey:
    """Return the survey in a record. Raises one of `_DAMAGED` for numbers that are impossible."""
    low, high = (np.array([float(value) for value in record[corner]]) for corner in ("low", "high"))
    scale = None if record["scale"] is None else float(record["scale"])
    diagonals = tuple(float(value) for value in record["diagonals"])
    flattened = tuple(int(number) for number in record["flattened"])
    pieces = tuple(tuple(map(_piece, frame)) for frame in record["pieces"])
    sizes = np.array([*low, *high, *diagonals])
    if not (len(low) == len(high) == 3 and len(pieces) in (0, len(diagonals))):
        raise ValueError("its parts are of different lengths")
    if (
        not (np.abs(sizes) <= LARGEST).all()
        or (low > high).any()
        or min(diagonals, default=-1.0) < 0
        or not (scale is None or 0 < scale <= LARGEST)
    ):
        raise ValueError("its numbers are impossible")
    return Survey(low, high, diagonals, flattened, scale, int(record["dropped"]), pieces)


def _piece(record: Any) -> Piece:
    boxes, vertices = np.array([record["box"], record["around"]], np.float64), int(record["vertices"])
    if boxes.shape != (2, 6) or not (np.abs(boxes) <= LARGEST).all() or vertices < 1:
        raise ValueError(f"a piece {record}")
    if (boxes[:, :3] >= boxes[:, 3:]).all(axis=1).any():
        raise ValueError(f"a piece without extent {record}")
    own, larger = boxes.tolist()
    return Piece(tuple(own), tuple(larger), vertices)
