"""Reader of whole input files: regular files of a bounded size. A folder may hold pipes, devices and sparse files."""

from __future__ import annotations

import errno
import json
import os
import stat
from typing import Any

from ..errors import InputError
from .remote import Place, Remote

MOST_BYTES = 1 << 30  # of a file: as binary PLY, 20 million vertices and 60 million faces (guess)
_FLAGS = os.O_RDONLY | getattr(os, "O_BINARY", 0) | getattr(os, "O_NONBLOCK", 0)  # a pipe would wait for its writer


def read_file(path: Place) -> bytes:
    """Return the bytes of a file. Raises OSError, whose text is for users, also if it is no regular file."""
    if isinstance(path, Remote):
        return path.read(MOST_BYTES)
    number = os.open(path, _FLAGS)
    try:
        state = os.fstat(number)
        if stat.S_ISDIR(state.st_mode):
            raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR))
        if not stat.S_ISREG(state.st_mode):
            raise OSError("it is a pipe or a device, which cannot be read twice")
        with os.fdopen(number, "rb", closefd=False) as file:
            data = b"" if state.st_size > MOST_BYTES else file.read(MOST_BYTES + 1)  # the file may grow meanwhile
        if max(state.st_size, len(data)) > MOST_BYTES:
            raise OSError(f"it has {state.st_size} bytes, more than the {MOST_BYTES} that an input file may have")
        return data
    finally:
        os.close(number)


def read_input(path: Place, remedy: str = "check the path and its rights", where: str = "") -> bytes:
    """Return the bytes of a file. Raises InputError; its message begins with the file's name, or `where`."""
    try:
        return read_file(path)
    except OSError as error:
        raise InputError(f"{where or path}: cannot be read ({error.strerror or error}); {remedy}") from None


def read_json(path: Place, remedy: str) -> dict[str, Any]:
    """Return the object in a JSON file. Raises InputError with the `remedy`."""
    try:
        # Some editors write a byte order mark.
        record = json.loads(read_input(path, "check it and its rights").decode("utf-8-sig"))
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path}: cannot be read ({error}); {remedy}") from None
    if not isinstance(record, dict):
        raise InputError(f"{path}: is not a JSON object; {remedy}")
    return record


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
