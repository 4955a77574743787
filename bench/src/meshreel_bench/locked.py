"""Files that several processes change, one after the other. In: an open file. Out: nobody else who asks has it."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import BinaryIO

if sys.platform == "win32":
    import msvcrt
else:
    import fcntl

_BYTE = 1 << 40  # that is locked on Windows, where nobody can read what is: far behind the end


@contextmanager
def locked(file: BinaryIO) -> Iterator[None]:
    """Waits until nobody else has the file, and has it until the end of the block or of this process.

    Where a file system knows no locks, nobody is kept out.
    """
    with suppress(OSError):
        _lock(file, True)
    try:
        yield
    finally:
        file.flush()
        with suppress(OSError):
            _lock(file, False)


if sys.platform == "win32":

    def _lock(file: BinaryIO, taken: bool) -> None:
        at = file.tell()
        file.seek(_BYTE)
        msvcrt.locking(file.fileno(), msvcrt.LK_LOCK if taken else msvcrt.LK_UNLCK, 1)
        file.seek(at)

else:

    def _lock(file: BinaryIO, taken: bool) -> None:
        fcntl.flock(file, fcntl.LOCK_EX if taken else fcntl.LOCK_UN)
