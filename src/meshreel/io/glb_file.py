"""Writer of GLB files (binary glTF 2.0), whose binary chunk is never in memory as a whole.

Textures and colours of vertices are drawn unlit (KHR_materials_unlit); a face has one or the other, because glTF
multiplies them: textured vertices keep their colours under a name that viewers ignore.
"""

from __future__ import annotations

import json
import shutil
from dataclasses import dataclass
from io import BytesIO
from typing import IO, Any, BinaryIO

import numpy as np
from jaxtyping import Bool, Float32, Int32, Int64, UInt8, UInt16, UInt32

from ..errors import InputError, needed
from .pictures import pack_picture
from .polygons import shares_of

MOST_BYTES = (1 << 32) - 1  # of a GLB file, whose header has 32 bits for its length (glTF 2.0, "GLB File Format")
COLORS, PLACES = "COLOR_0", "TEXCOORD_0"
PASSED_OVER = "_COLOR_0"  # a name that begins with _ is an application's own (glTF 2.0)
_COMPONENTS = {"f4": 5126, "i2": 5122, "u2": 5123, "u4": 5125}  # of accessors, by numpy's names
_VERTICES, _INDICES = 34962, 34963  # targets of a buffer view (glTF 2.0)
_RESTART = 65535  # largest value of 16 bits: restarts a primitive, so it is no index (glTF 2.0)
_UNLIT = "KHR_materials_unlit"
MESHOPT = "EXT_meshopt_compression"
_REQUIRED = [MESHOPT, "KHR_mesh_quantization"]
ATTRIBUTES, TRIANGLES = "ATTRIBUTES", "TRIANGLES"  # modes of meshoptimizer's streams (EXT_meshopt_compression)
_MATT = {"metallicFactor": 0.0, "roughnessFactor": 0.9}  # for viewers without KHR_materials_unlit


@dataclass(frozen=True, slots=True)
class Faces:
    """Faces of a mesh, a mask of the textured ones, and the materials of these and of the others."""

    corners: Int32[np.ndarray, "F 3"]
    pictured: Bool[np.ndarray, " F"]
    picture: int | None
    material: int | None


