"""Signed distances on a sparse grid of blocks, and the surface where they are zero: Open3D's voxel blocks (`encode`).

A voxel is known where its weight is above a threshold; surface is extracted between known voxels only. What is
extracted is in an order that follows from its place alone, so the same distances give the same mesh.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from jaxtyping import Float32, Int32

from ..types import Mesh
from .topology import clean, weld

SIDE = 8  # voxels, of a block
ROOM = 20_000  # blocks that there is room for at first; more is made when needed


def new_grid(voxel: float, room: int = ROOM) -> Any:
    """An empty grid with the attributes `tsdf` and `weight`; its voxels are at whole multiples of `voxel`, m."""
    import open3d as o3d

    kinds, one = (o3d.core.float32, o3d.core.float32), o3d.core.SizeVector([1])
    return o3d.t.geometry.VoxelBlockGrid(("tsdf", "weight"), kinds, (one, one), voxel, SIDE, room)


def fill_grid(
    voxel: float,
    blocks: Int32[np.ndarray, "B 3"],
    distances: Float32[np.ndarray, "B S S S"],
    weights: Float32[np.ndarray, "B S S S"],
) -> Any:
    """The grid with these blocks; voxel (i, j, k) of a block at its coordinates times SIDE plus i, j, k is [k, j, i].

    Distances are in any unit; the sign is positive outside.
    """
    import open3d as o3d

    grid = new_grid(voxel, max(len(blocks), 1))
    if not len(blocks):
        return grid
    tensor = o3d.core.Tensor.from_numpy
    places, _ = grid.hashmap().activate(tensor(np.ascontiguousarray(blocks)))
    places = places.to(o3d.core.int64)
    for name, values in (("tsdf", distances), ("weight", weights)):
        grid.attribute(name)[places] = tensor(np.ascontiguousarray(values[..., None]))
    return grid


def extract(grid: Any, least: float) -> Mesh:
    """The zero level between voxels whose weight is above `least`; the empty mesh where there is none."""
    if grid.hashmap().size() == 0:
        return Mesh.empty()
    try:
        found = grid.extract_triangle_mesh(weight_threshold=least)
    except RuntimeError as error:
        if "shape {0}" not in str(error):  # it has made no vertices, and fails to color them
            raise
        return Mesh.empty()
    if "indices" not in found.triangle or len(found.triangle["indices"]) == 0:
        return Mesh.empty()
    vertices = found.vertex["positions"].numpy().astype(np.float64)
    return _ordered(clean(weld(Mesh(vertices, found.triangle["indices"].numpy().astype(np.int32)))))


def _ordered(mesh: Mesh) -> Mesh:
    """No two vertices are in one place."""
    order = np.lexsort(mesh.vertices.T[::-1])
    rank = np.empty(len(order), np.int32)
    rank[order] = np.arange(len(order), dtype=np.int32)
    faces = rank[mesh.faces]
    first = np.argmin(faces, axis=1)[:, None]
    faces = np.take_along_axis(faces, (first + np.arange(3)) % 3, axis=1)
    return Mesh.of(mesh.vertices[order], faces[np.lexsort(faces.T[::-1])])
