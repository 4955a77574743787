"""Fuse one template from all frames through which a key frame is tracked (paper, section 3.3.2; decision 16).

In: the motion of the key frame's mesh, and the frames. Out: a mesh in the key's pose of the surface that enough frames
have: averaging reduces noise, temporary holes are closed, and lasting borders stay in their usual places. Every frame
is moved back to the key by the inverse of the blended motion; the signed distances to all are averaged.

Differs from the paper: no Poisson reconstruction, which invents surface that must then be removed.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...geometry import work
from ...geometry.decimate import decimate
from ...geometry.reconstruct import MeanOptions, MeanSurface
from ...geometry.topology import drop_small, edge_lengths
from ...types import Mesh
from ..fit.frame import FrameSurface
from .embedded import Motion

FINEST = 1024  # voxels along the frames at most: bounds memory (guess)
NOISE = 7.25  # smallest voxel, in RMS noise: finer ones resolve noise, which every frame would pay for (decision 16)
SPACING = 0.7  # smallest voxel, in median edge lengths of the frames: finer ones resolve nothing (decision 16)
REACH = 1.5  # voxels: a frame agrees with surface up to this distance from its own (decision 16)
AGREE = 0.18  # smallest share of the frames that must agree, and at least two of them (decision 16)
SMALLEST = 0.02  # connected bits with less than this share of the largest one's faces are dropped (decision 16)


def fused_mesh(motion: Motion, frames: Sequence[FrameSurface], noise: float) -> Mesh:
    """Fuse the surface that the first `len(frames)` frames of a motion have in common, in the key's pose.

    `noise` is the RMS distance of the frames from the truth. The mesh is empty if too little agrees.
    """
    work.count("surfaces fused")
    carried = [motion.back(at, frame.mesh) for at, frame in enumerate(frames)]
    spacing = float(np.median([np.median(edge_lengths(frame.mesh)) for frame in frames]))
    voxel = max(NOISE * noise, SPACING * spacing)
    voxel = max(voxel, max(float(np.ptp(mesh.vertices, axis=0).max(initial=0)) for mesh in carried) / FINEST)
    if voxel == 0:
        return Mesh.empty()
    mean = MeanSurface(voxel, MeanOptions(reach=REACH))
    for mesh in carried:
        mean.add(mesh)
    surface = mean.surface(max(min(2, len(frames)), int(np.ceil(AGREE * len(frames)))))
    most = max(len(frame.mesh.vertices) for frame in frames)
    return drop_small(decimate(surface, max(most, 4)), SMALLEST)
