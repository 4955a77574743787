"""Build of the decoder's C library by CMake, and its calls through ctypes, as an engine's bindings make them."""

from __future__ import annotations

import ctypes
import fcntl
import shutil
import subprocess
import sysconfig
from collections.abc import Callable
from ctypes import POINTER, byref, c_char_p, c_double, c_float, c_int32, c_int64, c_uint8, c_uint32, c_uint64, c_void_p
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
WHOLE, BACKGROUND = -1, -2
OK, BAD_ARGUMENT, DAMAGED, UNREADABLE = 0, 1, 2, 3
AV1, H264 = 1, 2
READ = ctypes.CFUNCTYPE(c_int64, c_void_p, c_uint64, c_uint64, POINTER(c_uint8))


class Info(ctypes.Structure):
    """`meshreel_info`."""

    _fields_ = [
        ("frames", c_uint64),
        *((name, c_double) for name in ("frame_rate", "duration")),
        ("origin", c_double * 3),
        ("scale", c_double),
        *((name, c_double * 3) for name in ("minimum", "maximum")),
        *((name, c_uint32) for name in ("tracks", "layers")),
        ("up", c_int32),
        *((f"has_{name}", c_uint8) for name in ("background", "colors", "textures", "splats")),
    ]


class Shown(ctypes.Structure):
    """`meshreel_mesh`."""

    _fields_ = [
        *((name, c_uint64) for name in ("vertex_count", "face_count")),
        ("positions", POINTER(c_double)),
        ("faces", POINTER(c_int32)),
        ("colors", POINTER(c_uint8)),
        ("uv", POINTER(c_float)),
        ("identity", c_uint64),
    ]


class Packet(ctypes.Structure):
    """`meshreel_packet`."""

    _fields_ = [
        ("data", POINTER(c_uint8)),
        *((name, c_uint64) for name in ("size", "stream", "number")),
        *((name, c_uint32) for name in ("width", "height")),
    ]


class Sound(ctypes.Structure):
    """`meshreel_sound`."""

    _fields_ = [("data", POINTER(c_uint8)), ("size", c_uint64), ("start", c_double), ("type", c_int32)]


class CSplats(ctypes.Structure):
    """`meshreel_splats`."""

    _fields_ = [
        ("count", c_uint64),
        *((name, POINTER(c_double)) for name in ("means", "axes", "scales", "opacities", "colors")),
    ]


def run(*command: str | Path) -> str:
    """Return what a command prints; its errors are the test's."""
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def configure(source: str, build: Path, *options: str) -> None:
    """Configure a folder of core/ in a build folder with the Eigen that the package is built with."""
    eigen = Path(sysconfig.get_path("purelib")) / "cmeel.prefix/include/eigen3"
    generator = ["-G", "Ninja"] if shutil.which("ninja") else []
    run("cmake", "-S", ROOT / source, "-B", build, *generator, f"-DEIGEN_INCLUDE={eigen}", *options)


