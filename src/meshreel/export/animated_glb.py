"""Writer of animated GLB (binary glTF 2.0): a node and a mesh for each shape, morph targets for its frames.

In: shapes, one after the other. Out: a file whose binary chunk is never in memory as a whole, with a camera of the
first view. Only core glTF, except for colours (see `GlbFile`): a scale of 0 hides a node, as the specification allows
("Transformations"), and weights are interpolated linearly between frames. A compressed file has streams of
meshoptimizer (EXT_meshopt_compression), and positions as 16-bit numbers on a lattice of each shape, which its node
scales and translates (KHR_mesh_quantization).
"""

from __future__ import annotations

import math
import tempfile
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import IO, Any, BinaryIO

import numpy as np

from ..errors import InputError
from ..io.glb_file import COLORS, PLACES, Faces, GlbFile, by_use, check_meshopt, light
from ..io.write import replacing
from ..types import cut_at_seams
from .shapes import Animation, Shape, changes, unit_normals

BITS = 14  # of positions along the longest side of a shape in a compressed file, gltfpack's default
NEAR = 0.002  # of the distance of a camera: how near it sees, as the player has it
_ROUNDED = {"NORMAL": 6, COLORS: 10}  # fractional bits, guesses: half a degree of normals, a 2048th of light
_MATERIAL = {
    "name": "surface",
    "doubleSided": True,  # surfaces may be open
    "pbrMetallicRoughness": {"baseColorFactor": [0.8, 0.8, 0.8, 1.0], "metallicFactor": 0.0, "roughnessFactor": 0.9},
}


@contextmanager
def animated_glb(path: Path, animation: Animation, compressed: bool = False) -> Iterator[GlbWriter]:
    """Open a writer of shapes; the file appears if the block succeeds. Raises InputError; compressing needs `glb`."""
    with replacing(path) as file, tempfile.TemporaryFile(dir=path.parent) as spool:
        if compressed:
            check_meshopt()
        writer = GlbWriter(path, animation, spool, compressed)
        yield writer
        writer.finish(file)


