"""Make the template of a group of form LAYERS: a coarse base of its key, or of a fused mesh, and detail of all frames.

In: a key frame; fitted positions of the subdivided base. Out: the base; positions whose detail is constant
(docs/decisions/0014-template.md). Under noise, frames are moved back to the key's pose and the signed distances to all
are averaged (section 3.3.2; decision 16): noise falls, and lasting borders stay in their usual places.

Differs from the paper: no Poisson reconstruction, which invents surface that must then be removed.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
from jaxtyping import Float64, Int32

from ...geometry import work
from ...geometry.closest_points import Surface
from ...geometry.decimate import BOUNDARY_WEIGHT, decimate
from ...geometry.reconstruct import MeanOptions, MeanSurface
from ...geometry.topology import drop_small, edge_lengths, heights, levels_of, refine
from ...types import Mesh
from ..fit.frame import FrameSurface
from .embedded_graph import Motion

NOISY_ERROR = 0.5  # RMS distances of the noise that a base mesh may miss in addition (decision 16)
NOISY_BORDER = 100.0  # weight of open borders under noise: a coarse base cuts their corners (decision 16)
FEWEST = 40  # smallest number of vertices of a base mesh, enough for a body's limbs (guess)
DECAY = 1.2  # the error of quadric decimation falls with this power of the number of vertices (measured on bodies)
CURVATURE = 52  # 64ths, lift of midpoints, between the coder's 48 and 58 (decision 14)
NEAR, FAR = 0.05, 0.25  # logarithms of errors at which the search stops, in the first rounds and after (guesses)
ROUNDS, MOST_ROUNDS = 3, 8  # first rounds of the search for the number of vertices, and all of them (guesses)
LEVELS = 2  # midpoint subdivisions of the base (decision 14)
FINEST = 1024  # voxels along the frames at most: bounds memory (guess)
NOISE = 7.25  # smallest voxel, in RMS noise: finer ones resolve noise, which every frame would pay for (decision 16)
SPACING = 0.7  # smallest voxel, in median edge lengths of the frames: finer ones resolve nothing (decision 16)
REACH = 1.5  # voxels: a frame agrees with surface up to this distance from its own (decision 16)
AGREE = 0.18  # smallest share of the frames that must agree, and at least two of them (decision 16)
SMALLEST = 0.02  # connected bits with less than this share of the largest one's faces are dropped (decision 16)


def base_mesh(key: Mesh, error: float, noise: float = 0.0) -> Mesh:
    """Decimate the key frame until the RMS distance of its vertices from the base is about `error`."""
    most, aim = len(key.vertices), math.hypot(error, NOISY_ERROR * noise)
    border = NOISY_BORDER if noise else BOUNDARY_WEIGHT
    count, tried = min(max(most // 20, FEWEST), most), dict[int, tuple[float, Mesh]]()
    while len(tried) < MOST_ROUNDS and count not in tried:
        base = decimate(key, max(count, 4), border)
        gaps = Surface(base).closest(key.vertices).points - key.vertices
        missed = float(np.sqrt((gaps**2).sum(axis=1).mean()))
        if missed == 0.0 and not noise:
            return base  # exact
        tried[count] = math.log(missed / aim) if missed else -math.inf, base
        if abs(tried[count][0]) < (NEAR if len(tried) < ROUNDS else FAR):
            break
        # If a limb is lost the law does not hold: try a number between too few and too many.
        few = max((each for each, (off, _) in tried.items() if off > 0), default=FEWEST)
        many = min((each for each, (off, _) in tried.items() if off <= 0 and each > few), default=most)
        estimate = round(len(base.vertices) * (missed / aim) ** (1 / DECAY))
        is_known = few in tried and many in tried and not few < estimate < many
        count = round(math.sqrt(few * many)) if is_known else min(max(estimate, FEWEST), most)
    return min(tried.values(), key=lambda one: abs(one[0]))[1]


def shared_detail(
    faces: Int32[np.ndarray, "F 3"], count: int, levels: int
) -> Callable[[Float64[np.ndarray, "T V 3"]], Float64[np.ndarray, "T V 3"]]:
    """Return a function that makes fitted positions coherent by replacing their detail with its median over time.

    The `count` base vertices stay. Detail is defined as in the coder: scalars along the normals of the coarser level.
    """
    hierarchy = levels_of(faces, count, levels)

    def coherent(positions: Float64[np.ndarray, "T V 3"]) -> Float64[np.ndarray, "T V 3"]:
        vertices = np.ascontiguousarray(positions[:, :count])
        for level in hierarchy:
            scalars = heights(positions[:, : level.count], positions[:, : level.vertices], level, CURVATURE)
            vertices = refine(vertices, level, np.tile(np.median(scalars, axis=0), (len(vertices), 1)), CURVATURE)
        return vertices

    return coherent


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
