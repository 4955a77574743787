"""Writer of animated GLB (binary glTF 2.0): a node and a mesh for each shape, morph targets for its frames.

In: shapes, one after the other. Out: a file whose binary chunk is never in memory as a whole. Core glTF without
extensions: a scale of 0 hides a node, as the specification ("Transformations") says, and weights are interpolated
linearly between frames.
"""

from __future__ import annotations

import json
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any, BinaryIO

import numpy as np

from ..errors import InputError
from ..io.write import replacing
from .shapes import Animation, Shape, changes, unit_normals

MOST_BYTES = (1 << 32) - 1  # of a GLB file, whose header has 32 bits for its length (glTF 2.0, "GLB File Format")
_FLOAT, _U16, _U32 = 5126, 5123, 5125
_VERTICES, _INDICES = 34962, 34963  # targets of a buffer view (glTF 2.0)
_RESTART = 65535  # largest value of 16 bits: restarts a primitive, so it is no index (glTF 2.0)
_SURFACE = {
    "name": "surface",
    "doubleSided": True,  # surfaces may be open
    "pbrMetallicRoughness": {"baseColorFactor": [0.8, 0.8, 0.8, 1.0], "metallicFactor": 0.0, "roughnessFactor": 0.9},
}


@contextmanager
def animated_glb(path: Path, animation: Animation) -> Iterator[GlbWriter]:
    """Open a writer of shapes; the file appears at the end of the block, and not at all if the block fails.

    Raises InputError if the file cannot be written, or if float32 times cannot distinguish its frames.
    """
    with replacing(path) as file, tempfile.TemporaryFile(dir=path.parent) as spool:
        writer = GlbWriter(path, animation, spool)
        yield writer
        writer.finish(file)