class GlbWriter:
    """Writer that spools arrays to a temporary file and collects their glTF description."""

    def __init__(self, path: Path, animation: Animation, spool: IO[bytes], compressed: bool) -> None:
        self._file = GlbFile(spool, str(path), "export fewer frames or layers, or to USD", compressed)
        self._animation, self._times = animation, _times(path, animation)
        root = animation.root
        moved = {} if np.array_equal(root, np.eye(4)) else {"matrix": root.T.reshape(-1).tolist()}
        self._nodes: list[dict[str, Any]] = [{"name": "scene", **moved}]
        self._parts: dict[str, int] = {}  # node of each part
        self._materials: dict[bool, int] = {}  # of faces without a texture; True: with colours
        self._channels: list[dict[str, Any]] = []
        self._samplers: list[dict[str, Any]] = []

    def add(self, shape: Shape) -> None:
        """Write a shape. Raises InputError if the file would exceed the size of a GLB file."""
        primitives, lattice = self._primitives(shape)
        mesh = self._file.add("meshes", {"name": shape.name, "primitives": primitives})
        node: dict[str, Any] = {"name": shape.name, "mesh": mesh}
        if self._file.compressed:
            node |= {"translation": lattice.low.tolist(), "scale": [lattice.step] * 3}
        if shape.shown[0][0] > 0:
            node["scale"] = [0, 0, 0]  # as in the first frame, for viewers that do not animate
        if shape.part not in self._parts:
            self._parts[shape.part] = self._child(0, {"name": shape.part})
        self._child(self._parts[shape.part], node)
        self._animate(shape, len(self._nodes) - 1, lattice.step)

    def finish(self, file: BinaryIO) -> None:
        """Write the complete file: header, description, and the spooled arrays."""
        tree: dict[str, Any] = {"asset": {"version": "2.0", "generator": "meshreel"}, "scene": 0, "scenes": [{}]}
        if self._parts:
            tree |= {"scenes": [{"nodes": [0]}], "nodes": self._nodes} | self._camera()
        if self._channels:
            tree["animations"] = [{"name": "frames", "channels": self._channels, "samplers": self._samplers}]
        self._file.finish(file, tree)

    def _camera(self) -> dict[str, Any]:
        """Return the scene with a camera of the first view, if it is known."""
        view, matrix = self._animation.view, self._animation.camera
        if view is None or matrix is None:
            return {}
        lens = {"yfov": math.radians(view.fov), "znear": NEAR * math.dist(view.position, view.target)}
        node = {"name": "first view", "camera": 0, "matrix": matrix.T.reshape(-1).tolist()}
        cameras = [{"name": "first view", "type": "perspective", "perspective": lens}]
        return {"scenes": [{"nodes": [0, len(self._nodes)]}], "nodes": [*self._nodes, node], "cameras": cameras}

    def _primitives(self, shape: Shape) -> tuple[list[dict[str, Any]], _Lattice]:
        """Write vertices and faces of the first frame, and the difference of each other frame from it."""
        file, first = self._file, shape.frames[0]
        origins, corners, picture = np.arange(len(first.vertices)), shape.faces, None
        places = dict[str, int]()
        if shape.uv is not None and first.texture is not None:
            origins, corners, uv = cut_at_seams(shape.faces, shape.uv)
            picture, places = file.put_picture(first.texture.pixels, shape), {PLACES: file.put_places(uv, shape)}
        elif file.compressed:
            origins, corners = by_use(shape.faces, len(first.vertices))
        rows, lattice = self._rows(shape, origins), _Lattice(np.zeros(3), 1.0)
        if file.compressed:
            stored = list(rows)
            lattice = _Lattice.around([row["POSITION"] for row in stored])
            rows = iter([row | {"POSITION": lattice.numbers(row["POSITION"])} for row in stored])
        frames = self._put(_differences(rows), shape)
        frames[0] |= places
        material = None if shape.pictured.all() else self._material(first.colors is not None)
        return file.put_faces(Faces(corners, shape.pictured, picture, material), frames, shape), lattice

    def _rows(self, shape: Shape, origins: np.ndarray) -> Iterator[dict[str, np.ndarray]]:
        """Yield the attributes of each frame."""
        for frame in shape.frames:
            row = {"POSITION": self._animation.local(shape, frame.vertices), "NORMAL": unit_normals(frame)}
            row |= {} if frame.colors is None or shape.pictured.all() else {COLORS: light(frame.colors)}
            if self._file.compressed and frame.colors is not None:
                del row["NORMAL"]  # colours are drawn unlit
            yield {name: values[origins] for name, values in row.items()}

    def _put(self, rows: Iterable[dict[str, np.ndarray]], shape: Shape) -> list[dict[str, int]]:
        """Write frames in one buffer view, or compressed in one for each attribute; return their accessors."""
        if not self._file.compressed:
            self._file.open_vertices()
            put = partial(self._file.put, kind="VEC3", what=shape)
            return [{name: put(row, bounded=name == "POSITION") for name, row in each.items()} for each in rows]
        stored = list(rows)
        frames: list[dict[str, int]] = [{} for _ in stored]
        for name in stored[0]:
            self._file.open_vertices(8 if name == "POSITION" else 12, _ROUNDED.get(name, 0))
            for frame, row in zip(frames, stored, strict=True):
                frame[name] = self._file.put(row[name], "VEC3", shape, name == "POSITION")
        return frames

    def _material(self, colored: bool) -> int:
        """Return the material of faces without a texture."""
        if colored not in self._materials:
            self._materials[colored] = self._file.put_unlit({}) if colored else self._file.add("materials", _MATERIAL)
        return self._materials[colored]

    def _animate(self, shape: Shape, node: int, size: float) -> None:
        """Write the channels that show, hide and move a shape; a still shape that is always shown has none."""
        count, frames = len(self._animation.times), len(shape.frames)
        if frames == 1 and shape.shown == ((0, count),):
            return
        put = partial(self._file.put, what=shape)
        self._file.open_view()
        visible = list(changes(shape, count))
        keys = self._times[[frame for frame, _ in visible] + [count]]  # with the end of the last frame
        states = np.array([is_shown for _, is_shown in visible] + [visible[-1][1]], np.float32)
        values = np.repeat(np.float32(size) * states[:, None], 3, axis=1)
        times = put(keys, "SCALAR", bounded=True)
        self._channel(node, "scale", (times, put(values, "VEC3")), "STEP")
        if frames > 1:
            times = put(self._times[shape.first : shape.first + frames], "SCALAR", bounded=True)
            weights = np.eye(frames, dtype=np.float32)[:, 1:].reshape(-1)
            self._channel(node, "weights", (times, put(weights, "SCALAR")), "LINEAR")

    def _channel(self, node: int, path: str, accessors: tuple[int, int], interpolation: str) -> None:
        self._samplers.append({"input": accessors[0], "output": accessors[1], "interpolation": interpolation})
        self._channels.append({"sampler": len(self._samplers) - 1, "target": {"node": node, "path": path}})

    def _child(self, parent: int, node: dict[str, Any]) -> int:
        self._nodes.append(node)
        self._nodes[parent].setdefault("children", []).append(len(self._nodes) - 1)
        return len(self._nodes) - 1


@dataclass(frozen=True, slots=True)
class _Lattice:
    """Lattice of positions: low + step * whole numbers, m."""

    low: np.ndarray
    step: float

    @classmethod
    def around(cls, frames: Sequence[np.ndarray]) -> _Lattice:
        """Return the lattice of frames, with BITS bits along their longest side."""
        low = np.min([places.min(axis=0) for places in frames], axis=0).astype(np.float64)
        side = float((np.max([places.max(axis=0) for places in frames], axis=0) - low).max())
        return cls(low, float(np.float32((side or 1.0) / (2**BITS - 1))))

    def numbers(self, places: np.ndarray) -> np.ndarray:
        return np.rint((places - self.low) / self.step).astype(np.int16)


def _differences(rows: Iterable[dict[str, np.ndarray]]) -> Iterator[dict[str, np.ndarray]]:
    """Yield the first frame, and the difference of each other frame from it."""
    base = dict[str, np.ndarray]()
    for row in rows:
        yield {name: values - base[name] if base else values for name, values in row.items()}
        base = base or row


def _times(path: Path, animation: Animation) -> np.ndarray:
    """Return the times at which frames begin, and the end of the last frame, as float32."""
    times = animation.ends.astype(np.float32)
    stuck = np.flatnonzero(np.diff(times) <= 0)
    if len(stuck):
        text = f"{path}: frame {stuck[0]} of those exported and the next begin at {animation.times[stuck[0]]:.9g} s"
        raise InputError(f"{text} for the float32 times of a GLB file; export fewer frames, or to USD")
    return times
