"""Fuse the still surface of many frames into one background mesh (paper, section 3.2; decision 19).

In: the still faces of some frames. Out: one mesh. Signed distances to the surfaces of the frames are averaged, which
reduces noise, and surface that people hide in one frame comes from others.
"""

from __future__ import annotations

import math
from collections.abc import Iterable

from ...geometry.reconstruct import MeanOptions, MeanSurface
from ...geometry.topology import without_fragments
from ...types import Mesh

FRAMES = 20  # of a scene: largest number of fused frames, spread over the sequence (decision 19)
SEEN = 0.15  # smallest share of the frames that must have surface at a voxel (decision 19)
STEADY = 0.6  # voxels: where the standard deviation of the distances is larger, the surface was not still (decision 19)
PAST = 0.5  # voxels by which a surface is continued past its border, so that borders do not recede (decision 19)
FRAGMENT = 0.02  # m^2: connected pieces with less area are dropped (decision 19)


def fuse_background(frames: Iterable[Mesh], voxel: float) -> Mesh:
    """Fuse meshes of one still scene into their mean surface, on a grid of `voxel` (m); reads one mesh at a time."""
    sums = MeanSurface(voxel, MeanOptions(steady=STEADY, past=PAST))
    count = 0
    for mesh in frames:
        sums.add(mesh)
        count += 1
    return without_fragments(sums.surface(least_frames(count)), FRAGMENT)


def least_frames(count: int) -> int:
    """Return how many of `count` frames must have surface at a voxel."""
    return max(1, math.ceil(SEEN * count))
