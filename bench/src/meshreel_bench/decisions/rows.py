"""Rows that docs/decisions rests on: a line of JSON each."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

Row = dict[str, Any]


def read(file: Path) -> list[Row]:
    """Return all rows of a file."""
    return [json.loads(line) for line in file.read_text(encoding="utf-8").splitlines()]
