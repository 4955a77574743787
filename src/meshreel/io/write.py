"""Writer of PLY, OBJ, GLB and NPZ files, which appear complete or not at all.

Until it is complete, an output has a temporary name beside the final one, the same in every run, and a lock that ends
with its process: the next run takes over the file of a killed run, and leaves that of a living run alone.
"""

from __future__ import annotations

import errno
import io
import os
import stat
import sys
import time
import zlib
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import replace
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from jaxtyping import UInt8, UInt16

from ..errors import InputError, path_of
from ..types import Mesh, cut_at_seams, distinct_places
from .glb_file import COLORS, PLACES, Faces, GlbFile, light
from .pictures import pack_picture

_LONGEST = 255  # bytes of a file's name, on the usual file systems
_KEPT = 40  # characters of a name that is too long with its suffix: at most 160 bytes (guess)
FULL = (errno.ENOSPC, errno.EFBIG, getattr(errno, "EDQUOT", errno.ENOSPC))  # of a disk or a quota
_PAUSE = 0.02  # s, between two attempts to lock (guess)
_FLAGS = os.O_RDWR | os.O_CREAT | getattr(os, "O_BINARY", 0) | getattr(os, "O_NOFOLLOW", 0)
_WAIT = 10.0  # s, for another process that writes the same file: a mesh takes less (guess)
_MATERIAL = "surface"  # name of the material in the .mtl beside an .obj
_TOLERANCE = 1e-6  # of the diagonal: largest rounding error of a float32 coordinate (guess)


def left_over(folder: Path, names: Iterable[str], pattern: str = "frame_*") -> tuple[str, ...]:
    """Return a warning if a folder, which may not exist, holds frame files other than `names`."""
    foreign = {path.name for path in folder.glob(pattern)} - set(names)
    if not foreign:
        return ()
    return (f"{folder} holds {len(foreign)} other frame files, as {min(foreign)}; they are of another run",)


def frame_names(count: int, extension: str) -> list[str]:
    """Return file names for `count` frames: frame_00000.ply and so on."""
    digits = max(5, len(str(count - 1)))
    return [f"frame_{number:0{digits}}.{extension}" for number in range(count)]


def make_folder(path: Path) -> None:
    """Create a folder and its parents if missing. Raises InputError if it cannot be created."""
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{path}: cannot be made a folder ({error.strerror}); choose another") from None


def check_apart(output: Path, inputs: Iterable[Path]) -> None:
    """Raise InputError if an output is one of the inputs: by the same name, another case of it, or a link."""
    for path in inputs if output.exists() else ():
        if path.exists() and path.samefile(output):
            raise InputError(f"{output}: is the input {path}, which the output would replace; choose another name")


def check_free(paths: Iterable[Path], force: bool, inputs: Sequence[Path] = ()) -> None:
    """Raise InputError if unnamed files would be replaced, unless `force`, which does not replace an input."""
    there = [path for path in paths if os.path.lexists(path)]
    for path in there if force else ():
        check_apart(path, inputs)
    if there and not force:
        more = f" and {len(there) - 1} other files" if there[1:] else ""
        raise InputError(f"{there[0]}{more}: there already, and not named; choose another output, or give --force")


def write_mesh(mesh: Mesh, path: Path) -> None:
    """Write a .ply, .obj, .glb or .npz file when it is complete. A .ply has no texture; an .obj has it beside it."""
    path = Path(path_of(path))
    extension = path.suffix.lower()
    pack = _FORMATS.get(extension)
    if pack is None:
        raise InputError(f"{path}: {path.suffix or 'no'} extension is not one of {', '.join(_FORMATS)}; choose one")
    if extension == ".obj" and mesh.uv is not None and mesh.texture is not None:
        write_picture(mesh.texture.pixels, path.with_suffix(".png"))
        write_file(path.with_suffix(".mtl"), f"newmtl {_MATERIAL}\nKd 1 1 1\nmap_Kd {path.stem}.png\n".encode())
    write_file(path, pack(mesh, path))