class GlbFile:
    """A GLB file in the making."""

    def __init__(
        self, spool: IO[bytes] | BytesIO, name: str, remedy: str = "write fewer", compressed: bool = False
    ) -> None:
        """Write arrays to an empty `spool` first; `name` begins error messages, `remedy` ends that about its length."""
        self._spool, self._name, self._remedy = spool, name, remedy
        self._size = self._plain = 0  # bytes written, and those of the buffer that compressed views stand for
        self._tree: dict[str, list[Any]] = {"extensionsRequired": _REQUIRED.copy()} if compressed else {}
        self._used = {*_REQUIRED} if compressed else set[str]()
        self._loose = bytearray()  # of the newest view, until it is complete
        self._coding: tuple[str, int, int] | None = None  # of the newest view: mode, stride, bits of the filter
        self.compressed = compressed

    def add(self, kind: str, item: dict[str, Any]) -> int:
        """Append an item to a list of the description, such as "meshes", and return its number."""
        self._tree.setdefault(kind, []).append(item)
        return len(self._tree[kind]) - 1

    def use(self, extension: str) -> None:
        """Name an extension that the file uses, and that viewers may do without."""
        self._used.add(extension)

    def open_vertices(self, stride: int = 12, bits: int = 0) -> None:
        """Begin a view of vertex attributes of `stride` bytes; compressed floats are rounded to 2^-bits, if not 0."""
        self.open_view((ATTRIBUTES, stride, bits), byteStride=stride, target=_VERTICES)

    def open_view(self, coding: tuple[str, int, int] | None = (ATTRIBUTES, 4, 0), **others: int) -> None:
        """Begin a buffer view; `coding` is its compression in compressed files, None for no compression."""
        self._close()
        self._coding = coding if self.compressed else None
        self.add("bufferViews", {"buffer": 0, "byteOffset": self._size, "byteLength": 0, **others})

    def put(self, values: np.ndarray, kind: str, what: object = "its arrays", bounded: bool = False) -> int:
        """Append values to the newest view and return the number of their accessor."""
        number, view = len(self._tree["bufferViews"]) - 1, self._tree["bufferViews"][-1]
        accessor: dict[str, Any] = {"bufferView": number, "byteOffset": view["byteLength"]}
        accessor |= {"componentType": _COMPONENTS[values.dtype.str[1:]], "count": len(values), "type": kind}
        if bounded:
            low, high = values.min(axis=0), values.max(axis=0)
            accessor |= {"min": np.atleast_1d(low).tolist(), "max": np.atleast_1d(high).tolist()}
        stride = view.get("byteStride", 0) // values.itemsize
        if values.ndim > 1 and stride > values.shape[1]:
            values = np.pad(values, ((0, 0), (0, stride - values.shape[1])))
        self._append(values.astype(values.dtype.newbyteorder("<"), copy=False).tobytes(), what)
        return self.add("accessors", accessor)

    def put_places(self, uv: Float32[np.ndarray, "V 2"], what: object = "its arrays") -> int:
        """Append texture coordinates, as in `Mesh.uv`; glTF counts from the upper row, and has no NaN."""
        self.open_vertices(8)
        return self.put(np.nan_to_num(np.stack([uv[:, 0], 1 - uv[:, 1]], axis=1)), "VEC2", what)

    def put_picture(self, pixels: UInt8[np.ndarray, "H W 3"], what: object = "its picture") -> int:
        """Append a picture and return the number of its material."""
        data = pack_picture(pixels)
        self.open_view(None)
        self._append(data, what)
        self._tree["bufferViews"][-1]["byteLength"] = len(data)
        image = self.add("images", {"bufferView": len(self._tree["bufferViews"]) - 1, "mimeType": "image/png"})
        return self.put_unlit({"baseColorTexture": {"index": self.add("textures", {"source": image})}})

    def put_unlit(self, surface: dict[str, Any]) -> int:
        """Add an unlit material, and return its number."""
        self._used.add(_UNLIT)
        looks = {"pbrMetallicRoughness": surface | _MATT, "extensions": {_UNLIT: {}}}
        return self.add("materials", {"doubleSided": True} | looks)

    def put_faces(self, faces: Faces, frames: list[dict[str, int]], what: object = "its faces") -> list[dict[str, Any]]:
        """Append faces and return primitives: textured, others. `frames`: accessors of the first and differences."""
        primitives = []
        halves = (faces.pictured, faces.picture, COLORS), (~faces.pictured, faces.material, PLACES)
        for chosen, material, hidden in halves:
            if not chosen.any():
                continue
            first, *targets = [{name: at for name, at in frame.items() if name != hidden} for frame in frames]
            if hidden == COLORS and COLORS in frames[0]:
                first[PASSED_OVER] = frames[0][COLORS]
            corners = faces.corners[chosen].reshape(-1)
            short = int(corners.max()) < _RESTART
            self.open_view((TRIANGLES, 2 if short else 4, 0), target=_INDICES)
            indices = self.put(corners.astype("<u2" if short else "<u4"), "SCALAR", what)
            primitive = {"attributes": first, "indices": indices, "mode": 4}
            primitive |= {} if material is None else {"material": material}
            primitives.append(primitive | ({"targets": targets} if targets else {}))
        return primitives

    def finish(self, file: BinaryIO | BytesIO, scene: dict[str, Any]) -> None:
        """Write the complete file: header, description, and the spooled arrays."""
        self._close()
        buffers: dict[str, Any] = {"buffers": [{"byteLength": self._size}]} if self._size else {}
        if self._plain:
            buffers["buffers"].append({"byteLength": self._plain, "extensions": {MESHOPT: {"fallback": True}}})
        used = {"extensionsUsed": sorted(self._used)} if self._used else {}
        text = json.dumps(scene | self._tree | used | buffers, separators=(",", ":"), allow_nan=False).encode()
        text += b" " * (-len(text) % 4)
        chunks = [(b"JSON", len(text)), *([(b"BIN\0", self._size)] if self._size else [])]
        total = 12 + sum(8 + size for _, size in chunks)
        self._check(total, "the description of the scene")
        file.write(b"glTF" + _words(2, total) + _words(len(text)) + b"JSON" + text)
        if self._size:
            file.write(_words(self._size) + b"BIN\0")
            self._spool.seek(0)
            shutil.copyfileobj(self._spool, file, 1 << 20)

    def _close(self) -> None:
        """Compress the newest view, which then refers to a buffer that exists only uncompressed."""
        if self._coding is None or not self._loose:
            return
        view, (mode, stride, bits), data = self._tree["bufferViews"][-1], self._coding, bytes(self._loose)
        filtered = exponential(np.frombuffer(data, "<f4"), bits).astype("<u4").tobytes() if bits else data
        stream = pack_stream(filtered, mode, stride)
        about = {"byteLength": len(stream), "byteStride": stride, "count": len(data) // stride, "mode": mode}
        about |= {"filter": "EXPONENTIAL"} if bits else {}
        view["extensions"] = {MESHOPT: {"buffer": 0, "byteOffset": self._size} | about}
        view |= {"buffer": 1, "byteOffset": self._plain, "byteLength": len(data)}
        self._plain += len(data) + -len(data) % 4
        self._loose.clear()
        self._write(stream, "its arrays")

    def _append(self, data: bytes, what: object) -> None:
        if self._coding is None:
            self._tree["bufferViews"][-1]["byteLength"] += self._write(data, what)
        else:
            self._loose += data
            self._tree["bufferViews"][-1]["byteLength"] += len(data)

    def _write(self, data: bytes, what: object) -> int:
        """Write with padding to a multiple of 4 bytes, and return the number of bytes."""
        data += bytes(-len(data) % 4)
        self._check(self._size + len(data), what)
        self._spool.write(data)
        self._size += len(data)
        return len(data)

    def _check(self, size: int, what: object) -> None:
        if size > MOST_BYTES:
            text = f"{self._name}: at {what} it has more than the {MOST_BYTES} bytes of a GLB file"
            raise InputError(f"{text}; {self._remedy}")


def to_linear(colors: UInt8[np.ndarray, "V 3"]) -> UInt16[np.ndarray, "V 3"]:
    """Convert sRGB to linear light, full scale 65535 (IEC 61966-2-1)."""
    s = np.arange(256) / 255
    light = np.where(s <= 0.04045, s / 12.92, ((s + 0.055) / 1.055) ** 2.4)
    return np.rint(65535 * light).astype(np.uint16)[colors]


def from_linear(light: np.ndarray) -> UInt8[np.ndarray, "V 3"]:
    """Convert linear light, full-scale integers or fractions of 1, to sRGB. Raises Unreadable far outside of these."""
    shares = shares_of(light, np.iinfo(light.dtype).max if light.dtype.kind in "iu" else 1.0)
    s = np.where(shares <= 0.0031308, 12.92 * shares, 1.055 * shares ** (1 / 2.4) - 0.055)
    return np.rint(255 * s).astype(np.uint8)


def light(colors: UInt8[np.ndarray, "V 3"]) -> Float32[np.ndarray, "V 3"]:
    """Convert sRGB to fractions of linear light, as in glTF and USD."""
    return (to_linear(colors) / np.float32(65535)).astype(np.float32)


def _words(*values: int) -> bytes:
    return np.array(values, dtype="<u4").tobytes()


def check_meshopt() -> Any:
    """Return the package. Raises InputError if it is not installed."""
    with needed("meshoptimizer is not installed; pip install 'meshreel[glb]'"):
        import meshoptimizer
    return meshoptimizer


def pack_stream(data: bytes, mode: str, stride: int) -> bytes:
    """Encode vertices of `stride` bytes, a multiple of 4, or corners of triangles of 2 or 4 bytes, as a stream."""
    package, count = check_meshopt(), len(data) // stride
    if mode == TRIANGLES:
        package.encode_index_version(1)  # of streams in the extension, as 0 for vertices
        corners = np.frombuffer(data, f"<u{stride}").astype(np.uint32)
        return bytes(package.encode_index_buffer(corners, count, int(corners.max()) + 1))
    package.encode_vertex_version(0)
    return bytes(package.encode_vertex_buffer(np.frombuffer(data, np.uint8).reshape(-1, stride), count, stride))


def exponential(values: Float32[np.ndarray, " N"], bits: int) -> UInt32[np.ndarray, " N"]:
    """Round to multiples of 2^-bits in the layout of filter EXPONENTIAL: a 24-bit factor, and -bits above it."""
    factors = np.rint(values.astype(np.float64) * 2**bits).astype(np.int64)
    return ((factors & 0xFFFFFF) | ((-bits & 0xFF) << 24)).astype(np.uint32)


def by_use(corners: Int32[np.ndarray, "F 3"], count: int) -> tuple[Int64[np.ndarray, " W"], Int32[np.ndarray, "F 3"]]:
    """Return vertices of `count` in the order of their use, and faces in an order that uses them together."""
    ordered = np.zeros(corners.size, np.uint32)
    check_meshopt().optimize_vertex_cache(ordered, corners.reshape(-1).astype(np.uint32), corners.size, count)
    used, first = np.unique(ordered, return_index=True)
    order = used[np.argsort(first)].astype(np.int64)
    renamed = np.zeros(count, np.int32)
    renamed[order] = np.arange(len(order))
    return order, renamed[ordered].reshape(-1, 3)
