"""Documents of binary glTF 2: bytes -> entries, arrays, pictures, and the names of the entries that nothing read."""

from __future__ import annotations

from base64 import b64decode
from collections.abc import Iterator
from functools import cache, partial
from typing import Any

import numpy as np

from ..texts import json_of
from ..types import Texture
from .glb_file import MESHOPT, TRIANGLES, check_meshopt
from .pictures import parse_picture
from .polygons import Unreadable

DRACO, QUANTIZED = "KHR_draco_mesh_compression", "KHR_mesh_quantization"
MESHOPTS = (MESHOPT, "KHR_meshopt_compression")
_COMPONENTS = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}
# Values that a file may claim: some, more for each of its bytes, and in all (guess).
_FREE, _DENSEST, _MOST = 1 << 20, 64, 1 << 26
# Members that say nothing of surface, colours or time (glTF 2.0, section 5).
_SILENT = {"name", "extras", "generator", "copyright", "min", "max", "target", "byteLength", "mimeType", "doubleSided"}
_SILENT |= {"skeleton", "magFilter", "minFilter", "extensionsUsed", "type"}
_LISTS = {"accessors", "bufferViews", "buffers", "images", "materials", "meshes", "nodes", "samplers", "skins"}
_LISTS |= {"textures"}


class Entry:
    """An object of the description, which notes the members that are read."""

    def __init__(self, members: dict[str, Any], name: str) -> None:
        self._members, self.name = members, name
        self._inside: dict[str, Any] = {}  # what was read
        self._is_passed = False

    def get(self, key: str, default: Any = None) -> Any:
        """Return a member, objects as entries; `default` if there is none."""
        if key not in self._inside:
            self._inside[key] = _entries(self._members.get(key), f"{self.name}.{key}".lstrip("."))
        found = self._inside[key]
        return default if found is None else found

    def whole(self, key: str, default: int | None = None) -> int:
        """Return a whole number that is not negative. Raises Unreadable for anything else."""
        value = self.get(key, default)
        if not isinstance(value, int) or isinstance(value, bool) or value < 0:
            raise Unreadable(f"GLB has {key} {str(value)[:40]!r} in its {self.name or 'description'}")
        return value

    def numbers(self, key: str, default: tuple[float, ...]) -> np.ndarray:
        """Return numbers, as many as the default has. Raises Unreadable for anything else."""
        values = np.asarray(self.get(key, default), dtype=np.float64)
        if values.shape != (len(default),) or not np.isfinite(values).all():
            raise Unreadable(f"GLB has {len(default)} numbers expected in {self.name}.{key}")
        return values

    def items(self) -> Iterator[tuple[str, Any]]:
        """Yield all members."""
        return ((key, self.get(key)) for key in self._members)

    def __contains__(self, key: str) -> bool:
        return key in self._members

    def pass_over(self) -> None:
        """Count all members as read: of an entry that is named, or of nothing that is shown."""
        self._is_passed = True

    def unread(self) -> Iterator[str]:
        """Yield the names of members that were not read, of this entry and of those in it."""
        for key in () if self._is_passed else self._members.keys() - _SILENT:
            if key not in self._inside and (self.name or key not in _LISTS):
                yield f"{self.name}.{key}".lstrip(".")
            elif isinstance(inside := self._inside.get(key), Entry):
                yield from inside.unread()
            elif isinstance(inside, list):  # entries that nothing refers to do not count
                yield from (word for one in inside if isinstance(one, Entry) and one._inside for word in one.unread())


def _entries(value: Any, name: str) -> Any:
    if isinstance(value, dict):
        return Entry(value, name)
    return [_entries(item, name) for item in value] if isinstance(value, list) else value


