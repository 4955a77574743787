"""Files of inputs and outputs: on this machine, regular and of a bounded size, or behind URLs.

A folder may hold pipes, devices and sparse files. URLs but of web servers go through fsspec: s3://, gs:// and others
that it supports (extra `remote`), as do folders of web servers.
"""

from __future__ import annotations

import errno
import json
import os
import re
import shutil
import stat
import tempfile
from collections.abc import Iterable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Any
from urllib.parse import urlsplit

from ..errors import InputError, path_of, without_secret
from ..texts import json_of
from ..web import LONGEST, WEB, fetch, in_store, time_for

_URL = re.compile(r"[a-zA-Z][a-zA-Z0-9+.-]+://")  # two letters at least: C:/ is a disk
_POINTER = b"version https://git-lfs.github.com/spec/"
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
            data = b"" if state.st_size > MOST_BYTES else file.read()  # a bound would take its bytes of memory
        if max(state.st_size, len(data)) > MOST_BYTES:
            raise OSError(f"it has {state.st_size} bytes, more than the {MOST_BYTES} that an input file may have")
        return data
    finally:
        os.close(number)


def read_input(path: Place, remedy: str = "check the path and its rights", where: str = "") -> bytes:
    """Return the bytes of a file. Raises InputError; its message begins with the file's name, or `where`."""
    try:
        data = read_file(path)
    except OSError as error:
        raise InputError(f"{where or path}: cannot be read ({error.strerror or error}); {remedy}") from None
    if data[:48].startswith(_POINTER):
        raise InputError(f"{where or path}: is a pointer of Git LFS in place of the file; fetch it with `git lfs pull`")
    return data


def read_json(path: Place, remedy: str) -> dict[str, Any]:
    """Return the object in a JSON file. Raises InputError with the `remedy`."""
    try:
        record = json_of(read_input(path, "check it and its rights"))
    except ValueError as error:
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


@dataclass(frozen=True, slots=True)
class Remote:
    """A file or a folder behind a URL, with the part of Path's interface that readers use."""

    url: str

    def __str__(self) -> str:
        """Return the URL as messages show it, without keys."""
        return without_secret(self.url)

    __repr__ = __str__

    def __truediv__(self, name: str) -> Remote:
        return Remote(f"{self.url.rstrip('/')}/{name}")

    @property
    def path(self) -> PurePosixPath:
        """Its path; of a web address, without the query."""
        return PurePosixPath(urlsplit(self.url).path if self.url.startswith(WEB) else self.url)

    @property
    def suffix(self) -> str:
        return self.path.suffix

    def absolute(self) -> Remote:
        """Return itself: a URL means the same everywhere."""
        return self

    def read(self, most: int) -> bytes:
        """Return its bytes, by one request. Raises OSError, also if there are more than `most`."""
        if self.url.startswith(WEB):
            data, _ = fetch(self.url, 0, most + 1, most + 1)
        else:
            data = in_store(self.url, lambda fs, path: fs.cat_file(path, start=0, end=most + 1), time_for(most))
        if len(data) > most:
            raise OSError(f"it has more than the {most} bytes that an input file may have")
        return data

    def names(self, pattern: str) -> list[str]:
        """Return the names in this folder, or relative paths that match a non-empty pattern. Raises OSError."""

        def act(system: Any, root: str) -> list[str]:
            paths = system.glob(f"{root.rstrip('/')}/{pattern}") if pattern else system.ls(root, detail=False)
            return [name.removeprefix(root).lstrip("/") for name in paths]

        return in_store(self.url, act)


Place = Path | Remote


def located(name: object) -> Place:
    """Return the place that a name refers to: a path on this machine, or a URL. Raises InputError for neither."""
    if isinstance(name, Remote):
        return name
    path = path_of(name)
    return Remote(path) if isinstance(path, str) and _URL.match(path) else Path(path)


def located_all(names: object) -> list[Place]:
    """Return the places that several names refer to, or one name. Raises InputError for other objects."""
    if isinstance(names, str | bytes | Place) or not isinstance(names, Iterable):
        return [located(names)]
    return [located(name) for name in names]


@contextmanager
def uploaded(output: Place) -> Iterator[Path]:
    """Yield a path for an output; of a URL, one to upload at the end, kept if that fails. Raises InputError."""
    if isinstance(output, Path):
        yield output
        return
    if output.url.startswith(WEB):
        raise InputError(f"{output}: a web server takes no output; give a path, or the URL of a store, as s3://")
    try:
        in_store(output.url, lambda *_: None)
    except OSError as error:
        raise InputError(f"{output}: cannot be written ({error}); check the URL") from None
    with ExitStack() as stack:
        folder = tempfile.mkdtemp(prefix="meshreel-")
        stack.callback(shutil.rmtree, folder)
        local = Path(folder, output.path.name)
        yield local
        try:
            in_store(output.url, lambda system, path: system.put_file(str(local), path), 24 * LONGEST)
        except OSError as error:
            stack.pop_all()
            raise InputError(f"{output}: cannot be written ({error}); {local} is complete: copy it there") from None
