"""Reader of .npz files with `vertices` (T x V x 3) and `faces` (F x 3), one frame at a time.

In: a path. Out: frames by number. The stream is read forward, with one frame in memory; going back restarts it.
"""

from __future__ import annotations

import threading
import tokenize
import zipfile
import zlib
from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path
from typing import IO, Any

import numpy as np
from jaxtyping import Float64, Int64

from ..errors import InputError
from .meshes import Loaded, checked
from .polygons import Polygons, Unreadable

_DAMAGED = (  # errors of NumPy and zipfile for damaged files; RuntimeError for encrypted ones
    *(OSError, ValueError, EOFError, SyntaxError, tokenize.TokenError, RecursionError),
    *(zipfile.BadZipFile, zlib.error, NotImplementedError, RuntimeError),
)


class Archive:
    """Frames of an .npz file."""

    def __init__(self, path: Path) -> None:
        self.path, self.paths = path, (path,)
        self._stream: IO[bytes] | None = None
        self._lock = threading.Lock()  # of the stream, which has one place
        try:
            with zipfile.ZipFile(path) as archive:
                names = sorted(name.removesuffix(".npy") for name in archive.namelist())
                if not {"vertices.npy", "faces.npy"} <= set(archive.namelist()):
                    raise InputError(f"{path}: has {', '.join(names) or 'nothing'}; save it as 'vertices' and 'faces'")
                self._shape, self._dtype, self._begin = _head(archive, "vertices")
                _head(archive, "faces")  # refuses an array larger than the file before it is allocated
                faces = np.load(path, allow_pickle=False)["faces"]
        except _DAMAGED as error:
            raise InputError(f"{path}: cannot be read as .npz ({error}); write it again with numpy.savez") from None
        if len(self._shape) != 3 or self._shape[2] != 3 or self._dtype.kind not in "fiu":
            raise InputError(f"{path}: 'vertices' is {self._dtype} {self._shape}; it must be numbers T x V x 3")
        if faces.ndim != 2 or (faces.shape[1] < 3 and len(faces)) or faces.dtype.kind not in "iu":
            raise InputError(f"{path}: 'faces' is {faces.dtype} {faces.shape}; it must be integers F x 3")
        self._corners: Int64[np.ndarray, " C"] = faces.astype(np.int64).reshape(-1)
        self._sizes: Int64[np.ndarray, " P"] = np.full(len(faces), faces.shape[1], dtype=np.int64)

    def __reduce__(self) -> tuple[Any, tuple[Path, int, int]]:
        """Pickle the path: another process opens the file for itself, and keeps it open for what it reads next."""
        state = self.path.stat()
        return _opened, (self.path.absolute(), state.st_size, state.st_mtime_ns)

    def only(self, numbers: Sequence[int]) -> Archive:
        """Return the archive: it is one file, whatever is read of it."""
        del numbers
        return self

    def __len__(self) -> int:
        return int(self._shape[0])

    def name(self, index: int) -> str:
        """Return the name of a frame in error messages."""
        return f"{self.path}[{index}]"

    def load(self, index: int, where: str) -> Loaded:
        """Read and check one frame."""
        try:
            return checked(Polygons(self._vertices(index), self._corners, self._sizes))
        except Unreadable as error:
            raise InputError(f"{where}: {error}; mend the .npz, or leave the frame out with --frames") from None
        except _DAMAGED as error:
            raise InputError(f"{where}: cannot be read ({error}); write it again with numpy.savez") from None

    def _vertices(self, index: int) -> Float64[np.ndarray, "V 3"]:
        size = self._shape[1] * 3 * self._dtype.itemsize
        with self._lock:
            if self._stream is None:
                self._stream = zipfile.ZipFile(self.path).open("vertices.npy")  # noqa: SIM115 (while the sequence lives)
            self._stream.seek(self._begin + index * size)
            data = self._stream.read(size)
        if len(data) < size:
            raise Unreadable(f"'vertices' has {len(data)} of {size} bytes (truncated?)")
        return np.frombuffer(data, dtype=self._dtype).astype(np.float64).reshape(-1, 3)


@lru_cache(maxsize=4)  # archives at a time (guess)
def _opened(path: Path, size: int, changed: int) -> Archive:
    """Return the archive of a path, which is opened again where the file has changed since."""
    del size, changed
    return Archive(path)


def _head(archive: zipfile.ZipFile, name: str) -> tuple[tuple[int, ...], np.dtype, int]:
    """Return shape, dtype and first byte of an array in the archive without reading it."""
    member = f"{name}.npy"
    with archive.open(member) as stream:
        version = np.lib.format.read_magic(stream)
        read = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
        shape, fortran, dtype = read(stream)
        begin = stream.tell()
    if fortran and len(shape) > 1:
        raise ValueError(f"'{name}' is in Fortran order; save numpy.ascontiguousarray of it")
    if (
        dtype.hasobject
        or min(shape, default=0) < 0
        or begin + int(np.prod(shape, dtype=object)) * dtype.itemsize > archive.getinfo(member).file_size
    ):
        raise ValueError(f"'{name}' announces {dtype} {shape}, more than the file holds")
    return shape, dtype, begin
