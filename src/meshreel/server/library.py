"""Library of served .reel files: those in a folder and its subfolders, listed for each request, or one file."""

from __future__ import annotations

import os
import time
from dataclasses import dataclass, field, replace
from pathlib import Path

from ..errors import InputError, MeshreelError
from ..io.file_names import is_text
from .heads import HeadReader

SUFFIX = ".reel"
OF_STUDIES = (".study.json", ".network.csv")  # endings of what the player's study page reads beside recordings
HIDDEN = "."  # first character of hidden names
Version = tuple[int, int, int]  # of a file, which changes with its contents: size in bytes; mtime and ctime in ns


@dataclass(frozen=True, slots=True)
class Entry:
    """Facts of a file for the gallery: 0 and `error` where unreadable; size alone where its head is long or unread."""

    name: str  # relative to the folder, with slashes
    size: int = 0  # bytes
    frames: int = 0
    duration: float = 0.0  # s, including the last frame
    error: str = ""

    @property
    def mbps(self) -> float:
        """Size of the file over its duration, Mbit/s."""
        return self.size * 8e-6 / self.duration if self.duration else 0.0


@dataclass(frozen=True, slots=True)
class Library:
    """The .reel files of a folder, or `only` one of them."""

    folder: Path
    only: str | None = None
    known: dict[tuple[Path, Version], Entry] = field(default_factory=dict, repr=False, compare=False)
    """Facts of the files of the last gallery: a head is read once."""

    @staticmethod
    def of_file(file: Path) -> Library:
        """Return the library of one file with any suffix. Raises InputError if no URL can contain its name."""
        if not is_text(file.name):
            raise InputError(f"{file}: its name is no Unicode text, which no address can have: rename it")
        return Library(file.parent, file.name)

    def names(self) -> list[str]:
        """Return the files that exist now, sorted, without hidden files and links to outside of the folder."""
        if self.only is not None:
            return [self.only]
        found: list[str] = []
        for folder, folders, files in os.walk(self.folder):
            folders[:] = [name for name in folders if not name.startswith(HIDDEN)]
            paths = (Path(folder, name) for name in files if name.lower().endswith(SUFFIX))
            found += [path.relative_to(self.folder).as_posix() for path in paths]
        return sorted(filter(self.path_of, found), key=lambda name: (name.lower(), name))

    def path_of(self, name: str, endings: tuple[str, ...] = (SUFFIX,)) -> Path | None:
        """Return the path of a name, None if the name is not that of a file in this library with one of the endings."""
        if self.only is not None:
            path = self.folder / self.only  # named by the user, so that links may lead anywhere
            return path if name == self.only and path.is_file() else None
        if not _is_plain(name, endings):
            return None
        try:
            root = self.folder.resolve()
            path = (root / name).resolve(strict=True)
            return path if path.is_relative_to(root) and path.is_file() else None
        except (OSError, ValueError, RuntimeError):
            return None  # a name too long, a NUL, or links in a circle, which are a RuntimeError before Python 3.13

    def entries(self) -> list[Entry]:
        """Return the facts of the files that exist now, in the order of their names; one thread at a time."""
        before = dict(self.known)
        self.known.clear()
        with HeadReader() as heads:
            return [self._entry(name, before, heads) for name in self.names()]

    def _entry(self, name: str, before: dict[tuple[Path, Version], Entry], heads: HeadReader) -> Entry:
        """Return the facts of a file; damage and absence are part of them and not raised."""
        if not is_text(name):
            return Entry(as_text(name), error="the name is no Unicode text, which no address can have: rename the file")
        path = self.path_of(name)
        if path is None:
            return Entry(name, error="is not there any more")
        try:
            found = path.stat()
            key = path, (found.st_size, found.st_mtime_ns, found.st_ctime_ns)
            if key not in before and time.monotonic() > heads.until:
                return Entry(name, found.st_size)
            facts = before.get(key) or Entry(name, **heads.read(path))
        except (MeshreelError, OSError) as error:
            text = (error.strerror if isinstance(error, OSError) else str(error)) or type(error).__name__
            return Entry(name, error=text.removeprefix(f"{path}: "))  # viewers need not know the server's folders
        before[key] = self.known[key] = facts
        return replace(facts, name=name)  # links have one path


def as_text(name: str) -> str:
    """Return a name as a page can show it, with question marks for bytes that are no text."""
    return name.encode("utf-8", "replace").decode()


def _is_plain(name: str, endings: tuple[str, ...]) -> bool:
    """Return whether a name from a URL is relative, without "..", hidden parts and drives, and ends as it should."""
    if not name.lower().endswith(endings) or "\\" in name or (os.name == "nt" and ":" in name):
        return False
    return not any(part == "" or part.startswith(HIDDEN) for part in name.split("/"))
