"""Cameras with parallel rays, for drawings and for SSIM of small pictures. In: a box. Out: four views around it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float64

from meshreel.metrics.viewpoints import MARGIN, Box, ViewOptions, extent, looking, sides


@dataclass(frozen=True, slots=True)
class OrthographicCamera:
    """Camera with parallel rays, which may start behind its plane."""

    width: int
    height: int
    pixel: float  # m, side of a pixel
    extrinsic: Float64[np.ndarray, "4 4"]
    back: float = 0.0  # m, how far behind the camera's plane rays start

    def rays(self, pixels: Float64[np.ndarray, "N 2"]) -> tuple[np.ndarray, np.ndarray]:
        """Return parallel rays along +z through image positions."""
        plane = (pixels - np.array([self.width, self.height]) / 2) * self.pixel
        origins = np.column_stack([plane, np.full(len(pixels), -self.back)])
        return origins, np.broadcast_to(np.array([0.0, 0.0, 1.0]), origins.shape)

    def project(self, points: Float64[np.ndarray, "N 3"]) -> Float64[np.ndarray, "N 2"]:
        """Project points of the camera frame to image positions in parallel."""
        return points[:, :2] / self.pixel + np.array([self.width, self.height]) / 2

    def record(self) -> dict[str, Any]:
        """Return the camera as a record like Open3D's, with the side of a pixel in place of intrinsics."""
        place = {"class_name": "OrthographicCamera", "extrinsic": self.extrinsic.T.reshape(-1).tolist()}
        return place | {"size": [self.width, self.height], "pixel_m": self.pixel}


def parallel_views_around(box: Box, size: int = 512) -> list[OrthographicCamera]:
    """Return orthographic views of the box from the sides of `views_around`, size x size pixels; y points up."""
    ViewOptions(size, size)
    across, height = extent(box, "y")
    pixel = MARGIN * max(across, height) / size
    ways, back = (looking(box.center, axes, 0.0) for axes in sides("y")), 2 * (across + height)
    return [OrthographicCamera(size, size, pixel, way, back) for way in ways]