class GlbWriter:
    """Writer that spools arrays to a temporary file and collects their glTF description."""

    def __init__(self, path: Path, animation: Animation, spool: IO[bytes]) -> None:
        self._path, self._animation, self._spool = path, animation, spool
        self._times = _times(path, animation)
        self._size = 0
        self._nodes: list[dict[str, Any]] = [_root(animation)]
        self._parts: dict[str, int] = {}  # their nodes
        self._meshes: list[dict[str, Any]] = []
        self._accessors: list[dict[str, Any]] = []
        self._views: list[dict[str, Any]] = []
        self._channels: list[dict[str, Any]] = []
        self._samplers: list[dict[str, Any]] = []

    def add(self, shape: Shape) -> None:
        """Write a shape. Raises InputError if the file would exceed the size of a GLB file."""
        primitive = {"indices": self._indices(shape), **self._vertices(shape), "mode": 4, "material": 0}
        self._meshes.append({"name": shape.name, "primitives": [primitive]})
        node = {"name": shape.name, "mesh": len(self._meshes) - 1}
        if shape.shown[0][0] > 0:
            node["scale"] = [0, 0, 0]  # as in the first frame, for viewers that do not animate
        self._child(self._part(shape.part), node)
        self._animate(shape, len(self._nodes) - 1)

    def finish(self, file: BinaryIO) -> None:
        """Write the complete file: header, description, and the spooled arrays."""
        text = json.dumps(self._tree(), separators=(",", ":"), allow_nan=False).encode()
        text += b" " * (-len(text) % 4)
        chunks = [(b"JSON", len(text)), *([(b"BIN\0", self._size)] if self._size else [])]
        total = 12 + sum(8 + size for _, size in chunks)
        self._check(total, "the description of the scene")
        file.write(b"glTF" + _words(2, total) + _words(len(text)) + b"JSON" + text)
        if self._size:
            file.write(_words(self._size) + b"BIN\0")
            self._spool.seek(0)
            shutil.copyfileobj(self._spool, file, 1 << 20)

    def _vertices(self, shape: Shape) -> dict[str, Any]:
        """Write vertices and normals of the first frame, and the difference of each other frame from them."""
        self._open_view(_VERTICES)
        primitive: dict[str, Any] = {"targets": []}
        base = np.zeros((2, 0, 3), np.float32)
        for number, points in enumerate(shape.frames):
            known = np.stack([self._animation.local(shape, points.vertices), unit_normals(points)])
            places, directions = known - base if number else known
            attributes = {"POSITION": self._put(shape, places, "VEC3", True)}
            attributes["NORMAL"] = self._put(shape, directions, "VEC3")
            if number:
                primitive["targets"].append(attributes)
            else:
                primitive["attributes"], base = attributes, known
        if not primitive["targets"]:
            del primitive["targets"]
        return primitive

    def _indices(self, shape: Shape) -> int:
        short = int(shape.faces.max()) < _RESTART
        corners = shape.faces.reshape(-1).astype("<u2" if short else "<u4")
        self._open_view(_INDICES)
        return self._put(shape, corners, "SCALAR")

    def _animate(self, shape: Shape, node: int) -> None:
        """Write the channels that show, hide and move a shape; a still shape that is always shown has none."""
        count = len(self._animation.times)
        if shape.count == 1 and shape.shown == ((0, count),):
            return
        self._open_view(None)
        shown = list(changes(shape, count))
        keys = self._times[[frame for frame, _ in shown] + [count]]  # with the end of the last frame
        states = np.array([is_shown for _, is_shown in shown] + [shown[-1][1]], np.float32)
        values = np.repeat(states[:, None], 3, axis=1)
        times = self._put(shape, keys, "SCALAR", True)
        self._channel(node, "scale", (times, self._put(shape, values, "VEC3")), "STEP")
        if shape.count > 1:
            times = self._put(shape, self._times[shape.first : shape.first + shape.count], "SCALAR", True)
            weights = np.eye(shape.count, dtype=np.float32)[:, 1:].reshape(-1)
            self._channel(node, "weights", (times, self._put(shape, weights, "SCALAR")), "LINEAR")

    def _channel(self, node: int, path: str, accessors: tuple[int, int], interpolation: str) -> None:
        self._samplers.append({"input": accessors[0], "output": accessors[1], "interpolation": interpolation})
        self._channels.append({"sampler": len(self._samplers) - 1, "target": {"node": node, "path": path}})

    def _open_view(self, target: int | None) -> None:
        """Begin a buffer view, which each `_put` extends."""
        view: dict[str, Any] = {"buffer": 0, "byteOffset": self._size, "byteLength": 0}
        if target == _VERTICES:
            view["byteStride"] = 12
        if target is not None:
            view["target"] = target
        self._views.append(view)

    def _put(self, shape: Shape, values: np.ndarray, kind: str, bounded: bool = False) -> int:
        """Append values to the newest view and return the number of their accessor."""
        view = self._views[-1]
        data = values.astype(values.dtype.newbyteorder("<"), copy=False).tobytes()
        data += bytes(-len(data) % 4)
        self._check(self._size + len(data), shape)
        accessor: dict[str, Any] = {
            "bufferView": len(self._views) - 1,
            "byteOffset": view["byteLength"],
            "componentType": {"f4": _FLOAT, "u2": _U16, "u4": _U32}[values.dtype.str[1:]],
            "count": len(values),
            "type": kind,
        }
        if bounded:
            low, high = values.min(axis=0), values.max(axis=0)
            accessor |= {"min": np.atleast_1d(low).tolist(), "max": np.atleast_1d(high).tolist()}
        self._spool.write(data)
        self._size += len(data)
        view["byteLength"] += len(data)
        self._accessors.append(accessor)
        return len(self._accessors) - 1

    def _check(self, size: int, what: object) -> None:
        if size > MOST_BYTES:
            text = f"{self._path}: at {what} it has more than the {MOST_BYTES} bytes of a GLB file"
            raise InputError(f"{text}; export fewer frames or layers, or to USD")

    def _part(self, name: str) -> int:
        if name not in self._parts:
            self._parts[name] = self._child(0, {"name": name})
        return self._parts[name]

    def _child(self, parent: int, node: dict[str, Any]) -> int:
        self._nodes.append(node)
        self._nodes[parent].setdefault("children", []).append(len(self._nodes) - 1)
        return len(self._nodes) - 1

    def _tree(self) -> dict[str, Any]:
        tree: dict[str, Any] = {"asset": {"version": "2.0", "generator": "meshreel"}, "scene": 0, "scenes": [{}]}
        if self._meshes:
            tree |= {"scenes": [{"nodes": [0]}], "nodes": self._nodes}
            tree |= {"meshes": self._meshes, "materials": [_SURFACE]}
            tree |= {"accessors": self._accessors, "bufferViews": self._views, "buffers": [{"byteLength": self._size}]}
        if self._channels:
            tree["animations"] = [{"name": "frames", "channels": self._channels, "samplers": self._samplers}]
        return tree


def _times(path: Path, animation: Animation) -> np.ndarray:
    """Return the times at which frames begin, and the end of the last one, as float32."""
    times = animation.ends.astype(np.float32)
    stuck = np.flatnonzero(np.diff(times) <= 0)
    if len(stuck):
        text = f"{path}: frame {stuck[0]} of those exported and the next begin at {animation.times[stuck[0]]:.9g} s"
        raise InputError(f"{text} for the float32 times of a GLB file; export fewer frames, or to USD")
    return times


def _root(animation: Animation) -> dict[str, Any]:
    matrix = animation.root
    moved = {} if np.array_equal(matrix, np.eye(4)) else {"matrix": matrix.T.reshape(-1).tolist()}
    return {"name": "scene", **moved}


def _words(*values: int) -> bytes:
    return np.array(values, dtype="<u4").tobytes()