@cache
def library() -> ctypes.CDLL:
    """Build the library in build/decoder, where an older build is brought up to date, and load it."""
    build = ROOT / "build/decoder"
    build.parent.mkdir(exist_ok=True)
    with build.with_suffix(".lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)  # other workers of the tests wait
        configure("core/decoder", build)
        run("cmake", "--build", build, "--config", "Release")
    [path] = [
        p for pattern in ("**/libmeshreel.so", "**/libmeshreel.dylib", "**/meshreel.dll") for p in build.glob(pattern)
    ]
    loaded = ctypes.CDLL(str(path))
    loaded.meshreel_last_error.restype = loaded.meshreel_metadata.restype = c_char_p
    loaded.meshreel_abi_version.restype = c_uint32
    loaded.meshreel_close.restype = loaded.meshreel_round.restype = None
    handle = c_void_p
    for name, arguments in {
        "last_error": [handle],
        "metadata": [handle],
        "close": [handle],
        "open": [READ, c_void_p, c_uint64, POINTER(handle)],
        "open_memory": [c_char_p, c_uint64, POINTER(handle)],
        "get_info": [handle, POINTER(Info)],
        "time": [handle, c_uint64, POINTER(c_double)],
        "set_layers": [handle, c_int32],
        "decode": [handle, c_uint64, c_int32, POINTER(Shown)],
        "picture": [handle, c_uint64, c_int32, c_int32, POINTER(Packet)],
        "decode_splats": [handle, c_uint64, c_int32, POINTER(CSplats)],
        "audio": [handle, POINTER(Sound)],
        "round": [POINTER(Shown), POINTER(c_double), POINTER(c_float)],
    }.items():
        getattr(loaded, f"meshreel_{name}").argtypes = arguments
    return loaded


class CError(Exception):
    """A status that is not OK, and what the library says."""

    def __init__(self, status: int, message: str) -> None:
        super().__init__(message)
        self.status = status


class CVideo:
    """An open file; arrays are copies."""

    def __init__(self, data: bytes, read: Callable[[int, int], bytes] | None = None) -> None:
        """Open a file in memory, or one of as many bytes by ranges."""
        self._c, self._handle, self._data = library(), c_void_p(), data
        if read is None:
            status = self._c.meshreel_open_memory(data, len(data), byref(self._handle))
        else:
            self._read = READ(lambda _, offset, length, out: _copy(read(offset, length), out))
            status = self._c.meshreel_open(self._read, None, len(data), byref(self._handle))
        try:
            self._check(status)
        except CError:
            self.close()
            raise

    def __enter__(self) -> CVideo:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        self._c.meshreel_close(self._handle)
        self._handle = c_void_p()

    @property
    def message(self) -> str:
        return self._c.meshreel_last_error(self._handle).decode()

    @property
    def metadata(self) -> str:
        return self._c.meshreel_metadata(self._handle).decode()

    @property
    def info(self) -> Info:
        info = Info()
        self._check(self._c.meshreel_get_info(self._handle, byref(info)))
        return info

    def time(self, frame: int) -> float:
        seconds = c_double()
        self._check(self._c.meshreel_time(self._handle, frame, byref(seconds)))
        return seconds.value

    def set_layers(self, layers: int) -> None:
        self._check(self._c.meshreel_set_layers(self._handle, layers))

    def decode(self, frame: int, part: int = WHOLE) -> dict[str, Any]:
        """Decode a part of a frame; `singles` are its positions about the file's origin."""
        shown, info = Shown(), self.info
        self._check(self._c.meshreel_decode(self._handle, frame, part, byref(shown)))
        singles = np.zeros((shown.vertex_count, 3), np.float32)
        self._c.meshreel_round(byref(shown), info.origin, singles.ctypes.data_as(POINTER(c_float)))
        return {
            "vertices": _array(shown.positions, (shown.vertex_count, 3), np.float64),
            "faces": _array(shown.faces, (shown.face_count, 3), np.int32),
            "colors": _array(shown.colors, (shown.vertex_count, 3), np.uint8) if shown.colors else None,
            "uv": _array(shown.uv, (shown.face_count, 3, 2), np.float32) if shown.uv else None,
            "singles": singles,
            "identity": shown.identity,
        }

    def picture(self, frame: int, part: int, codec: int) -> tuple[bytes, Packet] | None:
        packet = Packet()
        self._check(self._c.meshreel_picture(self._handle, frame, part, codec, byref(packet)))
        return (ctypes.string_at(packet.data, packet.size), packet) if packet.data else None

    def audio(self) -> tuple[bytes, float, int] | None:
        found = Sound()
        self._check(self._c.meshreel_audio(self._handle, byref(found)))
        return (ctypes.string_at(found.data, found.size), found.start, found.type) if found.data else None

    def splats(self, frame: int, track: int) -> dict[str, np.ndarray] | None:
        found = CSplats()
        self._check(self._c.meshreel_decode_splats(self._handle, frame, track, byref(found)))
        shapes = {"means": (3,), "axes": (3, 3), "scales": (3,), "opacities": (), "colors": (3,)}
        arrays = {name: (getattr(found, name), (found.count, *shape)) for name, shape in shapes.items()}
        return {name: _array(*array, np.float64) for name, array in arrays.items()} if found.count else None

    def _check(self, status: int) -> None:
        if status != OK:
            raise CError(status, self.message)


def _copy(data: bytes, out: Any) -> int:
    ctypes.memmove(out, data, len(data))
    return len(data)


def _array(pointer: Any, shape: tuple[int, ...], kind: type) -> np.ndarray:
    return np.ctypeslib.as_array(pointer, shape).astype(kind) if np.prod(shape) else np.zeros(shape, kind)
