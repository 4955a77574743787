"""Truncated signed distances on a sparse grid of Open3D's voxel blocks, and extraction of their zero level.

A voxel is known where its weight is above a threshold; surface is extracted between known voxels only. Vertices and
faces are ordered by position alone, so the same distances give the same mesh. Needs the extra `encode`.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from jaxtyping import Float32, Int32

from ..errors import InputError
from ..types import Mesh
from .depth import DepthPicture
from .topology import clean, weld

SIDE = 8  # voxels along a side of a block (guess)
ROOM = 20_000  # initial capacity of a grid, blocks; it grows when needed (guess)
TRUNCATION = 3.0  # voxels before and behind a depth that it constrains (guess)
GRAZING = 4.0  # the same where surface is seen at grazing angles, from one side (decision 28)
SEEN = 0.5  # weight above which a voxel is known: one measurement is enough (guess)
MOST_BLOCKS = 500_000  # bounds memory: 2 GB, and as much again while the grid grows (guess)


def new_grid(voxel: float, room: int = ROOM) -> Any:
    """Make an empty grid with the attributes `tsdf` and `weight`; its voxels are at whole multiples of `voxel`, m."""
    import open3d as o3d

    kinds, one = (o3d.core.float32, o3d.core.float32), o3d.core.SizeVector([1])
    return o3d.t.geometry.VoxelBlockGrid(("tsdf", "weight"), kinds, (one, one), voxel, SIDE, room)


def fill_grid(
    voxel: float,
    blocks: Int32[np.ndarray, "B 3"],
    distances: Float32[np.ndarray, "B S S S"],
    weights: Float32[np.ndarray, "B S S S"],
) -> Any:
    """Make a grid of the given blocks, whose voxel (i, j, k) has the array index [k, j, i].

    A voxel's coordinates are its block's times SIDE, plus (i, j, k). Distances are in any unit, positive outside.
    """
    import open3d as o3d

    grid = new_grid(voxel, max(len(blocks), 1))
    if not len(blocks):
        return grid
    places, _ = grid.hashmap().activate(_tensor(blocks))
    places = places.to(o3d.core.int64)
    for name, values in (("tsdf", distances), ("weight", weights)):
        grid.attribute(name)[places] = _tensor(values[..., None])
    return grid


def integrate(pictures: Sequence[DepthPicture], voxel: float, truncation: float) -> Any:
    """Integrate depth pictures into a grid, within `truncation` voxels of their surfaces.

    Every picture is integrated into the blocks of all pictures: where one camera sees through what another took for
    surface (flying pixels, noise), it carves it away. Raises InputError where the surface takes more than `MOST_BLOCKS`
    blocks.
    """
    grid, blocks = new_grid(voxel), []
    for picture in pictures:
        found = grid.compute_unique_block_coordinates(*_pinhole(picture), 1.0 / picture.unit, picture.far, truncation)
        blocks.append(found.numpy())
    union = np.unique(np.concatenate(blocks), axis=0)
    if len(union) > MOST_BLOCKS:
        text = f"surface in {len(union)} blocks of {SIDE * voxel:g} m, over {MOST_BLOCKS}"
        raise InputError(f"{text}; are depth_unit_m and depth_max_m right? If so, give a larger voxel")
    for picture in pictures:
        grid.integrate(_tensor(union), *_pinhole(picture), 1.0 / picture.unit, picture.far, truncation)
    return grid


def _pinhole(picture: DepthPicture) -> tuple[Any, Any, Any]:
    """Return depth, intrinsics and extrinsics of a picture as Open3D takes them."""
    import open3d as o3d

    camera = picture.camera  # pixel centers at halves, since integration truncates projected positions
    return o3d.t.geometry.Image(_tensor(picture.depth)), _tensor(camera.intrinsic), _tensor(camera.extrinsic)


def _tensor(values: np.ndarray) -> Any:
    import open3d as o3d

    return o3d.core.Tensor.from_numpy(np.ascontiguousarray(values))


def extract(grid: Any, least: float) -> Mesh:
    """Extract the zero level between voxels whose weight is above `least`; the mesh may be empty."""
    if grid.hashmap().size() == 0:
        return Mesh.empty()
    try:
        found = grid.extract_triangle_mesh(weight_threshold=least)
    except RuntimeError as error:
        if "shape {0}" not in str(error):  # Open3D made no vertices and fails to color them
            raise
        return Mesh.empty()
    if "indices" not in found.triangle or len(found.triangle["indices"]) == 0:
        return Mesh.empty()
    vertices = found.vertex["positions"].numpy().astype(np.float64)
    return _ordered(clean(weld(Mesh(vertices, found.triangle["indices"].numpy().astype(np.int32)))))


def _ordered(mesh: Mesh) -> Mesh:
    """Order vertices and faces by position; no two vertices may share one."""
    order = np.lexsort(mesh.vertices.T[::-1])
    rank = np.empty(len(order), np.int32)
    rank[order] = np.arange(len(order), dtype=np.int32)
    faces = rank[mesh.faces]
    first = np.argmin(faces, axis=1)[:, None]
    faces = np.take_along_axis(faces, (first + np.arange(3)) % 3, axis=1)
    return Mesh.of(mesh.vertices[order], faces[np.lexsort(faces.T[::-1])])
