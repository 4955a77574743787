"""Files behind URLs, read and written through fsspec: s3://, gs://, https://, memory:// and what else it knows.

In: a URL. Out: bytes, names of files, or a file here that is uploaded when it is complete. Needs the extra `remote`.
"""

from __future__ import annotations

import re
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Any, BinaryIO
from urllib.parse import urlsplit
from urllib.request import url2pathname

from ..errors import InputError

_URL = re.compile(r"[a-zA-Z][a-zA-Z0-9+.-]+://")  # of two letters, at least: C:/ is a disk


@dataclass(frozen=True, slots=True)
class Remote:
    """A file or a folder behind a URL; has what readers use of a Path."""

    url: str

    def __str__(self) -> str:
        return self.url

    @property
    def name(self) -> str:
        """The last part of its path."""
        return PurePosixPath(urlsplit(self.url).path).name

    @property
    def suffix(self) -> str:
        """The extension of its name."""
        return PurePosixPath(self.name).suffix

    def absolute(self) -> Remote:
        """Return itself: a URL means the same everywhere."""
        return self

    def open(self) -> BinaryIO:
        """Open the file to be read. Raises InputError where it cannot be."""
        with _as_input_error(self.url):
            system, path = _system(self.url)
            file: BinaryIO = system.open(path, "rb")
            return file

    def read(self, most: int) -> bytes:
        """Return its bytes. Raises InputError where it cannot be read, or has more than `most`."""
        with _as_input_error(self.url), self.open() as file:
            data = file.read(most + 1)
        if len(data) > most:
            raise InputError(f"{self.url}: has more than the {most} bytes that an input file may have")
        return data

    def files(self, is_pattern: bool) -> dict[PurePosixPath, Remote] | None:
        """Return the files in a folder, or those that fit a pattern, by their paths; None where this is a file."""
        with _as_input_error(self.url):
            system, path = _system(self.url)
            if not is_pattern and not system.isdir(path):
                return None
            names = system.glob(path) if is_pattern else system.ls(path, detail=False)
            return {PurePosixPath(urlsplit(name).path): Remote(system.unstrip_protocol(name)) for name in names}


def located(name: str | Path) -> Path | Remote:
    """Return where a name leads: to a path, also for file:// URLs, or to another place."""
    if not isinstance(name, str) or not _URL.match(name):
        return Path(name)
    if name.lower().startswith("file://"):
        return Path(url2pathname(urlsplit(name).path))
    return Remote(name)


@contextmanager
def uploaded(output: str | Path) -> Iterator[Path]:
    """Yield the path to write an output to; for a URL, a file here that is uploaded at the end of the block."""
    place = located(output)
    if isinstance(place, Path):
        yield place
        return
    with _as_input_error(place.url):
        system, path = _system(place.url)  # what cannot be written to is refused before the work
    with tempfile.TemporaryDirectory(prefix="meshreel-") as folder:
        here = Path(folder) / (place.name or "output")
        yield here
        with _as_input_error(place.url):
            system.put_file(str(here), path)


def _system(url: str) -> tuple[Any, str]:
    """Return the file system of a URL, and its path there."""
    try:
        from fsspec.core import url_to_fs
    except ModuleNotFoundError:
        raise InputError("a URL needs the extra `remote`: pip install 'meshreel[remote]'") from None
    system, path = url_to_fs(url)
    return system, path


@contextmanager
def _as_input_error(url: str) -> Iterator[None]:
    """Turn any error of a file system, each of which has errors of its own, into an InputError with the URL."""
    try:
        yield
    except InputError:
        raise
    except Exception as error:
        text = " ".join(str(error).split()) or "no more is known"
        raise InputError(f"{url}: {type(error).__name__}: {text}; check the address and your rights") from error
