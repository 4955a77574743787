"""Regular files, opened or read whole within a bound: a folder may hold pipes, devices and sparse files."""

from __future__ import annotations

import errno
import os
import stat
from pathlib import Path
from typing import BinaryIO

MOST_BYTES = 1 << 30  # of a file: as binary PLY, 20 million vertices and 60 million faces (guess)
_FLAGS = os.O_RDONLY | getattr(os, "O_BINARY", 0) | getattr(os, "O_NONBLOCK", 0)  # a pipe would wait for its writer


def open_regular(path: Path) -> BinaryIO:
    """Open a file to read it. Raises OSError, whose text is for users, also for what is no regular file."""
    number = os.open(path, _FLAGS)
    try:
        mode = os.fstat(number).st_mode
        if stat.S_ISDIR(mode):
            raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR))
        if not stat.S_ISREG(mode):
            raise OSError("it is a pipe or a device, which cannot be read twice")
        return os.fdopen(number, "rb")
    except BaseException:
        os.close(number)
        raise


def read_file(path: Path) -> bytes:
    """Return the bytes of a file of at most MOST_BYTES. Raises OSError as `open_regular`."""
    with open_regular(path) as file:
        size = os.fstat(file.fileno()).st_size
        data = b"" if size > MOST_BYTES else file.read(MOST_BYTES + 1)  # the file may grow meanwhile
    if max(size, len(data)) > MOST_BYTES:
        raise OSError(f"it has {size} bytes, more than the {MOST_BYTES} that an input file may have")
    return data
