"""Meshes of other libraries as meshes of ours: of trimesh, Open3D, pyvista and Open4D, and pairs of arrays.

In: any iterable. Out: a sequence. `Mesh.to_trimesh` and its siblings are the way back.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from .errors import InputError
from .io.glb import parse_glb, tinted
from .io.glb_file import from_linear
from .io.looks import Look, with_looks
from .io.meshes import checked
from .io.polygons import CLOUD, Polygons, Surfaceless
from .shapes import Float32, Int64, UInt8
from .types import Mesh, MeshList, MeshSequence, Texture

Colors = UInt8[np.ndarray, "V 3"]


def as_sequence(value: object, frame_rate: float | None = None) -> MeshSequence:
    """Return `value` if it is a MeshSequence, otherwise a MeshList of its items at `frame_rate` (1/s).

    An item is a Mesh, a mesh or scene of trimesh, a mesh of Open3D or pyvista, a frame of Open4D, or a pair of arrays
    (vertices, faces). Colours of vertices and faces, and textures, are kept. The default of `frame_rate` is the
    attribute `fps` of `value`, which Open4D's sequences have, or 30. Raises InputError for any other value; the message
    names the frame.
    """
    if isinstance(value, MeshSequence):
        return value
    if isinstance(value, str | bytes) or not isinstance(value, Iterable):
        remedy = "give a list of meshes, or meshreel.open_sequence(path)"
        raise InputError(f"{type(value).__name__} {str(value)[:60]!r} is no sequence of meshes; {remedy}")
    rate = float(getattr(value, "fps", None) or 30.0) if frame_rate is None else frame_rate
    return MeshList(tuple(_as_mesh(item, f"frame {number}") for number, item in enumerate(value)), rate)


def _as_mesh(item: Any, where: str) -> Mesh:
    if isinstance(item, Mesh):
        _check_faces(len(item.vertices), len(item.faces), where)
        return item
    if hasattr(item, "to_mesh"):  # a scene of trimesh: all its meshes, in their places
        parts = item.geometry.values()
        count, face_count = (sum(len(getattr(one, name, ())) for one in parts) for name in ("vertices", "faces"))
        _check_faces(count, face_count, where)
        if len({one.visual.kind for one in parts if hasattr(one, "visual")}) > 1:  # it would mix them
            return checked(parse_glb(item.export(file_type="glb"))).mesh
        item = item.to_mesh()
    item = getattr(item, "geometry", item)  # of a frame of Open4D
    faces = getattr(item, "regular_faces", getattr(item, "faces", getattr(item, "triangles", None)))
    vertices = getattr(item, "points", getattr(item, "vertices", getattr(item, "positions", None)))
    pair = item if isinstance(item, tuple | list) else (vertices, faces)
    if len(pair) != 2 or pair[0] is None or pair[1] is None:
        remedy = "give a Mesh, a trimesh or Open3D mesh, or a pair (vertices, faces)"
        raise InputError(f"{where}: {type(item).__name__} {str(item)[:60]!r} is no mesh; {remedy}")
    vertices, corners = _rows_of_three(pair[0], f"{where}: vertices"), _rows_of_three(pair[1], f"{where}: faces")
    if corners.size and corners.dtype.kind not in "iu":
        raise InputError(f"{where}: faces are {corners.dtype}; give integers, the numbers of vertices")
    if corners.size and not 0 <= corners.min() <= corners.max() < len(vertices):
        wrong = corners.min() if corners.min() < 0 else corners.max()
        raise InputError(f"{where}: a face refers to vertex {wrong}, but there are {len(vertices)} (from 0)")
    _check_faces(len(vertices), len(corners), where)
    mesh = Mesh.of(vertices, corners)
    uv, looks, which = _looks_of(item, mesh)
    visual, faces = getattr(item, "visual", None), None
    if visual is not None and visual.kind == "face":
        faces = _bytes(visual.face_colors, len(mesh.faces), "face", where)
    sizes, colors = np.full(len(mesh.faces), 3), _colors_of(item, mesh, where)
    corners = mesh.faces.reshape(-1).astype(np.int64)
    triangles = Polygons(mesh.vertices, corners, sizes, colors=colors, face_colors=faces, uv=uv)
    known = with_looks(triangles, looks, which)
    uv = None if known.uv is None else known.uv.reshape(-1, 3, 2)
    return replace(mesh, colors=known.colors, uv=uv, texture=known.texture)


def _check_faces(vertices: int, faces: int, where: str) -> None:
    """Raise InputError for vertices alone, but for the few that mark an empty frame."""
    if not faces and vertices >= CLOUD:
        raise InputError(f"{where}: {Surfaceless(vertices)}")


def _colors_of(item: Any, mesh: Mesh, where: str) -> Colors | None:
    """Return colours of vertices: those of trimesh are bytes, those of Open3D and Open4D fractions of 1."""
    visual, count = getattr(item, "visual", None), len(mesh.vertices)
    if visual is not None:
        given = visual.vertex_colors if visual.kind == "vertex" else ()
    elif hasattr(item, "point_data"):  # of pyvista
        given = item.point_data.get("RGB", ())
    else:
        given = getattr(item, "vertex_colors", getattr(item, "colors", ()))
    return _bytes(given, count, "vertex", where)


def _bytes(values: Any, count: int, what: str, where: str) -> Colors | None:
    colors = np.asarray(values)
    if colors.size == 0 or colors.dtype == object:
        return None
    if colors.ndim != 2 or colors.shape[0] != count or colors.shape[1] not in (3, 4):
        raise InputError(f"{where}: colours of shape {colors.shape}; give {count} x 3, one of each {what}")
    colors, most = colors[:, :3], 1 if colors.dtype.kind == "f" else 255
    if not (valid := (colors >= -most) & (colors <= 2 * most)).all():  # blended colours exceed the range a little
        raise InputError(f"{where}: a colour has the value {colors[~valid][0]:g}; give fractions of 1, or bytes")
    return np.ascontiguousarray((np.clip(colors, 0, most) * (255 / most)).round(), np.uint8)


def _looks_of(item: Any, mesh: Mesh) -> tuple[Float32[np.ndarray, "C 2"] | None, list[Look], Int64[np.ndarray, " F"]]:
    """Return the places of corners in pictures, the looks, and which each face has, of trimesh or Open3D."""
    visual: Any = getattr(item, "visual", None)
    images, which = list(getattr(item, "textures", ())), np.zeros(len(mesh.faces), np.int64)
    if visual is not None and visual.kind == "texture":
        materials, chosen = getattr(visual.material, "materials", [visual.material]), visual.face_materials
        which = np.asarray(chosen, np.int64) if chosen is not None and len(chosen) == len(which) else which
        if visual.uv is None or len(visual.uv) != len(mesh.vertices):
            return None, [_look_of(one, False) for one in materials], which
        uv = np.asarray(visual.uv)[mesh.faces].reshape(-1, 2)
        return np.ascontiguousarray(uv, np.float32), [_look_of(one, True) for one in materials], which
    if images and len(item.triangle_uvs) == mesh.faces.size:
        uv, ids = np.asarray(item.triangle_uvs), np.asarray(item.triangle_material_ids, np.int64)
        which = np.where(ids < len(images), ids, -1) if len(ids) == len(which) else which
        pictures = [np.asarray(one)[::-1, :, :3] for one in images]  # it has the lowest row of a picture first
    else:
        return None, [], which
    looks = [Look(None, Texture(partial(np.ascontiguousarray, one, np.uint8))) for one in pictures]
    return np.ascontiguousarray(uv.reshape(-1, 2), np.float32), looks, which


def _look_of(material: Any, has_places: bool) -> Look:
    """Return the look of a material of trimesh; a factor is linear light, and multiplies the picture."""
    image = getattr(material, "baseColorTexture", None) or getattr(material, "image", None)
    factor = getattr(material, "baseColorFactor", None)
    share = (
        np.ones(3) if factor is None else np.asarray(factor)[:3] / (255 if np.asarray(factor).dtype.kind in "iu" else 1)
    )
    if image is not None and has_places:
        picture = Texture(partial(np.ascontiguousarray, image.convert("RGB"), np.uint8))
        return Look(None, picture if (share == 1).all() else tinted(picture, *share))
    color = getattr(material, "diffuse", None) if factor is None else from_linear(share[None])[0]
    return Look() if color is None else Look(tuple(np.asarray(color)[:3].tolist()))


def _rows_of_three(values: object, what: str) -> np.ndarray:
    try:
        array = np.asarray(values)
    except ValueError as error:
        raise InputError(f"{what} are no array ({error}); give one of N x 3 numbers") from None
    if array.size and (array.ndim != 2 or array.shape[1] != 3 or array.dtype.kind not in "fiu"):
        raise InputError(f"{what} are {array.dtype} of shape {array.shape}; give N x 3 numbers")
    return array.reshape(-1, 3)
