"""Reader of .npz files with `vertices` (T x V x 3) and `faces` (F x 3), one frame at a time.

They may have `colors` (V x 3, or T x V x 3), and `uv` (F x 3 x 2) with `texture` (H x W x 3, or T x H x W x 3).
A stream is read forward, with one frame in memory; going back restarts it.
"""

from __future__ import annotations

import threading
import tokenize
import zipfile
import zlib
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import lru_cache, partial
from pathlib import Path
from typing import IO, Any

import numpy as np
from jaxtyping import Int64, UInt8

from ..errors import InputError
from ..types import Texture
from .meshes import Loaded, checked
from .pictures import MOST_PIXELS
from .polygons import Polygons, Surfaceless, Unreadable, eight_bits

_ARRAYS = {"vertices", "faces", "colors", "uv", "texture"}
_DAMAGED = (  # errors of NumPy and zipfile for damaged files; RuntimeError for encrypted ones
    *(OSError, ValueError, EOFError, SyntaxError, tokenize.TokenError, RecursionError),
    *(zipfile.BadZipFile, zlib.error, NotImplementedError, RuntimeError),
)


@contextmanager
def _reading(where: str) -> Iterator[None]:
    """Turn errors of a damaged file into an InputError."""
    try:
        yield
    except Surfaceless as error:
        raise InputError(f"{where}: {error}") from None
    except Unreadable as error:
        raise InputError(f"{where}: {error}; mend the .npz, or leave the frame out with --frames") from None
    except _DAMAGED as error:
        raise InputError(f"{where}: cannot be read as .npz ({error}); write it again with numpy.savez") from None


PASSED = 4  # rows of an array in an archive that are kept, at most (guess)


class _Stream:
    """An array in an archive with a row for each frame, or one row for all, read forward row by row."""

    def __init__(self, path: Path, archive: zipfile.ZipFile, name: str, dimensions: int) -> None:
        """Open the array `name`, whose rows have this number of `dimensions`."""
        shape, self.dtype, self._begin = _head(archive, name)
        self._path, self._name, self._whole = path, name, shape
        self.rows = shape[0] if len(shape) > dimensions else None  # None: one for all frames
        self.shape = shape[-dimensions:] if len(shape) <= dimensions + 1 else ()
        self._stream: IO[bytes] | None = None
        self._lock = threading.Lock()  # of the stream, which has one position
        self._next, self._passed = 0, dict[int, bytes]()  # the row that follows, and those that nobody asked for yet

    def __str__(self) -> str:
        return f"'{self._name}' is {self.dtype} {self._whole}"

    def row(self, frame: int) -> np.ndarray:
        """Read the row of a frame. Raises Unreadable if the file ends before it."""
        size = int(np.prod(self.shape)) * self.dtype.itemsize
        with self._lock:
            if self._stream is None:  # while the sequence lives
                self._stream = zipfile.ZipFile(self._path).open(f"{self._name}.npy")  # noqa: SIM115
                self._stream.seek(self._begin)
            data = self._read(0 if self.rows is None else frame, size)
        if len(data) < size:
            raise Unreadable(f"'{self._name}' has {len(data)} of {size} bytes (truncated?)")
        return np.frombuffer(data, dtype=self.dtype).reshape(self.shape)

    def _read(self, row: int, size: int) -> bytes:
        """Read a row, and keep a few that lie before it: threads ask in another order, and no stream goes back."""
        if row in self._passed:
            return self._passed.pop(row)
        stream = self._stream
        assert stream is not None
        if not 0 <= row - self._next <= PASSED:
            self._passed.clear()
            stream.seek(self._begin + row * size)
            self._next = row
        for number in range(self._next, row):
            self._passed[number] = stream.read(size)
        while len(self._passed) > PASSED:
            self._passed.pop(min(self._passed))
        self._next = row + 1
        return stream.read(size)


