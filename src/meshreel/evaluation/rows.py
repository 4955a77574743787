"""Rows: what was measured, as JSON lines. In -> out: a file <-> a list of rows; points by their key."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from ..errors import InputError

Row = dict[str, Any]


@dataclass(frozen=True, slots=True)
class Point:
    """One thing to measure: a codec at an operating point on a sequence, or its memory."""

    sequence: str
    codec: str
    options: dict[str, Any] = field(default_factory=dict)
    frames: int | None = None  # the first so many; None: all
    kind: str = "quality"  # "quality": rate, times, metrics; "memory": peak memory of an encode in a fresh process

    @property
    def key(self) -> str:
        """Equal for equal points; a row carries it."""
        return json.dumps(asdict(self), sort_keys=True)


def read_rows(path: Path) -> list[Row]:
    """The rows of a JSON-lines file. Raises InputError where it is missing or a line is no JSON object."""
    try:
        lines = path.read_text().splitlines()
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}; make it with `meshreel bench run`") from error
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


def append_row(path: Path, row: Row) -> None:
    """The row as one more line of the file, made if needed."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("a") as file:
        file.write(json.dumps(row, allow_nan=False) + "\n")


def select(rows: Sequence[Row], sequence: str, codec: str | None = None, kind: str = "quality") -> list[Row]:
    """The rows of a sequence and, where it is given, of a codec."""
    return [r for r in rows if r["sequence"] == sequence and codec in (None, r["codec"]) and r["kind"] == kind]
