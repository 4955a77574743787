"""Sources of a file's bytes, behind one function `get_bytes(offset, length)`."""

from __future__ import annotations

import os
import threading
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol, runtime_checkable

from ..errors import SCHEME, InputError

if TYPE_CHECKING:
    from .http import UrlSource


@runtime_checkable
class Source(Protocol):
    """Bytes that can be read by ranges: a file, memory, an HTTP server."""

    @property
    def size(self) -> int:
        """Size of the source in bytes."""

    def get_bytes(self, offset: int, length: int) -> bytes:
        """Up to `length` bytes from `offset`; fewer only where the source ends."""


@runtime_checkable
class Stream(Protocol):
    """The part of a binary file object that is used."""

    def read(self, size: int, /) -> Any: ...

    def seek(self, offset: int, whence: int = 0, /) -> int: ...

    def seekable(self) -> bool: ...

    def close(self) -> object: ...


def viewed(given: Any) -> memoryview | None:
    """Return the bytes that an object holds, not copied, as of bytes, an array or an mmap; None for other objects."""
    try:
        return memoryview(given).cast("B")
    except (TypeError, ValueError):  # no buffer, a closed or a scattered one
        return None


class BytesSource:
    """A file in memory."""

    def __init__(self, data: bytes | memoryview) -> None:
        self._data = data

    def __reduce__(self) -> tuple[Any, ...]:
        return BytesSource, (bytes(self._data),)

    @property
    def size(self) -> int:
        return len(self._data)

    def get_bytes(self, offset: int, length: int) -> bytes:
        return bytes(self._data[offset : offset + length])


class StreamSource:
    """A binary file object that can seek; threads may share it. Raises InputError if it cannot be read."""

    def __init__(self, file: Stream, name: str | None = None) -> None:
        """Read from `file`; `name` is its name in error messages."""
        self._file, self._lock = file, threading.Lock()
        self._name = type(file).__name__ if name is None else name
        if not file.seekable() or not isinstance(file.read(0), bytes):
            raise InputError(f"{self._name} is no binary file that can seek; open it with mode 'rb', or give its bytes")
        self.size = file.seek(0, 2)

    def get_bytes(self, offset: int, length: int) -> bytes:
        try:
            with self._lock:
                self._file.seek(offset)
                data: bytes = self._file.read(length)
                return data
        except (OSError, ValueError) as error:  # a ValueError if the file is closed
            raise _unreadable(self._name, offset, error) from error

    def close(self) -> None:
        self._file.close()


def _open_at_once(path: str, flags: int) -> int:
    """Open a file without waiting for the writer of a pipe, which is then refused because it cannot seek."""
    return os.open(path, flags | getattr(os, "O_NONBLOCK", 0))


class FileSource(StreamSource):
    """A file on disk, held open until `close`; threads may share it. Raises InputError if it cannot be read."""

    def __init__(self, path: str | Path) -> None:
        self.path = Path(path)
        try:
            file = open(self.path, "rb", opener=_open_at_once)  # noqa: SIM115 (open until `close`)
        except OSError as error:
            remedy = "no URL is taken here, copy the file" if SCHEME.match(str(path)) else "give a .reel file"
            raise InputError(f"{self.path}: cannot be opened: {error.strerror}; {remedy}") from error
        self._disk = file
        super().__init__(file, str(self.path))

    def get_bytes(self, offset: int, length: int) -> bytes:
        if not hasattr(os, "pread"):
            return super().get_bytes(offset, length)
        try:  # not `seek`: forked processes share the position in an open file
            file = self._disk.fileno()
            data = os.pread(file, length, offset)  # on Linux at most 2 GiB
            while len(data) < length and (more := os.pread(file, length - len(data), offset + len(data))):
                data += more
            return data
        except (OSError, ValueError) as error:
            raise _unreadable(str(self.path), offset, error) from error

    def __enter__(self) -> FileSource:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def source_at(place: str | Path) -> FileSource | UrlSource:
    """Open a file on disk or behind a URL. Raises InputError if it cannot be read."""
    if isinstance(place, str) and "://" in place:
        from .http import UrlSource

        return UrlSource(place)
    return FileSource(place)


def _unreadable(name: str, offset: int, error: Exception) -> InputError:
    reason = getattr(error, "strerror", None) or ("it is closed; open it again" if "closed" in str(error) else error)
    return InputError(f"{name}: cannot be read at byte {offset}: {reason}")
