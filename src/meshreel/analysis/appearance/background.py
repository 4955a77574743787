"""Colours of a background: what its places show in most frames, so that nobody who passes leaves a ghost.

In: places with normals, and what knows their colours in some frames. Out: the median of the colours of each place.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from jaxtyping import Bool, Float64, UInt8

from ...geometry.painted import Paint
from ...types import GREY

BLOCK = 1 << 16  # places whose medians are taken at a time: 16 frames of them take 10 MB


def median_colors(
    points: Float64[np.ndarray, "N 3"], normals: Float64[np.ndarray, "N 3"], paints: Iterable[Paint]
) -> tuple[UInt8[np.ndarray, "N 3"], Bool[np.ndarray, " N"]]:
    """Return the medians over frames of the colours of places, and which places some frame knows; others are grey."""
    stack, known = list[np.ndarray](), list[np.ndarray]()
    for paint in paints:
        colors, seen = paint.at(points, normals)
        stack.append(np.clip(np.rint(colors), 0, 255).astype(np.uint8))
        known.append(seen)
    found = np.full(points.shape, GREY, np.uint8)
    if not stack:
        return found, np.zeros(len(points), bool)
    seen = np.any(known, axis=0)
    for start in range(0, len(points), BLOCK):
        some = slice(start, start + BLOCK)
        hidden = np.repeat(~np.stack([one[some] for one in known])[..., None], 3, axis=2)
        medians = np.ma.median(np.ma.masked_array(np.stack([one[some] for one in stack]), hidden), axis=0)
        found[some] = np.rint(np.ma.filled(medians, float(GREY))).astype(np.uint8)
    return found, seen
