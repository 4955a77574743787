"""Small files with every property, attribute, extension and keyword of the mesh formats' specifications, one a file.

Each case is a plain file with one thing more, which would change surface or colours if it were followed. Readers follow
it, name it or refuse it; `docs/formats.md` is made of what they do with these files.
"""

from __future__ import annotations

import base64
import copy
import io
import json
import struct
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

Tree = dict[str, Any]
POINTS = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0.5]], np.float32)
FACES = np.array([[0, 1, 2], [2, 1, 3]], np.uint16)
PLACES = np.array([[0.1, 0.1], [0.9, 0.1], [0.1, 0.9], [0.8, 0.7]], np.float32)
PIXELS = np.arange(4 * 4 * 3, dtype=np.uint8).reshape(4, 4, 3) * 5


def png(pixels: np.ndarray = PIXELS, kind: str = "PNG") -> bytes:
    file = io.BytesIO()
    Image.fromarray(pixels).save(file, kind)
    return file.getvalue()


@dataclass(frozen=True)
class Case:
    """A file with one thing more than the plain file of its kind."""

    format: str
    feature: str  # as the specification calls it
    files: dict[str, bytes]  # the first is the mesh

    def write(self, folder: Path) -> Path:
        """Write the files; return the path of the mesh."""
        for name, data in self.files.items():
            (folder / name).write_bytes(data)
        return folder / next(iter(self.files))


