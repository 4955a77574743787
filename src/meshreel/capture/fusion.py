"""Depth pictures of one moment become one mesh: TSDF, marching cubes, fragments dropped (paper, section 4.1).

In: what each camera of a rig measured. Out: a mesh in world coordinates, on one voxel grid for all frames, so that what
stands still has the same grid around it always. The same pictures give the same mesh, whatever the number of threads.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import UInt16

from ..errors import InputError
from ..geometry.connected import without_fragments
from ..geometry.tsdf import SEEN, TRUNCATION, extract, integrate
from ..types import Mesh
from .rig import DepthCamera


@dataclass(frozen=True, slots=True)
class FusionOptions:
    """How depth becomes surface."""

    voxel: float = 0.02  # m, side of a voxel
    truncation: float = TRUNCATION  # voxels that a depth says something about before and behind it
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

    Raises InputError where what they see takes more blocks of voxels than there is memory for.
    """
    pictures = [camera.picture(inside) for camera, depth in depths if (inside := camera.in_range(depth)).any()]
    if not pictures:
        return Mesh.empty()
    return without_fragments(extract(integrate(pictures, options.voxel, options.truncation), SEEN), options.fragment)