class Archive:
    """Frames of an .npz file."""

    def __init__(self, path: Path) -> None:
        self.path, self.paths = path, (path,)
        self._last: tuple[int, np.ndarray] | None = None  # the picture that was read last, and its frame
        with _reading(str(path)), zipfile.ZipFile(path) as archive:
            names = {name.removesuffix(".npy") for name in archive.namelist()}
            if not {"vertices", "faces"} <= names:
                given = ", ".join(sorted(names)) or "nothing"
                raise InputError(f"{path}: has {given}; save it as 'vertices' and 'faces'")
            self._others = frozenset(f"array {name!r}" for name in names - _ARRAYS)
            self._vertices = _Stream(path, archive, "vertices", 2)
            self._colors = _Stream(path, archive, "colors", 2) if "colors" in names else None
            self._texture = _Stream(path, archive, "texture", 3) if "texture" in names else None
            for name in {"faces", "uv"} & names:
                _head(archive, name)  # refuses an array larger than the file before it is allocated
            arrays = np.load(path, allow_pickle=False)
            faces, uv = arrays["faces"], arrays["uv"] if "uv" in names else None
        if self._vertices.rows is None or self._vertices.shape[1:] != (3,) or self._vertices.dtype.kind not in "fiu":
            raise InputError(f"{path}: {self._vertices}; it must be numbers T x V x 3")
        if faces.ndim != 2 or (faces.shape[1] < 3 and len(faces)) or faces.dtype.kind not in "iu":
            raise InputError(f"{path}: 'faces' is {faces.dtype} {faces.shape}; it must be integers F x 3")
        if uv is not None and (uv.shape != (*faces.shape, 2) or uv.dtype.kind != "f"):
            text = f"{path}: 'uv' is {uv.dtype} {uv.shape}"
            raise InputError(f"{text}; it must be fractions, two for each corner of a face")
        self._check_colors()
        self._uv = None if uv is None else uv.astype(np.float32).reshape(-1, 2)
        self._corners: Int64[np.ndarray, " C"] = faces.astype(np.int64).reshape(-1)
        self._sizes: Int64[np.ndarray, " P"] = np.full(len(faces), faces.shape[1], dtype=np.int64)

    def __reduce__(self) -> tuple[Any, tuple[Path, int, int]]:
        """Pickle the path: another process opens the file itself, and keeps it open for later frames."""
        state = self.path.stat()
        return _opened, (self.path.absolute(), state.st_size, state.st_mtime_ns)

    def only(self, _numbers: Sequence[int]) -> Archive:
        """Return the archive: it is one file, whatever frames are read."""
        return self

    def __len__(self) -> int:
        return self._vertices.rows or 0

    def name(self, index: int) -> str:
        return f"{self.path}[{index}]"

    def load(self, index: int, where: str) -> Loaded:
        with _reading(where):
            vertices = self._vertices.row(index).astype(np.float64)
            colors = None if self._colors is None else eight_bits(self._colors.row(index))
            texture = None if self._texture is None else Texture(partial(self._picture, index))
            dropped = self._others | ({"a texture (without uv)"} if self._uv is None and texture is not None else set())
            return checked(Polygons(vertices, self._corners, self._sizes, dropped, colors, self._uv, texture))

    def _check_colors(self) -> None:
        """Raise InputError if colours or pictures do not match the vertices and frames."""
        colors, texture, rows, shape = self._colors, self._texture, (None, self._vertices.rows), self._vertices.shape
        if colors is not None and (colors.shape != shape or colors.rows not in rows or colors.dtype.kind not in "fiu"):
            raise InputError(f"{self.path}: {colors}; it must be numbers V x 3, or T x V x 3 as 'vertices'")
        if texture is None:
            return
        if texture.shape[2:] != (3,) or 0 in texture.shape or texture.rows not in rows or texture.dtype != np.uint8:
            raise InputError(f"{self.path}: {texture}; it must be uint8 H x W x 3, or T x H x W x 3")
        if texture.shape[0] * texture.shape[1] > MOST_PIXELS:
            raise InputError(f"{self.path}: {texture}, more than 8192 x 8192 pixels; make it smaller")

    def _picture(self, index: int) -> UInt8[np.ndarray, "H W 3"]:
        assert self._texture is not None
        index = 0 if self._texture.rows is None else index
        last = self._last
        if last is None or last[0] != index:
            with _reading(self.name(index)):
                last = self._last = index, self._texture.row(index)
        return last[1]


@lru_cache(maxsize=4)  # archives at a time (guess)
def _opened(path: Path, _size: int, _changed: int) -> Archive:
    """Return the archive of a path, opened again if the file has changed."""
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
    end = begin + int(np.prod(shape, dtype=object)) * dtype.itemsize
    if dtype.hasobject or min(shape, default=0) < 0 or end > archive.getinfo(member).file_size:
        raise ValueError(f"'{name}' announces {dtype} {shape}, more than the file holds")
    return shape, dtype, begin
