"""Excerpts: frames of a surveyed sequence that are encoded as a part of its file, and the file of its survey.

In: a survey, or a file that has one. Out: an Excerpt. Parts that are encoded from one survey join without being encoded
again (`encoder.edit`), whatever machine encoded them.
"""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ...analysis.pieces import Piece
from ...analysis.survey import Survey
from ...errors import InputError
from ...format.checks import LARGEST
from ...geometry.derived_sequences import DerivedSequence
from ...io.read import read_input
from ...io.remote import Place
from ...io.write import replacing

KIND = "meshreel survey 2"


@dataclass(frozen=True, slots=True)
class Surveyed:
    """The survey of a whole sequence, and the digest of each of its frames."""

    name: str  # in error messages
    seen: Survey
    about: dict[str, Any]  # number of frames, frame rate, up axis
    digests: list[str]

    def check(self, sequence: DerivedSequence) -> None:
        """Let a sequence refuse frames that are not the surveyed ones. Raises InputError for another sequence."""
        for name, value in about(sequence).items():
            if self.about[name] != value:
                text = f"{self.name}: is of another sequence: {name} {self.about[name]}, and here {value}"
                raise InputError(f"{text}; give the same inputs, or survey these")
        sequence.learn((dict(enumerate(self.digests)), None))


@dataclass(frozen=True, slots=True)
class Excerpt:
    """Frames of a surveyed sequence that become a file of their own."""

    surveyed: Surveyed
    frames: range

    def of(self, intervals: list[range]) -> list[range]:
        """Return the intervals of the whole sequence as far as these frames go."""
        cut = (range(max(some.start, self.frames.start), min(some.stop, self.frames.stop)) for some in intervals)
        return [some for some in cut if len(some)]


def part_of(intervals: list[range], number: int, count: int) -> range:
    """Return the frames of part `number`, from 1, of `count` parts of about as many intervals.

    Raises InputError where there is no such part.
    """
    if not 1 <= number <= count:
        raise InputError(f"part {number}/{count}: give 1/{count} to {count}/{count}")
    if count > len(intervals):
        text = f"part {number}/{count}: the sequence has {len(intervals)} key intervals"
        raise InputError(f"{text}; give at most as many parts, or a shorter --key-interval")
    ends = [len(intervals) * k // count for k in (number - 1, number)]
    return range(intervals[ends[0]].start, intervals[ends[1] - 1].stop)


def about(sequence: DerivedSequence) -> dict[str, Any]:
    """Return the facts in which a survey must agree with the sequence that it is used for."""
    return {"frames": len(sequence), "frame_rate": sequence.frame_rate, "up": sequence.up}


def write_survey(seen: Survey, sequence: DerivedSequence, path: Path) -> None:
    """Write the survey of a sequence, each frame of which has been read, to a file of JSON."""
    facts = asdict(seen) | {"low": seen.low.tolist(), "high": seen.high.tolist()}
    record = {"kind": KIND, **about(sequence), **facts, "digests": sequence.digests}
    with replacing(path) as file:
        file.write(json.dumps(record).encode())


def read_survey(path: Place) -> Surveyed:
    """Read the file of a survey. Raises InputError for any other file."""
    data = read_input(path)
    try:
        return _surveyed(str(path), json.loads(data))
    except (KeyError, TypeError, ValueError, OverflowError, RecursionError) as error:
        text = f"{path}: is no survey that this version of meshreel wrote ({type(error).__name__}: {error})"
        raise InputError(f"{text}; write it again with meshreel survey") from None


def _surveyed(name: str, record: Any) -> Surveyed:
    if record["kind"] != KIND:
        raise ValueError(record["kind"])
    low, high = (np.array([float(value) for value in record[corner]]) for corner in ("low", "high"))
    scale = None if record["scale"] is None else float(record["scale"])
    diagonals = tuple(float(value) for value in record["diagonals"])
    flattened = tuple(int(number) for number in record["flattened"])
    facts = {name: record[name] for name in ("frames", "frame_rate", "up")}
    digests = [str(value) for value in record["digests"]]
    pieces = tuple(tuple(map(_piece, frame)) for frame in record["pieces"])
    sizes = np.array([*low, *high, *diagonals])
    if not (len(low) == len(high) == 3 and len(diagonals) == len(digests) == len(pieces) == facts["frames"]):
        raise ValueError("its parts are of different lengths")
    if not (np.abs(sizes) <= LARGEST).all() or (low > high).any() or min(diagonals, default=-1.0) < 0:
        raise ValueError("its numbers are impossible")
    seen = Survey(low, high, diagonals, flattened, scale, int(record["dropped"]), pieces)
    return Surveyed(name, seen, facts, digests)


def _piece(record: Any) -> Piece:
    boxes, vertices = np.array([record["box"], record["around"]], np.float64), int(record["vertices"])
    if boxes.shape != (2, 6) or not (np.abs(boxes) <= LARGEST).all() or vertices < 1:
        raise ValueError(f"a piece {record}")
    if (boxes[:, :3] >= boxes[:, 3:]).all(axis=1).any():
        raise ValueError(f"a piece without extent {record}")
    own, larger = boxes.tolist()
    return Piece(tuple(own), tuple(larger), vertices)