class Glb:
    """A GLB file in the making: a surface of two triangles with a picture, unless it is plain."""

    def __init__(self, pictured: bool = True) -> None:
        self.binary = b""
        self.tree: Tree = {"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}]}
        self.tree |= {"accessors": [], "bufferViews": [], "buffers": [{}]}
        attributes = {"POSITION": self.add(POINTS)}
        self.primitive: Tree = {"attributes": attributes, "indices": self.add(FACES.reshape(-1))}
        self.tree["meshes"] = [{"primitives": [self.primitive]}]
        self.material: Tree = {}
        if pictured:
            attributes["TEXCOORD_0"] = self.add(PLACES)
            self.tree |= {"images": [{"bufferView": self.view(png()), "mimeType": "image/png"}]}
            self.tree |= {"samplers": [{}], "textures": [{"source": 0, "sampler": 0}]}
            self.material |= {"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}
            self.tree["materials"] = [self.material]
            self.primitive["material"] = 0

    def view(self, data: bytes, **others: int) -> int:
        self.binary += bytes(-len(self.binary) % 4)
        view = {"buffer": 0, "byteOffset": len(self.binary), "byteLength": len(data), **others}
        self.tree["bufferViews"].append(view)
        self.binary += data
        return len(self.tree["bufferViews"]) - 1

    def add(self, values: Any, **others: Any) -> int:
        values = np.asarray(values)
        kinds = {"i1": 5120, "u1": 5121, "i2": 5122, "u2": 5123, "u4": 5125, "f4": 5126}
        shapes = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4", 16: "MAT4"}
        width = 1 if values.ndim == 1 else values.shape[1]
        accessor = {"bufferView": self.view(values.tobytes()), "count": len(values), "type": shapes[width]}
        self.tree["accessors"].append(accessor | {"componentType": kinds[values.dtype.str[1:]], **others})
        return len(self.tree["accessors"]) - 1

    def pack(self) -> bytes:
        binary = self.binary + bytes(-len(self.binary) % 4)
        self.tree["buffers"][0]["byteLength"] = len(binary)
        text = json.dumps(self.tree).encode()
        text += b" " * (-len(text) % 4)
        chunks = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(binary), b"BIN\0") + binary
        return b"glTF" + struct.pack("<II", 2, 12 + len(chunks)) + chunks


GltfChange = Callable[[Glb], object]
F4 = np.float32


def _animated(glb: Glb, path: str, values: Any, how: str = "LINEAR", **target: Any) -> None:
    sampler = {"input": glb.add(np.array([0, 1], F4)), "output": glb.add(np.array(values, F4)), "interpolation": how}
    channel = {"sampler": 0, "target": {"node": 0, "path": path} | target}
    glb.tree["animations"] = [{"channels": [channel], "samplers": [sampler]}]


def _skin(glb: Glb) -> None:
    glb.primitive["attributes"] |= {
        "JOINTS_0": glb.add(np.zeros((4, 4), np.uint8)),
        "WEIGHTS_0": glb.add(np.tile(np.array([1, 0, 0, 0], F4), (4, 1))),
    }
    glb.tree["nodes"] += [{"translation": [0, 0, 3]}]
    glb.tree["scenes"][0]["nodes"].append(1)
    bound = glb.add(np.eye(4, dtype=F4).reshape(1, 16))
    glb.tree["skins"] = [{"joints": [1], "inverseBindMatrices": bound, "skeleton": 1}]
    glb.tree["nodes"][0]["skin"] = 0


def _morph(glb: Glb, weights: bool = True) -> None:
    glb.primitive["targets"] = [{"POSITION": glb.add(POINTS + 1)}]
    if weights:
        glb.tree["meshes"][0]["weights"] = [0.5]


def _extension(where: Callable[[Glb], Tree], name: str, **members: Any) -> GltfChange:
    def change(glb: Glb) -> None:
        where(glb).setdefault("extensions", {})[name] = members
        glb.tree.setdefault("extensionsUsed", []).append(name)

    return change


def _of_picture(glb: Glb) -> Tree:
    return glb.material["pbrMetallicRoughness"]["baseColorTexture"]


def _basis(glb: Glb) -> None:
    glb.tree["textures"][0] = {"extensions": {"KHR_texture_basisu": {"source": 0}}, "sampler": 0}


def _webp(kind: str, name: str) -> GltfChange:
    def change(glb: Glb) -> None:
        glb.tree["images"].append(
            {"bufferView": glb.view(png(255 - PIXELS, kind)), "mimeType": f"image/{kind.lower()}"}
        )
        glb.tree["textures"][0] = {"extensions": {name: {"source": 1}}, "sampler": 0}

    return change


def _sparse(glb: Glb) -> None:
    at, values = glb.view(np.array([3], np.uint16).tobytes()), glb.view(np.array([[2, 2, 2]], F4).tobytes())
    places = {"bufferView": at, "componentType": 5123}
    glb.tree["accessors"][0]["sparse"] = {"count": 1, "indices": places, "values": {"bufferView": values}}


def _strided(glb: Glb) -> None:
    rows = np.concatenate([POINTS * 2, POINTS], axis=1)
    view = glb.view(rows.tobytes(), byteStride=24)
    glb.tree["accessors"][0] |= {"bufferView": view, "byteOffset": 12}
    glb.tree["nodes"][0]["scale"] = [2, 2, 2]


def _instances(glb: Glb) -> None:
    places = {"TRANSLATION": glb.add(np.array([[0, 0, 1], [0, 0, 2]], F4))}
    _extension(lambda g: g.tree["nodes"][0], "EXT_mesh_gpu_instancing", attributes=places)(glb)


def _draco(glb: Glb) -> None:
    import DracoPy

    data = DracoPy.encode(POINTS + 1, FACES.astype(np.uint32), quantization_bits=14)
    names = {"POSITION": DracoPy.decode(data).attributes[0]["unique_id"]}
    packed = {"bufferView": glb.view(bytes(data)), "attributes": names}
    _extension(lambda g: g.primitive, "KHR_draco_mesh_compression", **packed)(glb)
    glb.primitive["attributes"].pop("TEXCOORD_0")
    glb.primitive.pop("material")
    for number in (0, 1):
        glb.tree["accessors"][number].pop("bufferView")


def _meshopt(glb: Glb) -> None:
    import meshoptimizer

    rows = (POINTS + 1).astype(F4)
    data = bytes(meshoptimizer.encode_vertex_buffer(rows, 4, 12))
    packed = {"buffer": 0, "byteOffset": 0, "byteLength": len(data), "byteStride": 12, "count": 4, "mode": "ATTRIBUTES"}
    packed["byteOffset"] = glb.tree["bufferViews"][glb.view(data)]["byteOffset"]
    glb.tree["bufferViews"][0] = {"buffer": 1, "byteLength": 48, "extensions": {"EXT_meshopt_compression": packed}}
    glb.tree["buffers"].append({"byteLength": 48, "extensions": {"EXT_meshopt_compression": {"fallback": True}}})
    glb.tree["extensionsUsed"] = ["EXT_meshopt_compression"]


def _quantized(glb: Glb) -> None:
    glb.tree["accessors"][0] |= {"bufferView": glb.view(np.zeros((4, 4), np.int16).tobytes(), byteStride=8)}
    rows = np.zeros((4, 4), np.int16)
    rows[:, :3] = POINTS * 32767
    rows[3, 0] = 30000
    glb.tree["accessors"][0] |= {
        "componentType": 5122,
        "normalized": True,
        "bufferView": glb.view(rows.tobytes(), byteStride=8),
    }
    glb.tree["extensionsRequired"] = glb.tree["extensionsUsed"] = ["KHR_mesh_quantization"]


def _uv_of_integers(glb: Glb) -> None:
    rows = np.rint(PLACES[:, ::-1] * 65535).astype(np.uint16)
    glb.primitive["attributes"]["TEXCOORD_0"] = glb.add(np.ascontiguousarray(rows), normalized=True)


def _mode(number: int) -> GltfChange:
    def change(glb: Glb) -> None:
        glb.primitive |= {"mode": number, "indices": glb.add(np.array([0, 1, 3, 2], np.uint16))}

    return change


def _set(where: Callable[[Glb], Tree], **members: Any) -> GltfChange:
    return lambda glb: where(glb).update(members)


def _material(glb: Glb) -> Tree:
    return glb.material


def _shine(glb: Glb) -> Tree:
    return glb.material["pbrMetallicRoughness"]


def _attribute(name: str, values: np.ndarray) -> GltfChange:
    return lambda glb: glb.primitive["attributes"].update({name: glb.add(values)})


INDEX = {"index": 0}
LIGHT = np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 0]], F4)
_MATERIALS = (
    "anisotropy",
    "clearcoat",
    "diffuse_transmission",
    "dispersion",
    "emissive_strength",
    "ior",
    "iridescence",
)
_MATERIALS += ("sheen", "specular", "transmission", "variants", "volume")
GLTF: dict[str, GltfChange] = {
    "accessor.byteOffset, bufferView.byteStride": _strided,
    "accessor.normalized, KHR_mesh_quantization": _quantized,
    "accessor.sparse": _sparse,
    "accessor without a buffer view": lambda glb: glb.tree["accessors"][0].pop("bufferView"),
    "animation of node.translation": lambda glb: _animated(glb, "translation", [[0, 0, 0], [1, 0, 0]]),
    "animation of node.weights": lambda glb: (_morph(glb), _animated(glb, "weights", [0, 1])),
    "animation, CUBICSPLINE": lambda glb: _animated(glb, "scale", np.ones((6, 3)), "CUBICSPLINE"),
    "KHR_animation_pointer": lambda glb: _animated(
        glb, "pointer", [1, 2], extensions={"KHR_animation_pointer": {"pointer": "/materials/0/emissiveFactor"}}
    ),
    "animations, several": lambda glb: (
        _animated(glb, "scale", np.ones((2, 3))),
        glb.tree["animations"].append(glb.tree["animations"][0]),
    ),
    "asset.minVersion": _set(lambda g: g.tree["asset"], minVersion="2.1"),
    "attribute COLOR_0": lambda glb: (
        glb.primitive.pop("material"),
        glb.primitive["attributes"].pop("TEXCOORD_0"),
        _attribute("COLOR_0", LIGHT)(glb),
    ),
    "attribute COLOR_0 with a texture": _attribute("COLOR_0", LIGHT),
    "attribute COLOR_0 with a texture whose texels faces share": lambda glb: (
        _attribute("TEXCOORD_0", np.zeros((4, 2), F4))(glb),
        _attribute("COLOR_0", LIGHT)(glb),
    ),
    "attribute COLOR_0, of one colour, with a texture": _attribute("COLOR_0", np.tile(LIGHT[:1], (4, 1))),
    "attribute COLOR_1": _attribute("COLOR_1", LIGHT),
    "attribute NORMAL": _attribute("NORMAL", LIGHT),
    "attribute TANGENT": _attribute("TANGENT", np.concatenate([LIGHT, LIGHT[:, :1]], axis=1)),
    "attribute TEXCOORD_0, normalized integers": _uv_of_integers,
    "attribute TEXCOORD_1": _attribute("TEXCOORD_1", PLACES[::-1].copy()),
    "attribute of an application": _attribute("_TEMPERATURE", LIGHT),
    "buffer.uri": lambda glb: glb.tree["buffers"][0].update(uri="other.bin"),
    "camera": lambda glb: (
        glb.tree.update(cameras=[{"type": "perspective", "perspective": {"yfov": 1, "znear": 1}}]),
        glb.tree["nodes"][0].update(camera=0),
    ),
    "image.uri": lambda glb: glb.tree["images"].__setitem__(0, {"uri": "other.png"}),
    "image.uri of data": lambda glb: glb.tree["images"].__setitem__(
        0, {"uri": "data:image/png;base64," + base64.b64encode(png(255 - PIXELS)).decode()}
    ),
    "material.alphaMode": _set(_material, alphaMode="BLEND"),
    "material.alphaCutoff": _set(_material, alphaMode="MASK", alphaCutoff=0.5),
    "material.doubleSided": _set(_material, doubleSided=True),
    "material.emissiveFactor": _set(_material, emissiveFactor=[1, 0, 0]),
    "material.emissiveTexture": _set(_material, emissiveTexture=INDEX),
    "material.normalTexture": _set(_material, normalTexture=INDEX),
    "material.occlusionTexture": _set(_material, occlusionTexture=INDEX),
    "pbrMetallicRoughness.baseColorFactor": _set(_shine, baseColorFactor=[1, 0.5, 0.2, 1]),
    "pbrMetallicRoughness.metallicFactor": _set(_shine, metallicFactor=0.5),
    "pbrMetallicRoughness.metallicRoughnessTexture": _set(_shine, metallicRoughnessTexture=INDEX),
    "pbrMetallicRoughness.roughnessFactor": _set(_shine, roughnessFactor=0.5),
    "mesh.weights, primitive.targets": _morph,
    "primitive.targets with normals": lambda glb: (
        _morph(glb),
        glb.primitive["targets"][0].update(NORMAL=glb.add(POINTS), TANGENT=glb.add(POINTS)),
    ),
    "primitive.targets without weights": lambda glb: _morph(glb, weights=False),
    "node.matrix": _set(lambda g: g.tree["nodes"][0], matrix=[*np.diag([2.0, 2, 2, 1]).reshape(-1)]),
    "node.rotation": _set(lambda g: g.tree["nodes"][0], rotation=[0, 0, 1, 0]),
    "node.scale": _set(lambda g: g.tree["nodes"][0], scale=[2, 1, 1]),
    "node.skin": _skin,
    "node.translation": _set(lambda g: g.tree["nodes"][0], translation=[2, 1, 1]),
    "node.weights": lambda glb: (_morph(glb), glb.tree["nodes"][0].update(weights=[1])),
    **{f"primitive.mode {k}": _mode(k) for k in range(7)},
    "primitive without indices": lambda glb: (
        glb.primitive.pop("indices"),
        glb.primitive.pop("material"),
        glb.primitive["attributes"].pop("TEXCOORD_0"),
        glb.primitive["attributes"].update(POSITION=glb.add(np.concatenate([POINTS[:3], POINTS[:3] + 1]))),
    ),
    "sampler.wrapS": lambda glb: (
        glb.tree["samplers"][0].update(wrapS=33071),
        glb.primitive["attributes"].update(TEXCOORD_0=glb.add(PLACES * 2)),
    ),
    "scenes, several": lambda glb: glb.tree["scenes"].append({"nodes": [0]}),
    "textureInfo.texCoord": lambda glb: (
        _attribute("TEXCOORD_1", np.ascontiguousarray(PLACES[::-1]))(glb),
        glb.primitive["attributes"].pop("TEXCOORD_0"),
        _of_picture(glb).update(texCoord=1),
    ),
    "extras": _set(lambda g: g.tree["nodes"][0], extras={"a": 1}),
    "an unknown extension that is required": lambda glb: glb.tree.update(extensionsRequired=["EXT_of_tomorrow"]),
    "an unknown extension of a node": _extension(lambda g: g.tree["nodes"][0], "EXT_of_tomorrow", size=1),
    "EXT_mesh_gpu_instancing": _instances,
    "EXT_meshopt_compression": _meshopt,
    "EXT_texture_avif": _webp("AVIF", "EXT_texture_avif"),
    "EXT_texture_webp": _webp("WEBP", "EXT_texture_webp"),
    "KHR_draco_mesh_compression": _draco,
    "KHR_gaussian_splatting": _extension(lambda g: g.primitive, "KHR_gaussian_splatting", kernel="ellipse"),
    "KHR_lights_punctual": _extension(lambda g: g.tree["nodes"][0], "KHR_lights_punctual", light=0),
    **{f"KHR_materials_{name}": _extension(_material, f"KHR_materials_{name}", factor=1) for name in _MATERIALS},
    "KHR_materials_pbrSpecularGlossiness": _extension(
        _material, "KHR_materials_pbrSpecularGlossiness", diffuseFactor=[1, 0, 0, 1], glossinessFactor=0.5
    ),
    "KHR_materials_unlit": _extension(_material, "KHR_materials_unlit"),
    "KHR_node_visibility": _extension(lambda g: g.tree["nodes"][0], "KHR_node_visibility", visible=False),
    "KHR_texture_basisu": _basis,
    "KHR_texture_transform": _extension(
        _of_picture, "KHR_texture_transform", offset=[0.1, 0], rotation=0.3, scale=[2, 1]
    ),
    "KHR_xmp_json_ld": _extension(lambda g: g.tree["asset"], "KHR_xmp_json_ld", packet=0),
    "MSFT_lod": _extension(lambda g: g.tree["nodes"][0], "MSFT_lod", ids=[0]),
}

