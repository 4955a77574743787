"""Writer of PLY, OBJ and GLB files, which appear complete or not at all.

In: a mesh and a path, whose extension selects the format. Out: a file that `open_sequence` can read.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import BinaryIO

import numpy as np
from jaxtyping import UInt8

from ..errors import InputError
from ..types import Mesh
from .color import to_linear
from .unfinished import cannot_be_written, unfinished

_WAIT = 10.0  # s, for another process that writes the same file: a mesh takes less (guess)
_TOLERANCE = 1e-6  # of the diagonal: largest rounding error of a float32 coordinate (guess)


def left_over(folder: Path, names: Iterable[str], pattern: str = "frame_*") -> tuple[str, ...]:
    """Return a warning if a folder, which need not exist, holds frame files other than `names`."""
    others = {path.name for path in folder.glob(pattern)} - set(names)
    if not others:
        return ()
    return (f"{folder} holds {len(others)} other frame files, as {min(others)}; they are of another run",)


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
    """Raise InputError where an output is one of the inputs: by the same name, another case of it, or a link."""
    for path in inputs if output.exists() else ():
        if path.exists() and path.samefile(output):
            raise InputError(f"{output}: is the input {path}, which the output would replace; choose another name")


def write_mesh(mesh: Mesh, path: Path) -> None:
    """Write a mesh to a .ply, .obj or .glb file, which appears when it is complete."""
    pack = _FORMATS.get(path.suffix.lower())
    if pack is None:
        raise InputError(f"{path}: {path.suffix or 'no'} extension is not one of {', '.join(_FORMATS)}; choose one")
    with replacing(path) as file:
        file.write(pack(mesh))


def write_colored(mesh: Mesh, colors: UInt8[np.ndarray, "F 3"], path: Path) -> None:
    """Write a mesh to a .ply file with these colors (red, green, blue) of faces.

    The file has colors of vertices, which most viewers show: a vertex between faces of several colors is duplicated.
    """
    code = colors.astype(np.int64) @ (65536, 256, 1)
    corners = np.stack([mesh.faces.reshape(-1), np.repeat(code, 3)], axis=1)
    split, number = np.unique(corners, axis=0, return_inverse=True)
    shown = np.stack([split[:, 1] >> 16, split[:, 1] >> 8 & 255, split[:, 1] & 255], axis=1).astype(np.uint8)
    write_mesh(replace(Mesh.of(mesh.vertices[split[:, 0]], number.reshape(-1, 3)), colors=shown), path)


@contextmanager
def replacing(path: Path) -> Iterator[BinaryIO]:
    """Open a file that takes its final name at the end of the block; after a failure, nothing is left behind.

    Where another process writes the same file, wait for its end; the later one stays.
    """
    with unfinished(path, _WAIT, durable=False) as file, cannot_be_written(path):
        yield file


def _pack_ply(mesh: Mesh) -> bytes:
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
    shown = np.zeros((len(mesh.vertices), 0), np.uint8) if colors is None else colors
    points = np.empty(len(mesh.vertices), dtype=[("place", dtype, (3,)), ("color", "u1", shown.shape[1:])])
    points["place"], points["color"] = mesh.vertices, shown
    return header.encode() + points.tobytes() + rows.tobytes()


def _pack_obj(mesh: Mesh) -> bytes:
    vertex = "v %.9g %.9g %.9g\n" if _fits_float32(mesh) else "v %.17g %.17g %.17g\n"
    rows = mesh.vertices if mesh.colors is None else np.concatenate([mesh.vertices, mesh.colors / 255], axis=1)
    vertex = vertex if mesh.colors is None else vertex.replace("\n", " %.4f %.4f %.4f\n")
    vertices = "".join(vertex % tuple(row) for row in rows.tolist())
    faces = "".join(f"f {a} {b} {c}\n" for a, b, c in (mesh.faces + 1).tolist())
    return ("# meshreel\n" + vertices + faces).encode()  # a comment, because readers take an empty file for damage


def _pack_glb(mesh: Mesh) -> bytes:
    """Pack vertices as float32 relative to the translation of the node, so that far coordinates keep their digits."""
    if mesh.is_empty:
        return _glb({"asset": {"version": "2.0"}, "scene": 0, "scenes": [{}]}, b"")
    origin = np.zeros(3) if _fits_float32(mesh) else np.round(mesh.vertices.mean(axis=0))
    local = (mesh.vertices - origin).astype("<f4")
    points, corners = local.tobytes(), mesh.faces.astype("<u4").tobytes()
    low, high = local.min(axis=0).tolist(), local.max(axis=0).tolist()
    attributes, accessors, views, colors = {"POSITION": 0}, list[dict[str, object]](), list[dict[str, object]](), b""
    if mesh.colors is not None:  # rows of four bytes' multiples: a fourth number beside red, green and blue
        light = np.pad(to_linear(mesh.colors), ((0, 0), (0, 1)), constant_values=65535)
        colors, attributes["COLOR_0"] = light.astype("<u2").tobytes(), 2
        accessors = [{"bufferView": 2, "componentType": 5123, "normalized": True, "count": len(local), "type": "VEC4"}]
        views = [{"buffer": 0, "byteOffset": len(points) + len(corners), "byteLength": len(colors), "target": 34962}]
    tree = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "translation": origin.tolist()}],
        "meshes": [{"primitives": [{"attributes": attributes, "indices": 1, "mode": 4}]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": len(local), "type": "VEC3", "min": low, "max": high},
            {"bufferView": 1, "componentType": 5125, "count": mesh.faces.size, "type": "SCALAR"},
            *accessors,
        ],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": len(points), "target": 34962},
            {"buffer": 0, "byteOffset": len(points), "byteLength": len(corners), "target": 34963},
            *views,
        ],
        "buffers": [{"byteLength": len(points) + len(corners) + len(colors)}],
    }
    return _glb(tree, points + corners + colors)


def _glb(tree: dict[str, object], binary: bytes) -> bytes:
    """Return the container: header, JSON chunk, binary chunk; chunks are padded to 4 bytes."""
    text = json.dumps(tree, separators=(",", ":")).encode()
    chunks = _chunk(b"JSON", text + b" " * (-len(text) % 4))
    chunks += _chunk(b"BIN\0", binary) if binary else b""
    return b"glTF" + _words(2, 12 + len(chunks)) + chunks


def _chunk(kind: bytes, data: bytes) -> bytes:
    return _words(len(data)) + kind + data


def _words(*values: int) -> bytes:
    return np.array(values, dtype="<u4").tobytes()


def _fits_float32(mesh: Mesh) -> bool:
    if len(mesh.vertices) == 0:
        return True
    lost = np.abs(mesh.vertices - mesh.vertices.astype(np.float32))
    return bool(lost.max() <= _TOLERANCE * mesh.diagonal)


_FORMATS: dict[str, Callable[[Mesh], bytes]] = {".ply": _pack_ply, ".obj": _pack_obj, ".glb": _pack_glb}