class Gltf:
    """The description of a GLB file, and its arrays."""

    def __init__(self, data: bytes) -> None:
        """Read the description. Raises Unreadable if the file is no GLB 2, or refers to what it does not have."""
        head = np.frombuffer(data[:20].ljust(20, b"\0"), dtype="<u4")
        magic, version, total, length = data[:4], int(head[1]), int(head[2]), int(head[3])
        if magic != b"glTF" or version != 2:
            raise Unreadable(f"GLB 2 header expected, found {magic!r} version {version}")
        if total > len(data) or 20 + length > len(data):
            raise Unreadable(f"GLB announces {total} bytes but has {len(data)} (truncated?)")
        try:
            tree = json_of(data[20 : 20 + length])
        except ValueError as error:
            raise Unreadable(f"GLB scene description is no JSON ({error})") from None
        if not isinstance(tree, dict):
            raise Unreadable("GLB scene description is no JSON object")
        begin, size = 28 + length, int.from_bytes(data[20 + length : 24 + length], "little")
        self._binary, self._file_size = memoryview(data)[begin : min(begin + size, total)], len(data)
        self.most = min(_FREE + _DENSEST * len(data), _MOST)
        self.tree = Entry(tree, "")
        self.array, self.texture = cache(self._read_array), cache(self._read_texture)
        self._buffer, self._view = cache(self._read_buffer), cache(self._read_view)

    def item(self, kind: str, number: int) -> Entry:
        """Return an entry of a list of the description, as of "meshes". Raises Unreadable if it has no such entry."""
        items = self.tree.get(kind, [])
        if not isinstance(number, int) or not isinstance(items, list) or not 0 <= number < len(items):
            raise Unreadable(f"GLB refers to entry {str(number)[:20]} of its {kind}, which is not there")
        if not isinstance(items[number], Entry):
            raise Unreadable(f"GLB has no object as entry {number} of its {kind}")
        return items[number]

    def _read_array(self, number: int) -> np.ndarray:
        """Return the values of an accessor, a row for each; normalized ones as fractions of 1."""
        entry = self.item("accessors", number)
        dtype, width = _COMPONENTS.get(entry.whole("componentType")), _WIDTHS.get(entry.get("type"))
        count, offset = entry.whole("count"), entry.whole("byteOffset", 0)
        if dtype is None or width is None:
            raise Unreadable(f"GLB accessor {number} has an unknown type")
        if count * width > self.most:
            raise Unreadable(f"GLB announces {count} values in {self._file_size} bytes")
        if "bufferView" in entry:
            values = self._rows(entry.whole("bufferView"), offset, np.dtype(dtype), count, width)
        else:
            values = np.zeros((count, width), dtype)
        sparse = entry.get("sparse")
        if isinstance(sparse, Entry):
            values = self._replaced(values, sparse)
        if entry.get("normalized") is True and values.dtype.kind in "iu":
            return np.maximum(values.astype(np.float64) / np.iinfo(values.dtype).max, -1.0)
        return values

    def _replaced(self, values: np.ndarray, sparse: Entry) -> np.ndarray:
        """Return values of which some are replaced, as a sparse accessor tells (glTF 2.0, section 3.6.2.3)."""
        places, others, count = sparse.get("indices"), sparse.get("values"), sparse.whole("count")
        if not isinstance(places, Entry) or not isinstance(others, Entry) or count > len(values):
            raise Unreadable(f"GLB has a sparse accessor of {count} of {len(values)} values")
        kind = np.dtype(_COMPONENTS.get(places.whole("componentType"), "<f4"))
        at = self._rows(places.whole("bufferView"), places.whole("byteOffset", 0), kind, count, 1)[:, 0]
        if kind.kind != "u" or (at >= len(values)).any():
            raise Unreadable(f"GLB has a sparse accessor that replaces none of its {len(values)} values")
        values = values.copy()
        view, offset = others.whole("bufferView"), others.whole("byteOffset", 0)
        values[at] = self._rows(view, offset, values.dtype, count, values.shape[1])
        return values

    def _rows(self, view: int, offset: int, dtype: np.dtype, count: int, width: int) -> np.ndarray:
        data, stride = self._view(view)
        stride = stride or dtype.itemsize * width
        if count and offset + (count - 1) * stride + dtype.itemsize * width > len(data):
            raise Unreadable(f"GLB has an array of {count} rows beyond the {len(data)} bytes of its buffer view {view}")
        if not count:
            return np.zeros((0, width), dtype)
        return np.ndarray((count, width), dtype, data, offset, (stride, dtype.itemsize))

    def _read_view(self, number: int) -> tuple[memoryview, int]:
        """Return the bytes of a buffer view, and the distance of its rows; 0: they follow one another."""
        view = self.item("bufferViews", number)
        extensions = view.get("extensions")
        if isinstance(extensions, Entry):
            packed = next((extensions.get(name) for name in MESHOPTS if name in extensions), None)
            if isinstance(packed, Entry):
                for key in ("buffer", "byteOffset"):  # of a buffer for readers without the extension
                    view.get(key)
                return self._unpacked(packed), view.whole("byteStride", 0)
        return self._part(view), view.whole("byteStride", 0)

    def _part(self, view: Entry) -> memoryview:
        buffer, offset, size = self._buffer(view.whole("buffer")), view.whole("byteOffset", 0), view.whole("byteLength")
        if offset + size > len(buffer):
            raise Unreadable(f"GLB has a buffer view that ends at byte {offset + size} of {len(buffer)}")
        return buffer[offset : offset + size]

    def _unpacked(self, packed: Entry) -> memoryview:
        """Decode a stream of meshoptimizer (EXT_meshopt_compression)."""
        package, stream = check_meshopt(), bytes(self._part(packed))
        count, stride, mode = packed.whole("count"), packed.whole("byteStride"), packed.get("mode")
        if count * stride > 4 * self.most or not 0 < stride <= 256:
            raise Unreadable(f"GLB announces {count} rows of {stride} bytes in {self._file_size} bytes")
        if mode in (TRIANGLES, "INDICES"):
            decode = package.decode_index_buffer if mode == TRIANGLES else package.decode_index_sequence
            return memoryview(decode(count, 4, stream).astype(f"<u{stride}").tobytes())
        if mode != "ATTRIBUTES":
            raise Unreadable(f"GLB has a stream of mode {str(mode)[:20]!r}")
        rows = package.decode_vertex_buffer(count, stride, stream, dtype=np.dtype((np.void, stride)))
        chosen = packed.get("filter", "NONE")
        filters = {"OCTAHEDRAL": "oct", "QUATERNION": "quat", "EXPONENTIAL": "exp"}
        if chosen in filters:
            rows = getattr(package, f"decode_filter_{filters[chosen]}")(rows, count, stride)
        elif chosen != "NONE":
            raise Unreadable(f"GLB has a stream with filter {str(chosen)[:20]!r}")
        return memoryview(rows.tobytes())

    def _read_buffer(self, number: int) -> memoryview:
        uri = self.item("buffers", number).get("uri")
        if uri is None and number == 0:
            return self._binary
        if isinstance(uri, str) and uri.startswith("data:"):
            return memoryview(b64decode(uri.split(",", 1)[-1]))
        raise Unreadable(f"GLB has arrays in another file ({str(uri)[:60]}); put them into the GLB")

    def _read_texture(self, number: int) -> tuple[Texture | None, Entry, str]:
        """Return a texture, its sampler, and why there is none."""
        texture, nothing = self.item("textures", number), Entry({}, "samplers")
        sampler = self.item("samplers", texture.whole("sampler")) if "sampler" in texture else nothing
        source, others = texture.get("source"), texture.get("extensions", nothing)
        for name in ("EXT_texture_webp", "EXT_texture_avif"):
            if source is None and name in others:
                source = others.get(name).get("source")
        if source is None:
            codings = ", ".join(name for name, _ in others.items()) or "none"
            return None, sampler, f"a texture (in a coding that is not read: {codings})"
        image = self.item("images", source)
        uri, view = image.get("uri"), image.get("bufferView")
        if isinstance(uri, str) and uri.startswith("data:"):
            data = b64decode(uri.split(",", 1)[-1])
        elif view is not None:
            data = bytes(self._view(view)[0])
        else:
            return None, sampler, "a texture (it is in another file)"
        return Texture(partial(parse_picture, data, "the texture of a GLB")), sampler, ""

    def draco(self, packed: Entry, most: int) -> tuple[np.ndarray, dict[str, np.ndarray]]:
        """Decode the faces and attributes of a primitive (KHR_draco_mesh_compression), `most` vertices and faces."""
        data = bytes(self._view(packed.whole("bufferView"))[0])
        points, faces = _claims_of_draco(data)
        if max(points, faces) > most:
            raise Unreadable(f"GLB has a Draco stream of {points} vertices and {faces} faces, more than it says")
        import DracoPy

        mesh = DracoPy.decode(data)
        names = packed.get("attributes")
        arrays = {name: mesh.get_attribute_by_unique_id(number) for name, number in names.items()}
        data_of = {name: np.asarray(found["data"]) for name, found in arrays.items() if found}
        return np.asarray(mesh.faces).reshape(-1), data_of


def _claims_of_draco(data: bytes) -> tuple[int, int]:
    """Return the points and faces that a Draco mesh says it has (Draco's bitstream specification, version 2.2)."""
    if data[:7] != b"DRACO\2\2" or data[7] != 1 or data[9:11] != b"\0\0":
        raise Unreadable("GLB has a Draco stream of another kind than meshes of version 2.2")
    at = 12 if data[8] == 1 else 11  # behind the kind of traversal
    numbers = []
    for _ in range(2):
        value = shift = 0
        while True:
            if at >= len(data) or shift > 28:
                raise Unreadable("GLB has a Draco stream that is damaged")
            byte, at = data[at], at + 1
            value, shift = value | (byte & 127) << shift, shift + 7
            if byte < 128:
                break
        numbers.append(value)
    return (numbers[0], numbers[1]) if data[8] == 1 else (numbers[1], numbers[0])