def write_colored(mesh: Mesh, colors: UInt8[np.ndarray, "F 3"], path: Path) -> None:
    """Write a .ply with these colors of faces as those of vertices, which viewers show; shared ones are duplicated."""
    code = colors.astype(np.int64) @ (65536, 256, 1)
    corners = np.stack([mesh.faces.reshape(-1), np.repeat(code, 3)], axis=1)
    split, number = np.unique(corners, axis=0, return_inverse=True)
    vertex_colors = np.stack([split[:, 1] >> 16, split[:, 1] >> 8 & 255, split[:, 1] & 255], axis=1).astype(np.uint8)
    write_mesh(replace(Mesh.of(mesh.vertices[split[:, 0]], number.reshape(-1, 3)), colors=vertex_colors), path)


@contextmanager
def replacing(path: Path) -> Iterator[BinaryIO]:
    """Open a file that is complete at the end of the block or not there; wait for another process that writes it."""
    with unfinished(path, _WAIT, durable=False) as file, cannot_be_written(path):
        yield file


def write_file(path: Path, data: bytes) -> None:
    """Write a file, which appears when it is complete."""
    with replacing(path) as file:
        file.write(data)


def write_picture(pixels: UInt8[np.ndarray, "H W *C"] | UInt16[np.ndarray, "H W"], path: Path) -> None:
    write_file(path, pack_picture(pixels))


def _pack_ply(mesh: Mesh, _: Path) -> bytes:
    colors = mesh.colors
    kind, dtype = ("float", "<f4") if _fits_float32(mesh) else ("double", "<f8")
    colored = "" if colors is None else "property uchar red\nproperty uchar green\nproperty uchar blue\n"
    header = (
        f"ply\nformat binary_little_endian 1.0\nelement vertex {len(mesh.vertices)}\n"
        f"property {kind} x\nproperty {kind} y\nproperty {kind} z\n{colored}"
        f"element face {len(mesh.faces)}\nproperty list uchar int vertex_indices\nend_header\n"
    )
    rows = np.empty(len(mesh.faces), dtype=[("size", "u1"), ("corners", "<i4", (3,))])
    rows["size"], rows["corners"] = 3, mesh.faces
    color_rows = np.zeros((len(mesh.vertices), 0), np.uint8) if colors is None else colors
    points = np.empty(len(mesh.vertices), dtype=[("place", dtype, (3,)), ("color", "u1", color_rows.shape[1:])])
    points["place"], points["color"] = mesh.vertices, color_rows
    return header.encode() + points.tobytes() + rows.tobytes()


def _pack_obj(mesh: Mesh, path: Path) -> bytes:
    vertex = "v %.9g %.9g %.9g\n" if _fits_float32(mesh) else "v %.17g %.17g %.17g\n"
    rows = mesh.vertices if mesh.colors is None else np.concatenate([mesh.vertices, mesh.colors / 255], axis=1)
    vertex = vertex if mesh.colors is None else vertex.replace("\n", " %.4f %.4f %.4f\n")
    vertices = "".join(vertex % tuple(row) for row in rows.tolist())
    if mesh.uv is None or mesh.texture is None:
        faces = "".join(f"f {a} {b} {c}\n" for a, b, c in (mesh.faces + 1).tolist())
    else:
        places, numbers = distinct_places(mesh.uv)
        finite = np.isfinite(places).all(axis=1)
        rows = np.stack([mesh.faces + 1, np.cumsum(finite)[numbers]], axis=2).reshape(-1, 6)
        forms, has_place = ("f %d %d %d\n", "f %d/%d %d/%d %d/%d\n"), finite[numbers].all(axis=1).tolist()
        vertices += f"mtllib {path.stem}.mtl\nusemtl {_MATERIAL}\n"
        vertices += "".join(f"vt {u:.9g} {v:.9g}\n" for u, v in places[finite].tolist())
        pairs = zip(has_place, rows.tolist(), strict=True)
        faces = "".join(forms[has] % tuple(row if has else row[::2]) for has, row in pairs)
    return ("# meshreel\n" + vertices + faces).encode()  # not empty: readers report an empty file as damaged


