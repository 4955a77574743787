"""Colours of a background: the medians over frames, so that people who pass by leave no ghosts.

In: points with normals, and sources of their colours in some frames. Out: the median colour of each point.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from jaxtyping import Bool, Float64, UInt8

from ...geometry.color_views import Paint
from ...types import GREY

BLOCK = 1 << 16  # places whose medians are taken at a time: 16 frames of them take 10 MB


def median_colors(
    points: Float64[np.ndarray, "N 3"], normals: Float64[np.ndarray, "N 3"], paints: Iterable[Paint]
) -> tuple[UInt8[np.ndarray, "N 3"], Bool[np.ndarray, " N"]]:
    """Return the medians over frames of the points' colours, and a mask of known colours; others are grey."""
    stack, masks = list[np.ndarray](), list[np.ndarray]()
    for paint in paints:
        colors, mask = paint.at(points, normals)
        stack.append(np.clip(np.rint(colors), 0, 255).astype(np.uint8))
        masks.append(mask)
    medians_or_grey = np.full(points.shape, GREY, np.uint8)
    if not stack:
        return medians_or_grey, np.zeros(len(points), bool)
    mask = np.any(masks, axis=0)
    for start in range(0, len(points), BLOCK):
        block = slice(start, start + BLOCK)
        hidden = np.repeat(~np.stack([array[block] for array in masks])[..., None], 3, axis=2)
        medians = np.ma.median(np.ma.masked_array(np.stack([array[block] for array in stack]), hidden), axis=0)
        medians_or_grey[block] = np.rint(np.ma.filled(medians, float(GREY))).astype(np.uint8)
    return medians_or_grey, mask
