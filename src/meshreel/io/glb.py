"""Parser of GLB (binary glTF 2), based on trimesh. In: bytes. Out: all triangle meshes, placed by their nodes."""

from __future__ import annotations

import io
import json
from typing import Any

import numpy as np

from .polygons import Dropped, Polygons, Unreadable

_DROPS = {"NORMAL": "normals", "TEXCOORD": "texture coordinates", "COLOR": "colors", "JOINTS": "skinning"}
_DRACO = "KHR_draco_mesh_compression"
_DENSEST = 64  # values per byte (guess): no mesh compression comes near


def parse_glb(data: bytes) -> Polygons:
    """Return the surface of a GLB scene at rest in world coordinates, without nodes that are hidden at rest."""
    tree = _json_chunk(data)
    if not tree.get("meshes"):
        return _joined([], _dropped(tree))
    if f'"{_DRACO}":' in json.dumps(tree["meshes"]):  # a few bytes could claim any size, and Draco believes them
        raise Unreadable(f"GLB is compressed with Draco ({_DRACO}); write it without, with `gltf-transform copy` or so")
    import trimesh

    try:
        scene = trimesh.load_scene(io.BytesIO(data), file_type="glb", process=False)
        placed = [(scene.graph[node][0], scene.geometry[scene.graph[node][1]]) for node in scene.graph.nodes_geometry]
        # A scale of 0 hides a node until an animation shows it.
        parts = [part for part in placed if isinstance(part[1], trimesh.Trimesh) and part[0][:3, :3].any()]
        return _joined(parts, _dropped(tree))
    except Exception as error:  # a foreign parser may raise anything for a damaged file
        raise Unreadable(f"GLB cannot be read ({type(error).__name__}: {error})") from None


def _json_chunk(data: bytes) -> dict[str, Any]:
    """Return the scene description, after a check of the lengths that the container announces."""
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
    dropped |= {key for key in ("materials", "animations", "textures") if tree.get(key)}
    return frozenset(dropped)


def _joined(parts: list[tuple[np.ndarray, Any]], dropped: Dropped) -> Polygons:
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
    corners = np.concatenate(faces).reshape(-1)
    return Polygons(np.concatenate(vertices), corners, np.full(len(corners) // 3, 3, np.int64), dropped)