OBJ = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 .5\nvt .1 .1\nvt .9 .1\nvt .1 .9\nvt .8 .7\n"
OBJ_FACES = "usemtl a\nf 1/1 2/2 3/3\nf 3/3 2/2 4/4\n"
MTL = "newmtl a\nmap_Kd t.png\n"
OBJ_LINES = {  # keywords of the OBJ specification, version 3.0, and a line of each
    "v with a weight": "v 0 0 0 1",
    "v with colours": "v 0 0 0 1 0 0",
    "vn": "vn 0 0 1",
    "vp": "vp 0.3",
    "p": "p 1",
    "l": "l 1 2",
    "g": "g arm",
    "s": "s 1",
    "mg": "mg 1 0.5",
    "o": "o body",
    "bevel": "bevel on",
    "c_interp": "c_interp on",
    "d_interp": "d_interp on",
    "lod": "lod 5",
    "usemap": "usemap t.png",
    "maplib": "maplib t.mpc",
    "shadow_obj": "shadow_obj other.obj",
    "trace_obj": "trace_obj other.obj",
    "curv": "curv 0 1 1 2",
    "curv2": "curv2 1 2",
    "surf": "surf 0 1 0 1 1 2 3 4",
    "call": "call other.obj",
    "csh": "csh ls",
    "an unknown word": "wobble 3",
}
MTL_LINES = {  # terms of the MTL specification, and those that programs added
    "Ka": "Ka 1 0 0",
    "Kd beside a picture": "Kd 1 0 0",
    "Ks": "Ks 1 1 1",
    "Ke": "Ke 1 0 0",
    "Tf": "Tf 0 1 0",
    "d": "d 0.5",
    "Tr": "Tr 0.5",
    "Ns": "Ns 100",
    "Ni": "Ni 1.4",
    "illum": "illum 2",
    "sharpness": "sharpness 60",
    "map_Ka": "map_Ka t.png",
    "map_Ks": "map_Ks t.png",
    "map_Ke": "map_Ke t.png",
    "map_Ns": "map_Ns t.png",
    "map_d": "map_d t.png",
    "map_bump": "map_bump t.png",
    "bump": "bump t.png",
    "norm": "norm t.png",
    "disp": "disp t.png",
    "decal": "decal t.png",
    "refl": "refl -type sphere t.png",
    "map_aat": "map_aat on",
    "Pr": "Pr 0.5",
    "Pm": "Pm 1",
    "Ps": "Ps 1",
    "Pc": "Pc 1",
    "Pcr": "Pcr 1",
    "aniso": "aniso 1",
    "anisor": "anisor 1",
    "map_Pr": "map_Pr t.png",
    "map_Pm": "map_Pm t.png",
    "an unknown term": "Kwobble 1",
}
MTL_OPTIONS = (
    "-s 2 3 1",
    "-o .1 .2 0",
    "-t 1 1 1",
    "-mm 0.2 2",
    "-clamp on",
    "-bm 2",
    "-boost 3",
    "-cc on",
    "-imfchan r",
)
MTL_OPTIONS += ("-blendu off", "-blendv off", "-texres 64")

