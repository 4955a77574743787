"""Depth pictures of one moment become one mesh: TSDF, marching cubes, fragments dropped (paper, section 4.1).

In: what each camera of a rig measured. Out: a mesh in world coordinates, on one voxel grid for all frames, so that what
stands still has the same grid around it always. The same pictures give the same mesh, whatever the number of threads.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import UInt16

from ..errors import InputError
from ..geometry.connected import connected_faces
from ..geometry.topology import drop_unreferenced, face_normals
from ..geometry.tsdf import SIDE, extract, new_grid
from ..types import Mesh
from .rig import DepthCamera

MOST_BLOCKS = 500_000  # 2 GB, and as much again while room is made
SEEN = 0.5  # measurements of a voxel above which it counts: one is enough


@dataclass(frozen=True, slots=True)
class FusionOptions:
    """How depth becomes surface."""

    voxel: float = 0.02  # m, side of a voxel
    truncation: float = 3.0  # voxels that a depth says something about before and behind it
    fragment: float = 0.01  # m^2: connected pieces with less area are dropped

    def __post_init__(self) -> None:
        if not 1e-4 <= self.voxel <= 1:
            raise InputError(f"voxel {self.voxel:g}: give metres, 0.0001 to 1; 0.02 suits a room")
        if not 1 <= self.truncation <= 20 or not 0 <= self.fragment < np.inf:
            raise InputError(
                f"truncation {self.truncation:g}, fragment {self.fragment:g}: give 1 to 20 voxels and an area from 0 on"
            )


def fuse_depths(
    depths: Sequence[tuple[DepthCamera, UInt16[np.ndarray, "H W"]]], options: FusionOptions = FusionOptions()
) -> Mesh:
    """The surface that these cameras see; empty where none has measured anything in its range.

    Raises InputError where what they see takes more than `MOST_BLOCKS` blocks of voxels.

    Every camera is integrated into the blocks of all: where one sees through what another took for surface (flying
    pixels, noise), it carves it away.
    """
    views = [(camera, inside) for camera, depth in depths if (inside := camera.in_range(depth)).any()]
    if not views:
        return Mesh.empty()
    grid, blocks = new_grid(options.voxel), []
    for view in views:
        found = grid.compute_unique_block_coordinates(*_pinhole(view), *_depth(view, options))
        blocks.append(found.numpy())
    union = np.unique(np.concatenate(blocks), axis=0)
    if len(union) > MOST_BLOCKS:
        text = f"surface in {len(union)} blocks of {SIDE * options.voxel:g} m, over {MOST_BLOCKS}"
        raise InputError(f"{text}; are depth_unit_m and depth_max_m right? If so, give a larger voxel")
    for view in views:
        grid.integrate(_tensor(union), *_pinhole(view), *_depth(view, options))
    return without_fragments(extract(grid, SEEN), options.fragment)


def without_fragments(mesh: Mesh, least: float) -> Mesh:
    """The mesh without connected pieces of less area, m^2."""
    if mesh.is_empty:
        return mesh
    labels = connected_faces(mesh.faces, len(mesh.vertices))
    areas = np.bincount(labels, face_normals(mesh)[1])
    return drop_unreferenced(Mesh(mesh.vertices, mesh.faces[areas[labels] >= least]))


def _tensor(values: np.ndarray) -> Any:
    import open3d as o3d

    return o3d.core.Tensor.from_numpy(np.ascontiguousarray(values))


def _pinhole(view: tuple[DepthCamera, np.ndarray]) -> tuple[Any, Any, Any]:
    """A view's picture, intrinsics and extrinsics as Open3D takes them."""
    import open3d as o3d

    camera, depth = view
    looking = camera.view  # whose pixels have their middles at halves: integration cuts projections off
    return o3d.t.geometry.Image(_tensor(depth)), _tensor(looking.intrinsic), _tensor(looking.extrinsic)


def _depth(view: tuple[DepthCamera, np.ndarray], options: FusionOptions) -> tuple[float, float, float]:
    """Units in a metre, the farthest depth, m, and the truncation, voxels."""
    camera, _ = view
    return 1.0 / camera.depth_unit, float(camera.depth_range[1]), options.truncation
