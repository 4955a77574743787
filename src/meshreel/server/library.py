"""The .reel files that are served: a folder and all below it, or one file. Looked at anew with each request.

In: a folder. Out: names with slashes, and what each file is: length, rate, or why it cannot be read.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from ..container.reader import ReelReader
from ..container.sources import FileSource
from ..errors import MeshreelError

SUFFIX = ".reel"


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
        """That of one file alone."""
        return Library(file.parent, file.name)

    def names(self) -> list[str]:
        """The files that are there now, sorted; none that a link leads out of the folder to."""
        if self.only is not None:
            return [self.only]
        found = (path.relative_to(self.folder).as_posix() for path in self.folder.rglob(f"*{SUFFIX}"))
        return sorted(filter(self.path_of, found), key=lambda name: (name.lower(), name))

    def path_of(self, name: str) -> Path | None:
        """The file of a name; None where it is none of this library's, whatever the name says."""
        if (self.only is not None and name != self.only) or not name.endswith(SUFFIX):
            return None
        try:
            root = self.folder.resolve()
            path = (root / name).resolve()
            if self.only is not None:
                path = self.folder / name  # that one was named by the user, wherever a link leads
            elif not path.is_relative_to(root):
                return None
            return path if path.is_file() else None
        except (OSError, ValueError):  # a name that is too long, or has a NUL
            return None

    def entry(self, name: str) -> Entry:
        """What a file is; damage and absence are told, not raised."""
        path = self.path_of(name)
        try:
            with FileSource(path or self.folder / name) as source:
                reader = ReelReader(source)
                last = reader.timestamp(reader.frame_count - 1) - reader.timestamp(0)
                missing = f"{len(reader.missing)} of {len(reader.chunks)} chunks are missing: the file is truncated"
                error = missing if reader.missing else ""
                return Entry(name, reader.size, reader.frame_count, last + 1 / reader.frame_rate, error)
        except (MeshreelError, OSError) as error:
            return Entry(name, error=str(error))
