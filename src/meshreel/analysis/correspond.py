"""Where a template is in other frames, before it is fitted: from its key frame, or from the last frame of a group.

In: a template in one frame, the frames. Out: its predicted positions. The volume-tracked centers move it (section 3.1).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float64

from ..types import Mesh
from .deform import DeformOptions, bind, center_motions, move, neighbours
from .reference_centers import ReferenceCenterOptions, affinity, largest_distances
from .track import TrackOptions, track_centers


def from_key(template: Mesh, key: int, frames: Sequence[Mesh], options: TrackOptions) -> Float64[np.ndarray, "T V 3"]:
    """The positions in every frame of a template that lies on frame `key`."""
    if len(frames) == 1:
        return template.vertices[None].copy()
    centers = track_centers(frames, options)
    deform = DeformOptions()
    kin = neighbours(affinity(largest_distances(centers), ReferenceCenterOptions()), deform)
    pose = centers.positions[key]
    binding = bind(template, pose, kin, deform)
    motions = (center_motions(pose, each, kin) for each in centers.positions)
    return np.stack([move(template.vertices, binding, motion, kin) for motion in motions])


def from_last(
    template: Mesh, last: Mesh, frames: Sequence[Mesh], options: TrackOptions
) -> Float64[np.ndarray, "T V 3"]:
    """The positions in every frame of a template that lies on `last`, the frame before them."""
    return from_key(template, 0, [last, *frames], options)[1:]
