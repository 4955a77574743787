"""Independent player of animated GLB files, written from the glTF 2.0 specification."""

import io
import json
import struct
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from meshreel.io.glb_file import from_linear
from meshreel.types import Mesh, Texture

_TYPES = {5126: "<f4", 5125: "<u4", 5123: "<u2"}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3}


class PlayedGlb:
    """A file that is wholly in memory; only what meshreel writes of glTF is known."""

    def __init__(self, path: Path) -> None:
        data = path.read_bytes()
        magic, version, length = struct.unpack_from("<4sII", data)
        assert (magic, version, length) == (b"glTF", 2, len(data))
        size, kind = struct.unpack_from("<I4s", data, 12)
        assert kind == b"JSON" and size % 4 == 0
        self.tree: dict[str, Any] = json.loads(data[20 : 20 + size])
        self.binary = b""
        if 20 + size < length:
            rest, kind = struct.unpack_from("<I4s", data, 20 + size)
            assert kind == b"BIN\0" and 28 + size + rest == length
            self.binary = data[28 + size :]
            assert self.tree["buffers"] == [{"byteLength": rest}]

    @property
    def key_times(self) -> list[float]:
        """When anything changes, s."""
        samplers = [sampler for animation in self.tree.get("animations", []) for sampler in animation["samplers"]]
        return sorted({float(time) for sampler in samplers for time in self.values(sampler["input"])[:, 0]})

    def values(self, number: int) -> np.ndarray:
        """The numbers of an accessor, a row each, which keep to its bounds."""
        accessor = self.tree["accessors"][number]
        view = self.tree["bufferViews"][accessor["bufferView"]]
        dtype, width = np.dtype(_TYPES[accessor["componentType"]]), _WIDTHS[accessor["type"]]
        assert (
            view.get("byteStride", 4 * width) == 4 * width
            and accessor["byteOffset"] % 4 == 0
            and view["byteOffset"] % 4 == 0
        )
        assert accessor["byteOffset"] + accessor["count"] * width * dtype.itemsize <= view["byteLength"]
        start = view["byteOffset"] + accessor["byteOffset"]
        found = np.frombuffer(self.binary, dtype, accessor["count"] * width, start).reshape(-1, width)
        if "min" in accessor:
            assert found.min(axis=0).tolist() == accessor["min"] and found.max(axis=0).tolist() == accessor["max"]
        return found

    def shown(self, time: float | None) -> dict[str, list[tuple[Mesh, np.ndarray]]]:
        """What is seen, mesh and normals, by part of the scene; without a time as it is before it plays."""
        if not self.tree.get("nodes"):
            return {}
        assert [scene["nodes"][0] for scene in self.tree["scenes"]] == [0]  # beside it, perhaps, a camera
        root = self.tree["nodes"][0]
        matrix = np.array(root.get("matrix", np.eye(4)), np.float64).reshape(4, 4).T
        found: dict[str, list[tuple[Mesh, np.ndarray]]] = {}
        for part in root["children"]:
            node = self.tree["nodes"][part]
            meshes = [self._mesh(child, matrix, time) for child in node["children"]]
            found[node["name"]] = [mesh for mesh in meshes if mesh is not None]
        return found

    def _mesh(self, number: int, matrix: np.ndarray, time: float | None) -> tuple[Mesh, np.ndarray] | None:
        node = self.tree["nodes"][number]
        scale = self._animated(number, "scale", time, np.array(node.get("scale", [1, 1, 1]), np.float32))
        assert set(scale.tolist()) in ({0.0}, {1.0})
        if not scale.any():
            return None
        parts = [
            self._primitive(number, each, matrix, time) for each in self.tree["meshes"][node["mesh"]]["primitives"]
        ]
        (mesh, normals), *others = parts
        for other, same in others:  # faces of the same vertices, with another material
            np.testing.assert_array_equal(mesh.vertices, other.vertices)
            np.testing.assert_array_equal(normals, same)
            uv = np.concatenate([mesh.uv, np.full((len(other.faces), 3, 2), np.nan, np.float32)])
            faces = np.concatenate([mesh.faces, other.faces])
            mesh = Mesh(mesh.vertices, faces, other.colors, uv, mesh.texture)
        return mesh, normals

    def _primitive(
        self, number: int, primitive: dict[str, Any], matrix: np.ndarray, time: float | None
    ) -> tuple[Mesh, np.ndarray]:
        targets = primitive.get("targets", [])
        weights = self._animated(number, "weights", time, np.zeros(len(targets), np.float32))
        assert np.count_nonzero(weights) <= 2  # old viewers take no more than some
        attributes = {name: self.values(accessor) for name, accessor in primitive["attributes"].items()}
        for weight, target in zip(weights, targets, strict=True):
            for name, accessor in target.items() if weight else ():
                attributes[name] = attributes[name] + weight * self.values(accessor)  # float32, as a GPU has it
        vertices = attributes["POSITION"] @ matrix[:3, :3].T + matrix[:3, 3]
        faces = self.values(primitive["indices"]).reshape(-1, 3)
        assert primitive.get("mode", 4) == 4
        mesh = Mesh.of(vertices, faces)
        material = self.tree["materials"][primitive["material"]]
        colored = "COLOR_0" in attributes or "TEXCOORD_0" in attributes
        assert ("KHR_materials_unlit" in material.get("extensions", {})) == colored
        if "COLOR_0" in attributes:
            mesh = replace(mesh, colors=from_linear(attributes["COLOR_0"]))
        if "TEXCOORD_0" in attributes:
            texture = self.tree["textures"][material["pbrMetallicRoughness"]["baseColorTexture"]["index"]]
            uv = attributes["TEXCOORD_0"][mesh.faces] * np.float32([1, -1]) + np.float32([0, 1])
            mesh = replace(mesh, uv=uv, texture=Texture.of(self._picture(self.tree["images"][texture["source"]])))
        return mesh, attributes["NORMAL"] @ matrix[:3, :3].T

    def _picture(self, image: dict[str, Any]) -> np.ndarray:
        view = self.tree["bufferViews"][image["bufferView"]]
        assert image["mimeType"] == "image/png" and view["byteOffset"] % 4 == 0
        data = self.binary[view["byteOffset"] :][: view["byteLength"]]
        return np.asarray(Image.open(io.BytesIO(data)))

    def _animated(self, node: int, path: str, time: float | None, still: np.ndarray) -> np.ndarray:
        """The value of a channel at a time, or `still` where there is none."""
        for animation in self.tree.get("animations", []) if time is not None else ():
            for channel in animation["channels"]:
                if channel["target"] == {"node": node, "path": path}:
                    sampler = animation["samplers"][channel["sampler"]]
                    keys = self.values(sampler["input"])[:, 0]
                    values = self.values(sampler["output"]).reshape(len(keys), -1)
                    return _sampled(keys, values, np.float32(time), sampler["interpolation"])
        return still


def _sampled(keys: np.ndarray, values: np.ndarray, time: np.float32, interpolation: str) -> np.ndarray:
    """Held before the first key and behind the last."""
    assert (np.diff(keys) > 0).all() and keys[0] >= 0
    last = int(np.searchsorted(keys, time, side="right")) - 1
    if last < 0 or last == len(keys) - 1 or interpolation == "STEP":
        return values[max(last, 0)]
    assert interpolation == "LINEAR"
    share = (time - keys[last]) / (keys[last + 1] - keys[last])
    return (1 - share) * values[last] + share * values[last + 1]
