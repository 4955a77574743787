"""Still surface in the view of a rig's camera: a small plane at each pixel whose window is flat up to the noise."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float64

from ...geometry.depth import apart, depth_noise
from ..rig.cameras import DepthCamera

Picture = Float64[np.ndarray, "H W"]

CHANGES = 0.25  # share of the frames in which a still pixel may measure something else (guess)
WINDOW = 100  # a side of the window that a plane is fitted to, in the picture's width (guess)
FULL = 0.6  # share of the window's pixels that must have a depth (guess)
FINE = 0.5  # of `depth_noise`: what is below is flat and still (guess)
FLAT = 2.5  # times the usual distance of depths from their plane, above which a window is no plane (guess)


@dataclass(frozen=True, slots=True)
class StillView:
    """Planes that a camera sees, in its own coordinates; NaN where there is none."""

    camera: DepthCamera
    points: Float64[np.ndarray, "H W 3"]  # m, where the pixel's ray meets its plane
    normals: Float64[np.ndarray, "H W 3"]  # unit, towards the camera

    @property
    def known(self) -> Bool[np.ndarray, "H W"]:
        """The pixels that have a plane."""
        return np.isfinite(self.points[..., 2])


def still_view(camera: DepthCamera, depths: list[Picture]) -> StillView:
    """Return the planes that a camera sees in most of the frames; depths are in m, 0 where nothing is measured."""
    from scipy.ndimage import correlate1d

    usual, change = _usual(np.stack(depths))
    valid = np.isfinite(usual)
    half = max(2, round(camera.view.width / WINDOW / 2))
    steps = np.arange(-half, half + 1.0)

    def sums(values: Picture, right: int, down: int) -> Picture:
        across = correlate1d(values, steps**right, axis=1, mode="constant")
        return correlate1d(across, steps**down, axis=0, mode="constant")

    # On a plane the inverse of the depth is linear in the pixel's position.
    weight, inverse = valid.astype(np.float64), np.where(valid, 1 / usual, 0.0)
    with np.errstate(invalid="ignore", divide="ignore"):
        count = sums(weight, 0, 0)
        i, j, s = (total / count for total in (sums(weight, 1, 0), sums(weight, 0, 1), sums(inverse, 0, 0)))
        ii, jj = sums(weight, 2, 0) / count - i * i, sums(weight, 0, 2) / count - j * j
        ij = sums(weight, 1, 1) / count - i * j
        is_, js = sums(inverse, 1, 0) / count - i * s, sums(inverse, 0, 1) / count - j * s
        ss = sums(inverse**2, 0, 0) / count - s * s
        size = ii * jj - ij * ij
        right, down = (jj * is_ - ij * js) / size, (ii * js - ij * is_) / size  # change per pixel
        middle = s - right * i - down * j
        depth = 1 / middle
        off = np.sqrt(np.maximum(ss - right * is_ - down * js, 0)) * depth**2 / depth_noise(depth)
        change = np.sqrt(sums(np.where(valid, change, 0.0), 0, 0) / count)
    good = valid & (count >= FULL * len(steps) ** 2) & (size > 1e-6 * half**4) & (middle > 0)
    flat = good.copy()
    for measure in (off, change):
        flat &= measure <= max(FLAT * float(np.median(measure[good])) if good.any() else 0.0, FINE)
    depth = np.where(flat, depth, np.nan)
    (fx, fy), rays = camera.view.focal, camera.view.ahead
    a, b = (np.where(flat, slope, np.nan) for slope in (right * fx, down * fy))
    normals = -np.stack([a, b, 1 / depth - a * rays[..., 0] - b * rays[..., 1]], axis=2)
    return StillView(camera, rays * depth[..., None], normals / np.linalg.norm(normals, axis=2, keepdims=True))


def _usual(stack: Float64[np.ndarray, "T H W"]) -> tuple[Picture, Picture]:
    """Return the median of each pixel's measurements, NaN where many are of something else."""
    ordered = np.sort(np.where(stack > 0, stack, np.inf), axis=0)
    count = np.isfinite(ordered).sum(axis=0)
    middle = [np.maximum(count - 1, 0) // 2, np.minimum(count // 2, len(stack) - 1)]
    low, high = (np.take_along_axis(ordered, k[None], axis=0)[0] for k in middle)
    usual = (low + high) / 2
    with np.errstate(invalid="ignore"):
        near = np.abs(ordered - usual) <= apart(usual)
        # The mean of those: the median is too near where something passed in front of the surface.
        usual = np.where(near, ordered, 0).sum(axis=0) / near.sum(axis=0)
        change = np.where(near, (ordered - usual) ** 2, 0).sum(axis=0) / near.sum(axis=0) / depth_noise(usual) ** 2
    still = (2 * count >= len(stack)) & (near.sum(axis=0) >= (1 - CHANGES) * count) & (count > 0)
    return np.where(still, usual, np.nan), change
