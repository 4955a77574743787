"""Parser of GLB (binary glTF 2), based on trimesh. In: bytes. Out: all triangle meshes, placed by their nodes."""

from __future__ import annotations

import io
import json
from base64 import b64decode
from functools import partial
from typing import Any

import numpy as np
from jaxtyping import Float32, UInt8

from ..types import GREY, Texture
from .glb_file import PASSED_OVER, from_linear
from .pictures import parse_picture
from .polygons import Dropped, Polygons, Unreadable

_DROPS = {"NORMAL": "normals", "JOINTS": "skinning"}
# trimesh passes attributes that begin with _ on unchanged, but would read 16-bit colours by their lower byte.
_COLORS, _HIDDEN = b'"COLOR_0"', b'"_OLOR_0"'
_TRANSFORM, _FLOAT = "KHR_texture_transform", 5126
_DRACO = "KHR_draco_mesh_compression"
_DENSEST = 64  # values per byte (guess): no mesh compression comes near


def parse_glb(data: bytes) -> Polygons:
    """Return the surface of a GLB scene at rest, in world coordinates, without hidden nodes."""
    tree = _json_chunk(data)
    if not tree.get("meshes"):
        return _joined([], _dropped(tree), None)
    if f'"{_DRACO}":' in json.dumps(tree["meshes"]):  # a few bytes could claim any size, and Draco believes them
        raise Unreadable(f"GLB is compressed with Draco ({_DRACO}); write it without, with `gltf-transform copy` or so")
    import trimesh

    try:
        hidden = data[: _text_end(data)].replace(_COLORS, _HIDDEN) + data[_text_end(data) :]
        scene = trimesh.load_scene(io.BytesIO(hidden), file_type="glb", process=False)
        placed = [(scene.graph[node][0], scene.geometry[scene.graph[node][1]]) for node in scene.graph.nodes_geometry]
        # A scale of 0 hides a node until an animation shows it.
        parts = [part for part in placed if isinstance(part[1], trimesh.Trimesh) and part[0][:3, :3].any()]
        pictures, unknown = _pictures(tree)
        picture = _picture(data, tree, min(pictures)) if len(pictures) == 1 and not unknown else None
        why = unknown or ("several materials" if len(pictures) > 1 else "a texture (it is in another file)")
        lost = frozenset({why} if (pictures or unknown) and picture is None else ())
        return _joined(parts, _dropped(tree) | lost, picture)
    except Unreadable:
        raise
    except Exception as error:  # a foreign parser may raise anything for a damaged file
        raise Unreadable(f"GLB cannot be read ({type(error).__name__}: {error})") from None


def _text_end(data: bytes) -> int:
    """Return the offset of the JSON chunk's end."""
    return 20 + int.from_bytes(data[12:16], "little")


def _json_chunk(data: bytes) -> dict[str, Any]:
    """Return the scene description, after checking the lengths that the container announces."""
    head = np.frombuffer(data[:20].ljust(20, b"\0"), dtype="<u4")
    magic, version, total, length = data[:4], int(head[1]), int(head[2]), int(head[3])
    if magic != b"glTF" or version != 2:
        raise Unreadable(f"GLB 2 header expected, found {magic!r} version {version}")
    if total > len(data) or 20 + length > len(data):
        raise Unreadable(f"GLB announces {total} bytes but has {len(data)} (truncated?)")
    try:
        tree = json.loads(data[20 : 20 + length])
    except (ValueError, RecursionError) as error:
        raise Unreadable(f"GLB scene description is no JSON ({error})") from None
    if not isinstance(tree, dict):
        raise Unreadable("GLB scene description is no JSON object")
    accessors = tree.get("accessors") or []
    for accessor in accessors if isinstance(accessors, list) else [None]:
        count = accessor.get("count", 0) if isinstance(accessor, dict) else None
        if not isinstance(count, int):
            raise Unreadable("GLB accessors are no list of objects with a whole count")
        if not 0 <= count <= _DENSEST * len(data):
            raise Unreadable(f"GLB announces {count} values in {len(data)} bytes")
    return tree


def _dropped(tree: dict[str, Any]) -> Dropped:
    text = json.dumps([mesh.get("primitives", []) for mesh in tree.get("meshes", []) if isinstance(mesh, dict)])
    dropped = {words for mark, words in _DROPS.items() if f'"{mark}' in text}
    dropped |= {"animations"} if tree.get("animations") else set()
    materials = json.dumps(tree.get("materials") or [])
    dropped |= {"normal maps"} if '"normalTexture"' in materials else set()
    dropped |= {"transparency"} if '"alphaMode"' in materials and '"OPAQUE"' not in materials else set()
    return frozenset(dropped)


