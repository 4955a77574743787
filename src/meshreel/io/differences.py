"""The difference between two records of JSON: what an earlier run was made of, and what this one is."""

from __future__ import annotations

import json
from typing import Any


def first_difference(before: Any, now: Any, name: str = "") -> str:
    """Return the first entry in which two records differ, and the beginning of both values."""
    if isinstance(before, dict) and isinstance(now, dict):
        key = next(key for key in {**now, **before} if key not in now or key not in before or before[key] != now[key])
        return first_difference(before.get(key), now.get(key), f"{name}.{key}" if name else key)
    if isinstance(before, list) and isinstance(now, list) and len(before) == len(now):
        number = next(number for number, pair in enumerate(zip(before, now, strict=True)) if pair[0] != pair[1])
        return first_difference(before[number], now[number], f"{name}[{number}]")
    values = [json.dumps(value) for value in (before, now)]
    return f"{name} {values[0]:.60}, now {values[1]:.60}"
