"""Colours of a background: what its places show in most frames, so that nobody who passes leaves a ghost.

In: a mesh, and frames with colours whose faces stand still or move. Out: 8-bit colours of its vertices.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from jaxtyping import UInt8

from ...geometry.closest_points import Surface
from ...geometry.painted import Painted
from ...types import GREY, Mesh


def background_colors(mesh: Mesh, frames: Iterable[Mesh], far: float) -> UInt8[np.ndarray, "V 3"]:
    """Return the medians of the colours that frames have within `far` of each vertex.

    The frames have only what stands still. A vertex that none of them comes near has the colour of what comes nearest;
    where no frame has a surface, all are grey.
    """
    stack, gaps = list[np.ndarray](), list[np.ndarray]()
    for frame in frames:
        if frame.is_empty:
            continue
        surface = Surface(frame)
        hits = surface.closest(mesh.vertices)
        stack.append(Painted(frame, surface).on(hits.faces, hits.barycentric))
        gaps.append(np.linalg.norm(hits.points - mesh.vertices, axis=1))
    if not stack:
        return np.full(mesh.vertices.shape, GREY, np.uint8)
    colors, distance = np.stack(stack), np.stack(gaps)
    nearest = colors[distance.argmin(axis=0), np.arange(len(mesh.vertices))]
    seen = np.ma.masked_array(colors, np.repeat((distance > far)[..., None], 3, axis=2))
    found = np.ma.median(seen, axis=0).filled(np.nan)
    found = np.where(np.isfinite(found), found, nearest)
    return np.clip(np.rint(found), 0, 255).astype(np.uint8)
