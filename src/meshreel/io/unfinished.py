"""Unfinished files: an output in the making has a temporary name beside the final one, and a lock.

The lock ends with its process, however that ends, and the name is the same in every run: the next run with the same
output takes over the file of a killed run, and leaves that of a living run alone.
"""

from __future__ import annotations

import errno
import os
import stat
import sys
import time
import zlib
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO

from ..errors import InputError

_LONGEST = 255  # bytes of a file's name, on the usual file systems
_KEPT = 40  # characters of a name that is too long with its suffix: at most 160 bytes (guess)
FULL = (errno.ENOSPC, errno.EFBIG, getattr(errno, "EDQUOT", errno.ENOSPC))  # of a disk or a quota
_PAUSE = 0.02  # s, between two attempts to lock (guess)
_FLAGS = os.O_RDWR | os.O_CREAT | getattr(os, "O_BINARY", 0) | getattr(os, "O_NOFOLLOW", 0)


def part_of(path: Path, hidden: bool = True) -> Path:
    """Return the name of a file in the making: `.NAME.part`, or `NAME.part` if users should see it."""
    name = f"{'.' if hidden else ''}{path.name}.part"
    if len(os.fsencode(name)) > _LONGEST:
        name = f"{name[:_KEPT]}.{zlib.crc32(os.fsencode(name)):08x}.part"
    return path.with_name(name)


@contextmanager
def unfinished(path: Path, wait: float = 0.0, durable: bool = True) -> Iterator[BinaryIO]:
    """Open a file that takes the name `path` at the end of the block, and is removed if the block fails.

    A `durable` file is on the disk by then and survives a loss of power. Raises InputError if it cannot be written.
    """
    name = part_of(path)
    with cannot_be_written(path):
        file = claim(name, path, wait)
    try:
        with cannot_be_written(path):
            file.truncate(0)
        yield file
        with cannot_be_written(path):
            file.flush()
            if durable:
                sync(file)
            if os.name == "nt":  # Windows renames no open file
                file.close()
            name.replace(path)
    except BaseException:
        discard(file, name)
        raise
    file.close()


@contextmanager
def cannot_be_written(path: Path) -> Iterator[None]:
    """Turn an OSError inside the block into an InputError with the output's name and a remedy."""
    try:
        yield
    except OSError as error:
        remedy = "free space, or choose another folder" if error.errno in FULL else "choose another folder"
        raise InputError(f"{path}: cannot be written ({error.strerror or error}); {remedy}") from error


def claim(name: Path, output: Path, wait: float = 0.0) -> BinaryIO:
    """Open an unfinished file of an output, new or left by a dead process, and lock it.

    Raises InputError if a living process holds it for longer than `wait` seconds, or if the output is a pipe or a
    device, which it would replace; OSError if it cannot be made.
    """
    if output.exists() and not (output.is_file() or output.is_dir()):
        raise InputError(f"{output}: is a pipe or a device, which the file would replace; name a file")
    until = time.monotonic() + wait
    while True:
        number = os.open(name, _FLAGS, 0o666)
        try:
            if not stat.S_ISREG(os.fstat(number).st_mode):
                raise InputError(f"{name}: is no regular file, and in the way of {output.name}; move it away")
            locked = _lock(number)
            if locked and _is_at(number, name):
                return os.fdopen(number, "r+b")
        except BaseException:
            os.close(number)
            raise
        os.close(number)
        if not locked:
            if time.monotonic() >= until:
                raise InputError(f"{output}: another process is writing it; wait for its end, or choose another name")
            time.sleep(_PAUSE)


def discard(file: BinaryIO, name: Path) -> None:
    """Remove an unfinished file and close it."""
    if os.name != "nt":  # remove it before its lock ends; Windows removes no open file
        with suppress(OSError):
            name.unlink()
    with suppress(OSError):  # there may be no room for buffered bytes
        file.close()
    if os.name == "nt":
        with suppress(OSError):
            name.unlink()


def sync(file: BinaryIO) -> None:
    """Flush a file to the disk."""
    file.flush()
    os.fsync(file.fileno())


def sync_folder(folder: Path) -> None:
    """Make a rename in a folder survive a loss of power, if the system can."""
    if os.name == "nt":
        return
    with suppress(OSError):
        number = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(number)
        finally:
            os.close(number)


def _is_at(number: int, name: Path) -> bool:
    """Return whether an open file still has its name: its owner may have renamed it before the lock was free."""
    try:
        return os.path.samestat(os.fstat(number), os.stat(name, follow_symlinks=False))  # noqa: PTH116
    except FileNotFoundError:
        return False


if sys.platform == "win32":
    import msvcrt

    def _lock(number: int) -> bool:
        """Lock an open file until it is closed; return False where another process has it."""
        try:
            msvcrt.locking(number, msvcrt.LK_NBLCK, 1)
        except OSError:
            return False
        return True

else:
    import fcntl

    def _lock(number: int) -> bool:
        """Lock an open file until it is closed; return False where another process has it."""
        try:
            fcntl.flock(number, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            return False
        except OSError as error:
            if error.errno not in (errno.ENOLCK, errno.ENOTSUP, errno.EINVAL):
                raise  # these three: the file system has no locks
        return True
