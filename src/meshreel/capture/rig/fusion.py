"""Fusion of the depth pictures of one moment into a mesh: TSDF, marching cubes, fragments dropped (paper, section 4.1).

The cameras' depths -> a mesh in world coordinates. All frames use one voxel grid, so that surface which stands still is
sampled alike in every frame. The same pictures give the same mesh, whatever the number of threads.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import UInt16

from ...errors import InputError
from ...geometry.topology import without_fragments
from ...geometry.tsdf import GRAZING, SEEN, TRUNCATION, extract, integrate
from ...types import Mesh
from .rig import DepthCamera

FINER = 2  # times the rows and columns of the pictures, interpolated, that are fused (decision 28)


@dataclass(frozen=True, slots=True)
class FusionOptions:
    """Resolution of the fused surface and removal of fragments."""

    voxel: float = 0.02  # m, side of a voxel
    truncation: float | None = None  # voxels before and behind a depth that it constrains; None: by the cameras
    fragment: float = 0.002  # m^2: connected components with less area are dropped

    def __post_init__(self) -> None:
        if not 1e-4 <= self.voxel <= 1:
            raise InputError(f"voxel {self.voxel:g}: give metres, 0.0001 to 1; 0.02 suits a room")
        if not (self.truncation is None or 1 <= self.truncation <= 20) or not 0 <= self.fragment < np.inf:
            raise InputError(
                f"truncation {self.truncation}, fragment {self.fragment:g}: give 1 to 20 voxels and an area from 0 on"
            )


def fuse_depths(
    depths: Sequence[tuple[DepthCamera, UInt16[np.ndarray, "H W"]]], options: FusionOptions = FusionOptions()
) -> Mesh:
    """Fuse the cameras' depths into a mesh, which is empty where no camera measured anything in its range.

    Raises InputError where the surface takes more blocks of voxels than `tsdf.MOST_BLOCKS`.
    """
    pictures = [camera.picture(inside) for camera, depth in depths if (inside := camera.in_range(depth)).any()]
    if not pictures:
        return Mesh.empty()
    fine, truncation = [picture.finer(FINER) for picture in pictures], options.truncation or _truncation(len(depths))
    return without_fragments(extract(integrate(fine, options.voxel, truncation), SEEN), options.fragment)


def _truncation(cameras: int) -> float:
    """Return voxels: surface seen at a grazing angle needs more, limbs that are seen from both sides bear fewer."""
    return GRAZING if cameras == 1 else TRUNCATION
