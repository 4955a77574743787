"""Sources: where the bytes of a file come from, as one function `get_bytes(offset, length)`."""

from __future__ import annotations

import threading
from pathlib import Path
from types import TracebackType
from typing import Protocol, runtime_checkable

from ..errors import InputError


@runtime_checkable
class Source(Protocol):
    """Bytes that can be read by ranges: a file, memory, an HTTP server."""

    @property
    def size(self) -> int:
        """Number of bytes there are."""
        ...

    def get_bytes(self, offset: int, length: int) -> bytes:
        """Up to `length` bytes from `offset`; fewer only where the source ends."""
        ...


class BytesSource:
    """A file that is in memory already."""

    def __init__(self, data: bytes) -> None:
        self._data = data

    @property
    def size(self) -> int:
        return len(self._data)

    def get_bytes(self, offset: int, length: int) -> bytes:
        return bytes(self._data[offset : offset + length])


class FileSource:
    """A file on disk, held open until `close`; threads may share it. InputError where it cannot be read."""

    def __init__(self, path: str | Path) -> None:
        self.path = Path(path)
        try:
            self._file = self.path.open("rb")
            self._size = self._file.seek(0, 2)
        except OSError as error:
            raise InputError(f"{self.path}: cannot be opened: {error.strerror}") from error
        self._lock = threading.Lock()

    @property
    def size(self) -> int:
        return self._size

    def get_bytes(self, offset: int, length: int) -> bytes:
        try:
            with self._lock:
                self._file.seek(offset)
                return self._file.read(length)
        except OSError as error:
            raise InputError(f"{self.path}: cannot be read at byte {offset}: {error.strerror}") from error

    def close(self) -> None:
        self._file.close()

    def __enter__(self) -> FileSource:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
