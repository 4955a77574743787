"""Fuse one template from all frames through which a key frame is tracked (paper, section 3.3.2; decision 16).

In: the motion of the key frame's mesh, and the frames. Out: a mesh in the key's pose of the surface that enough frames
have: noise averages out, temporary holes are closed, and lasting borders stay where they usually are. Every frame is
moved back to the key by the inverse of the blended motion; screened Poisson reconstruction uses all points.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Int64

from ...geometry import work
from ...geometry.poisson import PoissonOptions, drop_small, reconstruct
from ...geometry.topology import clean, edge_lengths, vertex_normals
from ...types import Mesh
from ..fit.frame import ON_BORDER, FrameSurface
from .embedded import Motion

SHALLOWEST, DEEPEST = 4, 10  # limits of the octree's depth (guess)
ROOM = 1.1  # width of Poisson's octree, in widths of the points: Open3D's default


@dataclass(frozen=True, slots=True)
class FusedOptions:
    """Options of the fusion of frames into a template (values: decision 16)."""

    noise: float = 1.0  # smallest width of a cell, in RMS noise: finer cells resolve noise
    spacing: float = 0.5  # smallest width of a cell, in median edge lengths of the frames: finer cells resolve nothing
    reach: float = 1.5  # cells: a frame agrees with surface up to this distance from its own
    agree: float = 0.18  # smallest share of the frames that must agree, and at least two of them
    smallest: float = 0.02  # connected bits with less than this share of the largest one's faces are dropped


def fused_mesh(
    motion: Motion, frames: Sequence[FrameSurface], noise: float, options: FusedOptions = FusedOptions()
) -> Mesh:
    """Fuse the surface that the first `len(frames)` frames of a motion have in common, in the key's pose.

    `noise` is the RMS distance of the frames from the truth. The mesh is empty if too little agrees.
    """
    work.count("surfaces fused")
    carried = [FrameSurface(motion.back(at, frame.mesh)) for at, frame in enumerate(frames)]
    points = np.concatenate([one.mesh.vertices for one in carried])
    spacing = float(np.median([np.median(edge_lengths(frame.mesh)) for frame in frames]))
    cell = max(options.noise * noise, options.spacing * spacing)
    if len(points) < 10 or cell == 0:
        return Mesh.empty()
    extent = ROOM * float(np.ptp(points, axis=0).max())
    depth = int(np.clip(np.floor(np.log2(extent / cell)), SHALLOWEST, DEEPEST))
    reach = options.reach * max(cell, extent / 2**depth)
    fewest = max(min(2, len(frames)), int(np.ceil(options.agree * len(frames))))
    most = max(len(frame.mesh.vertices) for frame in frames)
    poisson = PoissonOptions(depth=depth, reach=reach, vertices=max(most, 4), smallest=options.smallest)
    surface = reconstruct(
        points, np.concatenate([one.normals for one in carried]), poisson
    )  # all points: each has one vote
    if surface.is_empty:
        return surface
    sure = _agreeing(surface, carried, reach) >= fewest
    believed = sure[surface.faces].sum(axis=1) >= 2  # with all or any, borders would recede or grow by half a face
    return drop_small(clean(Mesh(surface.vertices, surface.faces[believed])), options.smallest)


def _agreeing(surface: Mesh, frames: Sequence[FrameSurface], reach: float) -> Int64[np.ndarray, " V"]:
    """Count the frames that have surface at each vertex: within reach, facing the same way, and not past a border."""
    normals = vertex_normals(surface)
    count = np.zeros(len(surface.vertices), np.int64)
    for frame in frames:
        hits = frame.surface.closest(surface.vertices)
        near = np.linalg.norm(hits.points - surface.vertices, axis=1) <= reach
        within = frame.inside_at(hits) > ON_BORDER
        count += near & within & (np.einsum("nd,nd->n", frame.surface.normals[hits.faces], normals) > 0)
    return count
