"""One surface fused from all frames that a key frame is followed through (paper, section 3.3.2).

In: the motion of the key frame's mesh, and the frames. Out: a mesh in the key's pose of what enough of them have: noise
averages out, holes that come and go are closed, borders that stay open stay where they usually are.
Every frame is carried back to the key by the inverse of the blended motion; screened Poisson goes through all points.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Int64

from ...errors import InputError
from ...geometry.poisson import PoissonOptions, drop_small, reconstruct
from ...geometry.topology import clean, edge_lengths, vertex_normals
from ...types import Mesh
from ..fit.match import ON_BORDER, Target, interpolated_scalar
from .embedded import Motion

SHALLOWEST, DEEPEST = 4, 10  # octree levels
ROOM = 1.1  # Poisson's octree is so much wider than the points


@dataclass(frozen=True, slots=True)
class FusedOptions:
    """How frames become one surface; lengths are in cells of the reconstruction."""

    noise: float = 1.0  # RMS distances that a cell is wide at least: less resolves noise
    spacing: float = 0.5  # median edge lengths of the frames that it is wide at least: less resolves nothing
    reach: float = 1.5  # cells to a frame's surface within which the frame agrees
    agree: float = 0.18  # share of the frames that must agree, and two of them at least
    smallest: float = 0.02  # connected bits with less than this share of the largest one's faces are dropped

    def __post_init__(self) -> None:
        if min(self.noise, self.spacing) < 0 or self.noise + self.spacing == 0 or not self.reach > 0:
            raise InputError(
                f"fusion noise {self.noise:g}, spacing {self.spacing:g}, reach {self.reach:g}: "
                "give >= 0, >= 0, one of them above 0, and > 0"
            )
        if not 0 < self.agree <= 1 or not 0 <= self.smallest < 1:
            raise InputError(f"agree {self.agree:g}, smallest {self.smallest:g}: give shares in (0, 1] and [0, 1)")


def fused_mesh(motion: Motion, targets: Sequence[Target], noise: float, options: FusedOptions = FusedOptions()) -> Mesh:
    """The surface that the first frames of a motion, one a target, have in common, in the key's pose.

    `noise` is the RMS distance of the frames from the truth. The empty mesh where too little agrees.
    """
    carried = [Target(motion.back(at, target.mesh)) for at, target in enumerate(targets)]
    points = np.concatenate([one.mesh.vertices for one in carried])
    cell = max(options.noise * noise, options.spacing * _spacing(targets))
    if len(points) < 10 or cell == 0:
        return Mesh.empty()
    extent = ROOM * float(np.ptp(points, axis=0).max())
    depth = int(np.clip(np.floor(np.log2(extent / cell)), SHALLOWEST, DEEPEST))
    reach = options.reach * max(cell, extent / 2**depth)
    fewest = max(min(2, len(targets)), int(np.ceil(options.agree * len(targets))))
    most = max(len(target.mesh.vertices) for target in targets)
    poisson = PoissonOptions(depth=depth, reach=reach, vertices=max(most, 4), smallest=options.smallest)
    surface = reconstruct(points, np.concatenate([one.normals for one in carried]), poisson)  # all: each has one vote
    if surface.is_empty:
        return surface
    sure = _agreeing(surface, carried, reach) >= fewest
    believed = sure[surface.faces].sum(axis=1) >= 2  # neither all nor any: borders would recede or grow by half a face
    return drop_small(clean(Mesh(surface.vertices, surface.faces[believed])), options.smallest)


def _agreeing(surface: Mesh, frames: Sequence[Target], reach: float) -> Int64[np.ndarray, " V"]:
    """How many frames have surface at each vertex: within reach, facing the same way, and not past a border."""
    normals = vertex_normals(surface)
    count = np.zeros(len(surface.vertices), np.int64)
    for frame in frames:
        hits = frame.surface.closest(surface.vertices)
        near = np.linalg.norm(hits.points - surface.vertices, axis=1) <= reach
        within = interpolated_scalar(frame.inside, frame.mesh.faces, hits) > ON_BORDER
        count += near & within & (np.einsum("nd,nd->n", frame.surface.normals[hits.faces], normals) > 0)
    return count


def _spacing(targets: Sequence[Target]) -> float:
    """The median length of the frames' edges."""
    return float(np.median([np.median(edge_lengths(target.mesh)) for target in targets]))
