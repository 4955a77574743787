"""Digests of what each stage of an encode computed: where two machines write different files, the first line that
differs names the stage where the difference starts.

In: the arrays, numbers and bytes of a stage. Out: lines of JSON, in the order of the file.
"""

from __future__ import annotations

import hashlib
import json
import os
import platform
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from contextvars import ContextVar
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import numpy as np

from ... import __version__
from ...geometry.threads import threads

WriteLines = Callable[[str], object]  # takes whole lines of JSON
LIBRARIES = ("numpy", "scipy", "libigl", "fast-simplification", "DracoPy", "trimesh")


_listener = ContextVar[tuple[WriteLines, dict[str, int]] | None]("listener to digests", default=None)


@contextmanager
def noted(write: WriteLines | None, **where: int) -> Iterator[None]:
    """Pass the line of each stage in the block to `write`, with the place that it is of; None: no digests are made."""
    token = _listener.set(None if write is None else (write, where))
    try:
        with nullcontext() if write is None else threads(1):  # lines of one stage after another
            yield
    finally:
        _listener.reset(token)


def listener() -> WriteLines | None:
    """Return the function that takes lines here, or None where no digests are wanted."""
    listening = _listener.get()
    return None if listening is None else listening[0]


def note(stage: str, *values: object) -> None:
    """Write the line of a stage where digests are wanted."""
    if (listening := _listener.get()) is not None:
        write, where = listening
        write(line_of(stage, *values, **where))


def line_of(stage: str, *values: object, **where: int) -> str:
    """Return a line of JSON with the digest of some arrays, bytes, numbers or texts."""
    digest = hashlib.sha256()
    for value in values:
        if isinstance(value, np.ndarray):
            digest.update(repr((value.shape, value.dtype.str)).encode())
            digest.update(np.ascontiguousarray(value).data)
        else:
            digest.update(value if isinstance(value, bytes) else repr(value).encode())
    return json.dumps({"stage": stage, **where, "digest": digest.hexdigest()[:16]}) + "\n"


def machine_line() -> str:
    """Return the first line: the processor, its number of cores, and the libraries with what they chose for it."""
    from threadpoolctl import threadpool_info

    pools = [{k: pool.get(k) for k in ("internal_api", "version", "architecture")} for pool in threadpool_info()]
    pools.sort(key=str)  # they are found in any order
    found: dict[str, Any] = {"stage": "machine", "python": platform.python_version(), "system": platform.platform()}
    found |= {"processor": processor(), "cores": os.cpu_count(), "meshreel": __version__, "libraries": versions()}
    return json.dumps(found | {"pools": pools}) + "\n"


def versions() -> dict[str, str | None]:
    """Return the versions of the libraries on which bytes depend, None for one that is not installed."""
    found = dict[str, str | None]()
    for name in LIBRARIES:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            found[name] = None
    return found


def processor() -> str:
    """Return the processor's name, which the standard library does not know on Linux."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor()
    return next((line.partition(":")[2].strip() for line in lines if line.startswith("model name")), platform.machine())