PLY_VERTEX = {  # properties of vertices, with a type each
    "nx": "float",
    "red": "uchar",
    "alpha": "uchar",
    "quality": "float",
    "confidence": "float",
    "intensity": "float",
    "label": "int",
    "s": "float",
    "texture_u": "float",
    "scale_0": "float",
}
PLY_FACE = {"red": "uchar", "flags": "int", "quality": "float", "texnumber": "int"}


def _obj(feature: str, obj: str, mtl: str = MTL) -> Case:
    files = {"m.obj": f"mtllib m.mtl\n{obj}".encode(), "m.mtl": mtl.encode(), "t.png": png()}
    return Case("OBJ" if mtl == MTL else "MTL", feature, files)


def _ply(feature: str, vertex: str = "", face: str = "", more: str = "", rows: str = "") -> Case:
    names = [line.split()[-1] for line in vertex.splitlines()]
    tails = {"red": "9", "green": "8", "blue": "7"}
    tail = "".join(f" {tails.get(name, '1')}" for name in names)
    points = "".join(f"{x:g} {y:g} {z:g}{tail}\n" for x, y, z in POINTS.tolist())
    last = "".join(f" {tails.get(line.split()[-1], '0')}" for line in face.splitlines())
    head = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
    head += f"{vertex}element face 2\nproperty list uchar int vertex_indices\n{face}{more}end_header\n"
    faces = "".join(f"3 {a} {b} {c}{last}\n" for a, b, c in FACES.tolist())
    return Case("PLY", feature, {"m.ply": (head + points + faces + rows).encode()})


