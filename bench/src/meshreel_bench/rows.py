"""Rows: what was measured, as JSON lines. In -> out: a file <-> a list of rows; points by their key."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from meshreel.errors import InputError

from .locked import locked
from .row_form import CURVE_KINDS, FAILED, problem_of

Row = dict[str, Any]
FIRST = "targets"  # the experiment of rows that do not name theirs


@dataclass(frozen=True, slots=True)
class Point:
    """One thing to measure: a codec at an operating point on a sequence, or its memory."""

    sequence: str
    codec: str
    options: dict[str, Any] = field(default_factory=dict)
    frames: int | None = None  # the first so many; None: all
    # "quality": rate, times, metrics; "curve": rate and metrics only; "floor": quality, and each group against Draco;
    # "backwards": "curve" of the frames in reverse; "memory": peak memory of an encode in a fresh process;
    # "decode": decoding beside the anchor of equal quality; those of `scene_rows.KINDS` are about scenes, and those of
    # `rd_rows.KINDS` alike for all sequences
    kind: str = "quality"

    @property
    def key(self) -> str:
        """Equal for equal points; a row carries it."""
        return json.dumps(asdict(self), sort_keys=True)


def read_rows(path: Path) -> list[Row]:
    """The rows of a JSON-lines file, without one that was not written to its end.

    Raises InputError where the file is missing or a line is no row.
    """
    if path.exists() and not (path.is_file() or path.is_fifo()):  # devices may have no end
        raise InputError(f"{path}: is no file; give one that `meshreel bench run` made")
    try:
        data = path.read_bytes()
        lines = data[: _whole(data)].decode("utf-8-sig").split("\n")  # texts may have other ends of lines
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}; make it with `meshreel bench run`") from error
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: not UTF-8 ({error.reason}); make it with `meshreel bench run`") from error
    rows = []
    for number, line in enumerate(lines, 1):
        if not line.strip():
            continue
        try:
            row = json.loads(line, parse_constant=_not_json)
        except (ValueError, RecursionError) as error:
            told = error.msg if isinstance(error, json.JSONDecodeError) else error
            raise InputError(f"{path}, line {number}: not JSON: {told}; delete that line") from error
        if problem := problem_of(row):
            raise InputError(f"{path}, line {number}: not a row: {problem}; delete that line")
        rows.append(_printable(row) if "\\ud" in line else row)
    return rows


def _printable(row: Row) -> Row:
    """The row with ? for halves of characters, as in names of files: they can be neither written nor drawn."""
    return dict(json.loads(json.dumps(row, ensure_ascii=False).encode(errors="replace")))


def _not_json(found: str) -> float:
    raise ValueError(f"{found} is no number")


def experiment_of(row: Row) -> str:
    """The name of the experiment that a row is of."""
    return str(row.get("experiment", FIRST))


def join_rows(files: Sequence[Sequence[Row]]) -> list[Row]:
    """The rows of several files, each point of an experiment once: the first of a point counts that has not failed."""
    rows = [row for file in files for row in file]
    ordered = measured_rows(rows) + failed_rows(rows)
    joined = {(experiment_of(row), row["point"]): row for row in reversed(ordered)}
    return list(reversed(joined.values()))


def append_row(path: Path, row: Row) -> None:
    """The row as one more line of the file, made if needed, in the place of one that was not written to its end.

    Several processes may do so at once. Raises InputError where it cannot be written.
    """
    line = (json.dumps(row, allow_nan=False) + "\n").encode()
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with path.open("a+b") as file, locked(file):
            file.seek(0)
            data = file.read()
            end = _whole(data)
            file.truncate(end)
            file.write(b"\n" * (end > 0 and data[end - 1 : end] != b"\n") + line)
    except OSError as error:
        raise _not_written(path, error) from None


def check_appendable(path: Path) -> None:
    """Raises InputError where rows could not be written: hours before the first one is there."""
    if path.is_fifo():  # whoever reads rows back from it waits for ever
        raise InputError(f"{path}: is a pipe; rows are kept in a file")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with path.open("r+b") if path.exists() else tempfile.TemporaryFile(dir=path.parent):
            pass
    except OSError as error:
        raise _not_written(path, error) from None


def check_folder(path: Path) -> None:
    """Raises InputError where nothing could be kept in a folder, which is made if needed."""
    try:
        path.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=path) as file:
            file.write(b"0")
    except OSError as error:
        raise _not_written(path, error) from None


def _not_written(path: Path, error: OSError) -> InputError:
    if isinstance(error, (FileExistsError, NotADirectoryError)):
        return InputError(f"{path}: cannot be written (a part of that path is a file); choose another")
    return InputError(f"{path}: cannot be written ({error.strerror or error}); free space, or choose another file")


def _whole(data: bytes) -> int:
    """Where the rows end: a process that is killed while it writes leaves a part of one behind them."""
    start = data.rfind(b"\n") + 1
    try:
        json.loads(data[start:] or b"0")
    except (ValueError, RecursionError):
        return start
    return len(data)


def curve_rows(rows: Sequence[Row], sequence: str, codec: str | None = None) -> list[Row]:
    """The rows of a sequence and, where it is given, of a codec that have a rate and metrics."""
    return [row for kind in CURVE_KINDS for row in select(rows, sequence, codec, kind)]


def select(rows: Sequence[Row], sequence: str, codec: str | None = None, kind: str = "quality") -> list[Row]:
    """The rows of a sequence and, where it is given, of a codec; without those that failed."""
    own = [r for r in rows if r["sequence"] == sequence and codec in (None, r["codec"]) and r["kind"] == kind]
    return measured_rows(own)


def measured_rows(rows: Sequence[Row]) -> list[Row]:
    """Those of which something was measured."""
    return [row for row in rows if FAILED not in row]


def failed_rows(rows: Sequence[Row]) -> list[Row]:
    """Those of which nothing was measured."""
    return [row for row in rows if FAILED in row]
