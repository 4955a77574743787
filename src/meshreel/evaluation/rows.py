"""Rows: what was measured, as JSON lines. In -> out: a file <-> a list of rows; points by their key."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from ..errors import InputError

Row = dict[str, Any]
FAILED = "failed"  # of a row: why nothing was measured
CURVE_KINDS = ("quality", "curve", "floor", "scene", "rated", "sampled")  # rows that have a rate and metrics


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

    Raises InputError where the file is missing or a line is no JSON object.
    """
    try:
        data = path.read_bytes()
        lines = data[: _whole(data)].decode().splitlines()
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}; make it with `meshreel bench run`") from error
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: not UTF-8 ({error.reason}); make it with `meshreel bench run`") from error
    rows = []
    for number, line in enumerate(lines, 1):
        try:
            row = json.loads(line)
        except json.JSONDecodeError as error:
            raise InputError(f"{path}, line {number}: not JSON: {error.msg}; delete that line") from error
        if not isinstance(row, dict) or "point" not in row:
            raise InputError(f"{path}, line {number}: not a row; delete that line")
        rows.append(row)
    return rows


def join_rows(files: Sequence[Sequence[Row]]) -> list[Row]:
    """The rows of several files, each point of an experiment once: the first of a point counts that has not failed."""
    rows = [row for file in files for row in file]
    ordered = measured_rows(rows) + failed_rows(rows)
    joined = {(row.get("experiment", "targets"), row["point"]): row for row in reversed(ordered)}
    return list(reversed(joined.values()))


def append_row(path: Path, row: Row) -> None:
    """The row as one more line of the file, made if needed, in the place of one that was not written to its end.

    Raises InputError where it cannot be written.
    """
    line = (json.dumps(row, allow_nan=False) + "\n").encode()
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with path.open("r+b" if path.exists() else "xb") as file:
            data = file.read() if file.readable() else b""
            end = _whole(data)
            file.seek(end)
            file.truncate()
            file.write(b"\n" * (end > 0 and data[end - 1 : end] != b"\n") + line)
    except OSError as error:
        reason = error.strerror or error
        raise InputError(f"{path}: cannot be written ({reason}); free space, or choose another file") from None


def _whole(data: bytes) -> int:
    """Where the rows end: a process that is killed while it writes leaves a part of one behind them."""
    start = data.rfind(b"\n") + 1
    try:
        json.loads(data[start:] or b"0")
    except ValueError:
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
