"""The .reel files that are served: a folder and all below it, or one file. Looked at anew with each request.

In: a folder. Out: names with slashes, and what each file is: length, rate, or why it cannot be read.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

from ..container.reader import ReelReader
from ..container.sources import FileSource
from ..errors import InputError, MeshreelError
from ..io.file_names import is_text

SUFFIX = ".reel"
HIDDEN = "."  # what such names begin with


@dataclass(frozen=True, slots=True)
class Entry:
    """What a gallery tells of a file; where it cannot be read, the numbers are 0 and `error` says why."""

    name: str  # from the folder, with slashes
    size: int = 0  # bytes
    frames: int = 0
    duration: float = 0.0  # s, the last frame's own time included
    error: str = ""

    @property
    def mbps(self) -> float:
        """Rate of the whole file over its duration."""
        return self.size * 8e-6 / self.duration if self.duration else 0.0


@dataclass(frozen=True, slots=True)
class Library:
    """A folder's files, or `only` that one of them."""

    folder: Path
    only: str | None = None

    @staticmethod
    def of_file(file: Path) -> Library:
        """That of one file alone, whatever its suffix. Raises InputError where no address can have its name."""
        if not is_text(file.name):
            raise InputError(f"{file}: its name is no Unicode text, which no address can have: rename it")
        return Library(file.parent, file.name)

    def names(self) -> list[str]:
        """The files that are there now, sorted; none that is hidden, or that a link leads out of the folder to."""
        if self.only is not None:
            return [self.only]
        found: list[str] = []
        for folder, folders, files in os.walk(self.folder):
            folders[:] = [name for name in folders if not name.startswith(HIDDEN)]
            paths = (Path(folder, name) for name in files if name.lower().endswith(SUFFIX))
            found += [path.relative_to(self.folder).as_posix() for path in paths]
        return sorted(filter(self.path_of, found), key=lambda name: (name.lower(), name))

    def path_of(self, name: str) -> Path | None:
        """The file of a name; None where it is none of this library's, whatever the name says."""
        if self.only is not None:
            path = self.folder / self.only  # that one was named by the user, wherever a link leads
            return path if name == self.only and path.is_file() else None
        if not _is_plain(name):
            return None
        try:
            root = self.folder.resolve()
            path = (root / name).resolve(strict=True)
            return path if path.is_relative_to(root) and path.is_file() else None
        except (
            OSError,
            ValueError,
            RuntimeError,
        ):  # too long, a NUL; RuntimeError: links in a circle, before Python 3.13
            return None

    def entry(self, name: str) -> Entry:
        """What a file is; damage and absence are told, not raised."""
        if not is_text(name):
            return Entry(as_text(name), error="the name is no Unicode text, which no address can have: rename the file")
        path = self.path_of(name)
        if path is None:
            return Entry(name, error="is not there any more")
        try:
            with FileSource(path) as source:
                reader = ReelReader(source)
        except (MeshreelError, OSError) as error:
            return Entry(name, error=str(error).removeprefix(f"{path}: "))  # who reads it need not know our folders
        lost, whole = len(reader.missing), len(reader.chunks)
        cut = f"{lost} of {whole} chunks are missing: the file is truncated" if lost else ""
        return Entry(name, reader.size, reader.frame_count, reader.duration, cut)


def as_text(name: str) -> str:
    """What a page can show of a name, whether it is text or not."""
    return name.encode("utf-8", "replace").decode()


def _is_plain(name: str) -> bool:
    """Whether a name from an address leads downwards only: no "..", no hidden part, no drive, nothing absolute."""
    if not name.lower().endswith(SUFFIX) or "\\" in name or (os.name == "nt" and ":" in name):
        return False
    return not any(part == "" or part.startswith(HIDDEN) for part in name.split("/"))
