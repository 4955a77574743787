"""Cameras with parallel rays, for drawings and for SSIM of small pictures. In: a box. Out: four views around it."""

from __future__ import annotations

from meshreel.geometry.drawing import Parallel
from meshreel.metrics.viewpoints import MARGIN, Box, ViewOptions, extent, looking, sides


def parallel_views_around(box: Box, size: int = 512) -> list[Parallel]:
    """Return orthographic views of the box from the sides of `views_around`, size x size pixels; y points up."""
    ViewOptions(size, size)
    across, height = extent(box, "y")
    pixel = MARGIN * max(across, height) / size
    return [Parallel(size, size, pixel, looking(box.center, axes, 0.0)) for axes in sides("y")]