def _pictures(tree: dict[str, Any]) -> tuple[set[int], str]:
    """Return the numbers of the images that are base colours of triangles, and the name of any unsupported use."""
    images, unknown = set[int](), ""
    for primitive in (one for mesh in tree["meshes"] for one in mesh.get("primitives", [])):
        material = tree["materials"][primitive["material"]] if "material" in primitive else {}
        shine = material.get("pbrMetallicRoughness", {})
        if "baseColorTexture" not in shine:
            continue
        use, places = shine["baseColorTexture"], primitive.get("attributes", {}).get("TEXCOORD_0")
        texture = tree["textures"][use["index"]]
        source = texture.get("source", texture.get("extensions", {}).get("EXT_texture_webp", {}).get("source"))
        if source is None:
            unknown = "a texture (in a coding that is not read)"
        elif use.get("texCoord", 0) or _TRANSFORM in use.get("extensions", {}):
            unknown = "a texture (with places of its own)"
        elif places is not None and tree["accessors"][places]["componentType"] != _FLOAT:
            unknown = "a texture (with places that are no floats)"
        else:
            images.add(source)
    return images, unknown


def _picture(data: bytes, tree: dict[str, Any], image: int) -> Texture | None:
    """Return the texture of an image in the file; None for an image elsewhere."""
    view, uri = tree["images"][image].get("bufferView"), tree["images"][image].get("uri", "")
    if uri.startswith("data:"):
        return Texture(partial(parse_picture, b64decode(uri.split(",", 1)[1]), "the texture of a GLB"))
    if view is None:
        return None
    where = tree["bufferViews"][view]
    begin = _text_end(data) + 8 + where.get("byteOffset", 0)
    return Texture(partial(parse_picture, data[begin : begin + where["byteLength"]], "the texture of a GLB"))


def _joined(parts: list[tuple[np.ndarray, Any]], dropped: Dropped, texture: Texture | None) -> Polygons:
    """Return all parts as one surface; nodes without rotation or scale are added without a matrix product."""
    vertices, faces, count = [np.zeros((0, 3))], [np.zeros((0, 3), np.int64)], 0
    for matrix, part in parts:
        local = np.asarray(part.vertices, dtype=np.float64)
        turned = local if np.array_equal(matrix[:3, :3], np.eye(3)) else local @ matrix[:3, :3].T
        vertices.append(turned + matrix[:3, 3])
        triangles = np.asarray(part.faces, dtype=np.int64)
        mirrored = np.linalg.det(matrix[:3, :3]) < 0
        faces.append((triangles[:, ::-1] if mirrored else triangles) + count)
        count += len(local)
    corners, surfaces = np.concatenate(faces).reshape(-1), [part for _, part in parts]
    sizes = np.full(len(corners) // 3, 3, np.int64)
    uv = None if texture is None else np.concatenate([_places(part) for part in surfaces])[corners]
    return Polygons(np.concatenate(vertices), corners, sizes, dropped, _colors(surfaces), uv, texture)


def _places(part: Any) -> Float32[np.ndarray, "V 2"]:
    """Return the texture coordinates of a part's vertices; NaN if it has none."""
    uv = getattr(part.visual, "uv", None)
    if uv is None or len(uv) != len(part.vertices):
        return np.full((len(part.vertices), 2), np.nan, np.float32)
    return np.asarray(uv, np.float32)[:, :2]


def _colors(parts: list[Any]) -> UInt8[np.ndarray, "V 3"] | None:
    """Return the colours of all vertices, grey for parts without; None if no part has any."""
    names = (_HIDDEN.decode().strip('"'), PASSED_OVER)
    given = [next((part.vertex_attributes[n] for n in names if n in part.vertex_attributes), None) for part in parts]
    if all(values is None for values in given):
        return None
    for part, values in zip(parts, given, strict=True):
        if values is not None and (np.ndim(values) != 2 or len(values) != len(part.vertices) or values.shape[1] < 3):
            raise ValueError(f"COLOR_0 of shape {np.shape(values)} for {len(part.vertices)} vertices")
    colors = [
        np.full((len(part.vertices), 3), GREY, np.uint8) if values is None else from_linear(np.asarray(values)[:, :3])
        for part, values in zip(parts, given, strict=True)
    ]
    return np.concatenate(colors)
