"""Where a template is in other frames, before it is fitted: from its key frame, or from the last frame of a group.

In: a template that lies on one surface, the frames. Out: its predicted positions (docs/decisions/0011-correspondence).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float64

from ..geometry.topology import vertex_normals
from ..types import Mesh
from .embedded import EmbeddedOptions, Tracker
from .fit_match import Target


def from_key(
    template: Mesh, key: int, targets: Sequence[Target], options: EmbeddedOptions
) -> Float64[np.ndarray, "T V 3"]:
    """The positions in every frame of a template that lies on frame `key`."""
    if len(targets) == 1:
        return template.vertices[None].copy()
    tracker = Tracker(targets[key].mesh, key, options)
    for frame in [*range(key + 1, len(targets)), *reversed(range(key))]:
        tracker.step(frame, targets[frame])
    return tracker.motion(range(len(targets))).move(template.vertices, vertex_normals(template))


def from_last(template: Mesh, targets: Sequence[Target], options: EmbeddedOptions) -> Float64[np.ndarray, "T V 3"]:
    """The positions in every frame of a template as it lies on the frame before them."""
    tracker = Tracker(template, -1, options)
    for frame, target in enumerate(targets):
        tracker.step(frame, target)
    return tracker.motion(range(len(targets))).move(template.vertices, vertex_normals(template))
