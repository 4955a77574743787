"""meshoptimizer per frame: its codecs of vertices and indices, as glTF's EXT_meshopt_compression has them.

Places are 16-bit numbers on a lattice of `qp` bits, as its own packer quantises them; faces are in the order of its
strips, vertices in that of their first use, as its manual advises. The data are compressed again by zlib.
"""

from __future__ import annotations

import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import msgspec
import numpy as np

from meshreel.errors import InputError
from meshreel.types import Mesh, MeshSequence

from ..codec import Options, Progress, reported
from ..names import MESHOPT
from .draco import check_qp


class _Frame(msgspec.Struct, array_like=True):
    vertices: int
    faces: int
    low: tuple[float, float, float]  # of the lattice
    step: float
    places: bytes
    corners: bytes


@dataclass(frozen=True, slots=True)
class MeshoptCodec(Options):
    """meshoptimizer's codecs, every frame on its own."""

    name: ClassVar[str] = MESHOPT
    qp: int = 10  # bits along each frame's longest side

    def __post_init__(self) -> None:
        check_qp(self.qp)
        if self.qp > 16:
            raise InputError(f"qp {self.qp}: meshoptimizer's places have 16 bits; give 2 to 16")

    def encode(self, sequence: MeshSequence, progress: Progress | None = None) -> bytes:
        frames = map(self._frame, reported(sequence, progress, "code", len(sequence)))
        return msgspec.msgpack.encode([zlib.compress(msgspec.msgpack.encode(frame), 9) for frame in frames])

    def _frame(self, mesh: Mesh) -> _Frame:
        if mesh.is_empty:
            return _Frame(0, 0, (0.0, 0.0, 0.0), 1.0, b"", b"")
        package = _package()
        corners = np.ascontiguousarray(mesh.faces.reshape(-1), np.uint32)
        package.optimize_vertex_cache_strip(corners, corners.copy(), len(corners), len(mesh.vertices))
        used, first = np.unique(corners, return_index=True)
        order = used[np.argsort(first)]
        renamed = np.zeros(len(mesh.vertices), np.uint32)
        renamed[order] = np.arange(len(order))
        corners = renamed[corners]
        low, high = mesh.vertices[order].min(axis=0), mesh.vertices[order].max(axis=0)
        step = max(float((high - low).max()), 1e-12) / (2**self.qp - 1)
        places = np.zeros((len(order), 4), np.uint16)  # a vertex has a multiple of four bytes
        places[:, :3] = np.rint((mesh.vertices[order] - low) / step)
        vertices = bytes(package.encode_vertex_buffer(places, len(order), 8))
        indices = bytes(package.encode_index_buffer(corners, len(corners), len(order)))
        return _Frame(len(order), len(mesh.faces), tuple(low.tolist()), step, vertices, indices)

    def decode(self, data: bytes) -> Sequence[Mesh]:
        each = map(zlib.decompress, msgspec.msgpack.decode(data, type=list[bytes]))
        return [_mesh(msgspec.msgpack.decode(frame, type=_Frame)) for frame in each]


def _mesh(frame: _Frame) -> Mesh:
    if not frame.faces:
        return Mesh.empty()
    package = _package()
    places = package.decode_vertex_buffer(frame.vertices, 8, frame.places, np.dtype((np.uint16, 4)))
    corners = np.asarray(package.decode_index_buffer(3 * frame.faces, 4, frame.corners))
    faces = corners.reshape(-1, 3).astype(np.int32)
    return Mesh.of(np.asarray(frame.low) + frame.step * places[:, :3], faces)


def _package() -> Any:
    try:
        import meshoptimizer
    except ImportError:
        raise InputError("meshoptimizer is not installed; pip install 'meshreel-bench[meshoptimizer]'") from None
    return meshoptimizer
