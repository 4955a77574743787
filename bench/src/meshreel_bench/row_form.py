"""What a row looks like, so that pages and plots can take its values as they are. In -> out: anything -> what is wrong.

Every field but texts, objects and lists is a number or, where nothing is known, null. Numbers are finite and, but for
decibels and SSIM, not below 0: whoever has edited rows, or made them elsewhere, hears of it before a page is made.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

FAILED = "failed"  # of a row: why nothing was measured
UNPICTURED = "unpictured"  # of a row: why it has no pictures
CURVE_KINDS = ("quality", "curve", "floor", "scene", "rated", "sampled")  # rows that have a rate and metrics
REQUIRED = ("point", "kind", "sequence", "codec", "options")  # of every row, whether it failed or not
LARGEST = 1e30  # of any number: nothing that is measured comes near, and squares of it are floats still

_TEXTS = ("point", "kind", "sequence", "codec", "experiment", "source", "codec_version", FAILED, UNPICTURED)
_ANY_OBJECTS = ("options", "made_by", "machine", "pictures")
_NUMBER_OBJECTS = ("decode", "encode_stages_s", "peer", "anchor")
_NUMBER_LISTS = ("bridges", "degenerate_faces", "key_frames", "measured_frames")
_OBJECT_LISTS = ("groups", "per_frame")
_INSIDE = ("options", "first_frame_sha256", "form")  # of objects of numbers: what is none
_SIGNED = ("psnr", "ssim")  # in the names of numbers that may be below 0

Problem = str | None


def problem_of(row: object) -> Problem:
    """Why something is no row; None where it is one."""
    if not isinstance(row, dict):
        return "no JSON object"
    if missing := [key for key in REQUIRED if key not in row]:
        return f"{missing[0]!r} is missing"
    found = (_field_problem(key, value) for key, value in row.items() if key != "cameras")
    return next(filter(None, found), None) or _curve_problem(row)


def _field_problem(key: str, value: object) -> Problem:
    told = f"{key!r} is {repr(value)[:60]}, and not"
    if key in _TEXTS:
        return None if isinstance(value, str) else f"{told} a text"
    if key in (*_ANY_OBJECTS, *_NUMBER_OBJECTS):
        if value is None and key == "peer":  # DracoPy had nothing to decode
            return None
        if not isinstance(value, dict):
            return f"{told} a JSON object"
        return _inside(key, value) if key in _NUMBER_OBJECTS else None
    if key in (*_NUMBER_LISTS, *_OBJECT_LISTS):
        if not isinstance(value, list):
            return f"{told} a list"
        check: Callable[[str, Any], Problem] = _number_problem if key in _NUMBER_LISTS else _object_problem
        return next(filter(None, (check(f"{key}[{at}]", each) for at, each in enumerate(value))), None)
    return None if value is None else _number_problem(key, value)


def _object_problem(name: str, value: object) -> Problem:
    """Of one of `groups` or `per_frame`."""
    if not isinstance(value, dict):
        return f"{name!r} is {repr(value)[:60]}, and not a JSON object"
    if name.startswith("groups") and (lacking := [key for key in ("bytes", "frames") if value.get(key) is None]):
        return f"{name!r} has no {lacking[0]!r}"
    return _inside(name, {key: found for key, found in value.items() if found is not None})


def _inside(name: str, found: Mapping[str, object]) -> Problem:
    """Of an object of numbers."""
    numbers = ((key, value) for key, value in found.items() if key not in _INSIDE)
    return next(filter(None, (_number_problem(f"{name}.{key}", value) for key, value in numbers)), None)


def _number_problem(name: str, value: object) -> Problem:
    if not isinstance(value, (int, float)) or isinstance(value, bool):
        return f"{name!r} is {repr(value)[:60]}, and not a number"
    if not -LARGEST <= value <= LARGEST:
        return f"{name!r} is {repr(value)[:60]}, and nothing measured is so large"
    if value < 0 and not any(part in name for part in _SIGNED):
        return f"{name!r} is {value}, and not a number from 0"
    return None


def _curve_problem(row: Mapping[str, Any]) -> Problem:
    """Of a row of a curve: what it needs besides."""
    if row["kind"] not in CURVE_KINDS or FAILED in row:
        return None
    for key in ("mbps", "frames"):
        if not row.get(key):
            return f"{key!r} is {row.get(key, 'missing')}, and not a number above 0"
    if row["frames"] != int(row["frames"]):
        return f"'frames' is {row['frames']}, and not a whole number"
    if not row.get("per_frame") and (row.get("groups") or row["kind"] != "scene"):
        return f"'per_frame' is {row.get('per_frame', 'missing')}, and not a list of frames"
    return None