def _pack_npz(mesh: Mesh, _: Path) -> bytes:
    arrays = {"vertices": mesh.vertices[None], "faces": mesh.faces}
    arrays |= {} if mesh.colors is None else {"colors": mesh.colors[None]}
    if mesh.uv is not None and mesh.texture is not None:
        arrays |= {"uv": mesh.uv, "texture": mesh.texture.pixels}
    packed = io.BytesIO()
    np.savez_compressed(packed, allow_pickle=False, **arrays)
    return packed.getvalue()


def _pack_glb(mesh: Mesh, path: Path) -> bytes:
    """Pack vertices as float32 relative to the translation of the node, so that far coordinates keep their digits."""
    file, scene = GlbFile(io.BytesIO(), str(path)), {"asset": {"version": "2.0"}, "scene": 0, "scenes": [{}]}
    if not mesh.is_empty:
        scene["scenes"] = [{"nodes": [0]}]
        origin = np.zeros(3) if _fits_float32(mesh) else np.round(mesh.vertices.mean(axis=0))
        file.add("nodes", {"mesh": 0, "translation": origin.tolist()})
        file.add("meshes", {"primitives": _primitives(file, mesh.at(mesh.vertices - origin))})
    packed = io.BytesIO()
    file.finish(packed, scene)
    return packed.getvalue()


def _primitives(file: GlbFile, mesh: Mesh) -> list[dict[str, Any]]:
    pictured, uv, texture = np.zeros(len(mesh.faces), bool), mesh.uv, mesh.texture
    colors, picture, frame = mesh.colors, None, dict[str, int]()
    if uv is not None and texture is not None:
        origins, corners, places = cut_at_seams(mesh.faces, uv)
        mesh, colors = Mesh(mesh.vertices[origins], corners), None if colors is None else colors[origins]
        pictured, picture = np.isfinite(uv).all(axis=(1, 2)), file.put_picture(texture.pixels)
        frame[PLACES] = file.put_places(places)
    file.open_vertices()
    frame["POSITION"] = file.put(mesh.vertices.astype("<f4"), "VEC3", bounded=True)
    frame |= {} if colors is None else {COLORS: file.put(light(colors), "VEC3")}
    material = None if colors is None else file.put_unlit({})
    return file.put_faces(Faces(mesh.faces, pictured, picture, material), [frame])


def _fits_float32(mesh: Mesh) -> bool:
    lost = np.abs(mesh.vertices - mesh.vertices.astype(np.float32))
    return bool(lost.max(initial=0.0) <= _TOLERANCE * mesh.diagonal)


_FORMATS = {".ply": _pack_ply, ".obj": _pack_obj, ".glb": _pack_glb, ".npz": _pack_npz}


def part_of(path: Path, hidden: bool = True) -> Path:
    """Return the name of a file in the making: `.NAME.part`, or `NAME.part` if users should see it."""
    name = f"{'.' if hidden else ''}{path.name}.part"
    if len(os.fsencode(name)) > _LONGEST:
        name = f"{name[:_KEPT]}.{zlib.crc32(os.fsencode(name)):08x}.part"
    return path.with_name(name)


@contextmanager
def unfinished(path: Path, wait: float = 0.0, durable: bool = True) -> Iterator[BinaryIO]:
    """Open a file that is named at the block's end, or removed; `durable`: it is on the disk. Raises InputError."""
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
    """Turn an OSError inside the block into an InputError with the output's name, the file in its way, and a remedy."""
    try:
        yield
    except OSError as error:
        remedy = "free space, or choose another folder" if error.errno in FULL else "choose another folder"
        inner = error.filename if isinstance(error.filename, str) else ""
        where = f" at {inner}" if inner and Path(inner) not in (path, path.parent, part_of(path)) else ""
        raise InputError(f"{path}: cannot be written ({error.strerror or error}{where}); {remedy}") from error


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
    steps: list[Callable[[], None]] = [name.unlink, file.close]  # it is removed before its lock ends,
    for step in reversed(steps) if os.name == "nt" else steps:  # but Windows removes no open file
        with suppress(OSError):  # there may be no room for buffered bytes
            step()


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