def _off(feature: str, head: str, tail: str = "", face_tail: str = "") -> Case:
    points = "".join(f"{x:g} {y:g} {z:g}{tail}\n" for x, y, z in POINTS.tolist())
    faces = "".join(f"3 {a} {b} {c}{face_tail}\n" for a, b, c in FACES.tolist())
    return Case("OFF", feature, {"m.off": f"{head}\n4 2 0\n{points}{faces}".encode()})


def _stl(feature: str, head: bytes = b"", attribute: int = 0, behind: bytes = b"") -> Case:
    facets = np.zeros(2, [("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
    facets["corners"], facets["attribute"] = POINTS[FACES], attribute
    return Case("STL", feature, {"m.stl": head.ljust(80, b"\0") + struct.pack("<I", 2) + facets.tobytes() + behind})


def _npz(feature: str, **arrays: np.ndarray) -> Case:
    file = io.BytesIO()
    np.savez(file, vertices=POINTS[None], faces=FACES, **arrays)
    return Case("NPZ", feature, {"m.npz": file.getvalue()})


def plain_cases() -> dict[str, Case]:
    """Return the plain file of each format."""
    plain = [Case("glTF", "", {"m.glb": Glb().pack()}), _obj("", OBJ + OBJ_FACES), _ply(""), _off("", "OFF"), _stl("")]
    found = {case.format: case for case in [*plain, _npz("")]}
    return found | {"MTL": found["OBJ"]}


def all_cases() -> Iterator[Case]:
    """Yield a file for each feature of each format."""
    for feature, change in GLTF.items():
        glb = copy.deepcopy(Glb())
        change(glb)
        yield Case("glTF", feature, {"m.glb": glb.pack()})
    for feature, line in OBJ_LINES.items():
        text = OBJ.replace("v 0 0 0\n", f"{line}\n", 1) if line.startswith("v ") else f"{OBJ}{line}\n"
        yield _obj(feature, text + OBJ_FACES)
    for feature, line in MTL_LINES.items():
        yield _obj(feature, OBJ + OBJ_FACES, f"{MTL}{line}\n")
    bare = OBJ.split("vt")[0] + "usemtl a\nf 1 2 3\nf 3 2 4\n"
    yield _obj("Kd without a picture", bare, "newmtl a\nKd 1 0 0\n")
    for option in MTL_OPTIONS:
        yield _obj(f"map_Kd {option.split()[0]}", OBJ + OBJ_FACES, f"newmtl a\nmap_Kd {option} t.png\n")
    rgb = "".join(f"property uchar {name}\n" for name in ("red", "green", "blue"))
    for name, kind in PLY_VERTEX.items():
        yield _ply(f"vertex {name}", rgb if name == "red" else f"property {kind} {name}\n")
    for name, kind in PLY_FACE.items():
        yield _ply(f"face {name}", face=rgb if name == "red" else f"property {kind} {name}\n")
    yield _ply("element edge", more="element edge 1\nproperty int vertex1\nproperty int vertex2\n", rows="0 1\n")
    strips = "element tristrips 1\nproperty list int int vertex_indices\n"
    yield _ply("element tristrips", more=strips, rows="4 0 1 3 2\n")
    uv = _ply("comment TextureFile, face texcoord")
    data = uv.files["m.ply"].decode().replace("ascii 1.0\n", "ascii 1.0\ncomment TextureFile t.png\n")
    data = data.replace("vertex_indices\n", "vertex_indices\nproperty list uchar float texcoord\n")
    for a, b, c in FACES.tolist():
        places = " ".join(f"{value:g}" for value in PLACES[[a, b, c]].reshape(-1))
        data = data.replace(f"\n3 {a} {b} {c}\n", f"\n3 {a} {b} {c} 6 {places}\n")
    yield Case("PLY", uv.feature, {"m.ply": data.encode(), "t.png": png()})
    yield _off("COFF, whole numbers", "COFF", " 255 0 0 255")
    yield _off("COFF, fractions", "COFF", " 1 0.5 0 1")
    yield _off("NOFF", "NOFF", " 0 0 1")
    yield _off("STOFF", "STOFF", " 0.5 0.5")
    yield _off("4OFF", "4OFF", " 1")
    yield _off("OFF BINARY", "OFF BINARY")
    yield _off("colours of faces", "OFF", face_tail=" 255 0 0")
    yield _off("numbers of colours of faces", "OFF", face_tail=" 3")
    yield _off("more numbers of vertices", "OFF", " 7")
    yield _stl("colours, as VisCAM writes them", attribute=0x8000 | 31 << 10)
    yield _stl("colours, as Magics writes them", b"COLOR=\x10\x20\x30\xff", 31)
    yield _stl("bytes behind the triangles", behind=b"more than nothing")
    yield _npz("colors", colors=np.full((4, 3), 9, np.uint8))
    yield _npz("uv and texture", uv=PLACES[FACES], texture=PIXELS)
    yield _npz("uv without texture", uv=PLACES[FACES])
    yield _npz("another array", normals=POINTS)
