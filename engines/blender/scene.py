"""Meshes of a scene as a .reel file: the objects that are selected, as they are drawn, at each of its frames."""

from __future__ import annotations

from typing import Any

import numpy as np

import meshreel
from meshreel.errors import InputError
from meshreel.geometry.topology import concatenate
from meshreel.types import Mesh, MeshList


def encode_scene(context: Any, path: str, quality: float) -> None:
    """Encode the selected meshes of all frames of a scene. Raises InputError for none, and as `encode` does."""
    scene = context.scene
    objects = [each for each in context.selected_objects if each.type == "MESH"]
    if not objects:
        raise InputError("no mesh is selected: select the objects that the file is to have")
    before, frames = scene.frame_current, list[Mesh]()
    try:
        for number in range(scene.frame_start, scene.frame_end + 1, scene.frame_step):
            scene.frame_set(number)
            graph = context.evaluated_depsgraph_get()
            frames.append(concatenate([mesh_of(each.evaluated_get(graph)) for each in objects]))
    finally:
        scene.frame_set(before)
    rate = scene.render.fps / scene.render.fps_base / scene.frame_step
    meshreel.encode(MeshList(tuple(frames), rate, "z"), path, quality=quality)


def mesh_of(drawn: Any) -> Mesh:
    """Return the mesh of an evaluated object in the world's axes, with its active colours."""
    data = drawn.to_mesh()
    try:
        data.calc_loop_triangles()
        vertices = values(data.vertices, "co", 3)
        faces = values(data.loop_triangles, "vertices", 3, np.int32)
        world = np.array(drawn.matrix_world, np.float64)
        if np.linalg.det(world[:3, :3]) < 0:  # mirrored: outside stays outside
            faces = np.ascontiguousarray(faces[:, ::-1])
        return Mesh(vertices.astype(np.float64) @ world[:3, :3].T + world[:3, 3], faces, colors_of(data))
    finally:
        drawn.to_mesh_clear()


def colors_of(data: Any) -> np.ndarray | None:
    """Return the active colours of the vertices, of corners their means; None where a mesh has none."""
    active = data.color_attributes.active_color
    if active is None:
        return None
    colors = values(active.data, "color_srgb", 4)[:, :3]
    if active.domain == "CORNER":
        owners = values(data.loops, "vertex_index", 1, np.int32)[:, 0]
        counts = np.maximum(np.bincount(owners, minlength=len(data.vertices)), 1)
        sums = [np.bincount(owners, channel, len(data.vertices)) for channel in colors.T]
        colors = np.stack(sums, axis=1) / counts[:, None]
    return np.round(255 * np.clip(colors, 0, 1)).astype(np.uint8)


def values(elements: Any, name: str, width: int, kind: type = np.float32) -> np.ndarray:
    """Return a value of each element, in rows."""
    found = np.empty(width * len(elements), kind)
    elements.foreach_get(name, found)
    return found.reshape(-1, width)
