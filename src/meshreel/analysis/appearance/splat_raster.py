"""Draw Gaussians: projected, sorted by depth, and composited from front to back at each pixel; with gradients.

In -> out: Gaussians in space and a camera -> a picture. The work is on pairs of a pixel and a Gaussian that reaches it,
sorted by pixel, so that no tile is padded. Sizes and limits are those of 3DGS (Kerbl et al. 2023) and of gsplat.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float32, Float64

from ...geometry.cameras import Camera
from ...geometry.splat_drawing import BLUR, LEAST, MOST, NEAR, Pairs, pairs, stable_order
from ...geometry.splats import Bound

Shares = Float64[np.ndarray, " N"]  # of each Gaussian
SPENT = 1e-4  # share of the remaining light below which Gaussians behind are not drawn
WHITE = 1.0  # the background, as in `metrics.color_render`


@dataclass(frozen=True, slots=True)
class Flat:
    """Gaussians in a picture: places, inverse covariances (xx, xy, yy) and depths; arrays of NumPy or torch."""

    centers: Any  # N 2, pixels
    conics: Any  # N 3, 1 / pixels squared
    spreads: Any  # N 2, variances along x and y, pixels squared
    depths: Any  # N


def project(xp: Any, means: Any, axes: Any, scales: Any, camera: tuple[Any, Any]) -> Flat:
    """Project Gaussians, by the local affine approximation (EWA); `camera` is (3 x 4 world to camera, 3 x 3 pixels)."""
    pose, pixels = camera
    x, y, depths = (means @ pose[:, :3].T + pose[:, 3]).T
    z = xp.where(depths > NEAR, depths, xp.ones_like(depths))
    rows = (axes * scales[:, :, None]) @ pose[:, :3].T
    right = (rows[:, :, 0] - (x / z)[:, None] * rows[:, :, 2]) / z[:, None]
    down = (rows[:, :, 1] - (y / z)[:, None] * rows[:, :, 2]) / z[:, None]
    across = pixels[0, 0] * right + pixels[0, 1] * down
    below = pixels[1, 0] * right + pixels[1, 1] * down
    xx, xy, yy = (across * across).sum(axis=1) + BLUR, (across * below).sum(axis=1), (below * below).sum(axis=1) + BLUR
    area = xx * yy - xy * xy
    centers = xp.stack([pixels[k, 0] * x / z + pixels[k, 1] * y / z + pixels[k, 2] for k in range(2)], axis=1)
    conics = xp.stack([yy / area, -xy / area, xx / area], axis=1)
    return Flat(centers, conics, xp.stack([xx, yy], axis=1), depths)


class Drawing:
    """A picture of Gaussians, with the values that its gradients need."""

    def __init__(
        self, flat: Flat, opacities: Shares, colors: Float64[np.ndarray, "N 3"], size: tuple[int, int]
    ) -> None:
        """Draw Gaussians on white; `size` is height and width."""
        self._flat, self._opacities, self._colors, self.size = flat, opacities, colors, size
        index, x, y = _pairs(flat, opacities, size)
        self._dx = (x + 0.5 - flat.centers[index, 0]).astype(np.float32)
        self._dy = (y + 0.5 - flat.centers[index, 1]).astype(np.float32)
        a, b, c = (flat.conics[:, k].astype(np.float32)[index] for k in range(3))
        power = -0.5 * (a * self._dx**2 + c * self._dy**2) - b * self._dx * self._dy
        alphas = opacities.astype(np.float32)[index] * np.exp(power)
        drawn = np.flatnonzero(alphas >= LEAST)
        pixels = (y * size[1] + x)[drawn]
        drawn = drawn[stable_order(pixels)]
        self._index, self._pixels, alphas = index[drawn], (y * size[1] + x)[drawn], alphas[drawn]
        self._dx, self._dy = self._dx[drawn], self._dy[drawn]
        self._is_free = alphas < MOST  # not clipped
        self._alphas = np.minimum(alphas, np.float32(MOST))
        self._composite()

    def _composite(self) -> None:
        """Compute the light that reaches each pair, the weight of its colour, and the picture."""
        count = self.size[0] * self.size[1]
        logs = np.log1p(-self._alphas.astype(np.float64))
        self._starts = np.searchsorted(self._pixels, np.arange(count + 1))
        sums = np.concatenate([[0.0], np.cumsum(logs)])
        light = np.exp(sums[:-1] - sums[self._starts[self._pixels]])
        lit = np.flatnonzero(light > SPENT)
        self._left, self._index, self._pixels = light[lit], self._index[lit], self._pixels[lit]
        self._alphas, self._is_free = self._alphas[lit].astype(np.float64), self._is_free[lit]
        self._dx, self._dy = self._dx[lit], self._dy[lit]
        self._starts = np.searchsorted(self._pixels, np.arange(count + 1))
        self.weights = self._alphas * self._left
        self._rest = 1 - np.bincount(self._pixels, self.weights, count)
        own = self._colors[self._index]
        channels = [np.bincount(self._pixels, self.weights * own[:, k], count) + WHITE * self._rest for k in range(3)]
        self.picture: Float64[np.ndarray, "H W 3"] = np.stack(channels, axis=1).reshape(*self.size, 3)

    def shares(self, values: Float64[np.ndarray, "H W"] | None = None) -> Shares:
        """Return the sum over all pixels of each Gaussian's weight times the pixel's value."""
        weights = self.weights if values is None else self.weights * values.reshape(-1)[self._pixels]
        return np.bincount(self._index, weights, len(self._opacities))

    def gradients(self, of_picture: Float64[np.ndarray, "H W 3"]) -> tuple[np.ndarray, ...]:
        """Return the gradients of centers, conics, opacities and colours from that of the picture."""
        n, index, flat = len(self._opacities), self._index, self._flat
        pixels = of_picture.reshape(-1, 3)
        of_pairs = pixels[self._pixels]
        gains = (of_pairs * self._colors[index]).sum(axis=1)
        added = np.concatenate([[0.0], np.cumsum(self.weights * gains)])
        white = (WHITE * self._rest * pixels.sum(axis=1))[self._pixels]
        behind = added[self._starts[self._pixels + 1]] - added[1:] + white
        alphas = (self._left * gains - behind / (1 - self._alphas)) * self._is_free
        powers = alphas * self._alphas
        a, b, c = (flat.conics[index, k] for k in range(3))
        dx, dy = self._dx, self._dy
        columns = (a * dx + b * dy, b * dx + c * dy, -0.5 * dx * dx, -dx * dy, -0.5 * dy * dy)
        sums = [np.bincount(index, powers * column, n) for column in columns]
        opacities = np.bincount(index, powers, n) / np.maximum(self._opacities, LEAST)
        colors = [np.bincount(index, self.weights * of_pairs[:, k], n) for k in range(3)]
        return np.stack(sums[:2], axis=1), np.stack(sums[2:], axis=1), opacities, np.stack(colors, axis=1)


def _pairs(flat: Flat, opacities: Shares, size: tuple[int, int]) -> tuple[Pairs, Pairs, Pairs]:
    """Return Gaussian, column and row of each pixel in the boxes that Gaussians reach, the nearest Gaussian first."""
    reach = np.sqrt(2 * np.log(np.maximum(opacities / LEAST, 1))[:, None] * flat.spreads)
    order = np.argsort(flat.depths, kind="stable")
    order = order[((flat.depths > NEAR) & (opacities >= LEAST))[order]]
    return pairs(flat.centers, reach, order, (0, 0, size[1], size[0]))


def draw(bound: Bound, camera: Camera) -> Float32[np.ndarray, "H W 3"]:
    """Return the picture of Gaussians on white, sRGB, 0 to 1."""
    flat = project(np, bound.means, bound.axes, bound.scales, (camera.extrinsic[:3], camera.intrinsic))
    return Drawing(flat, bound.opacities, bound.colors, (camera.height, camera.width)).picture.astype(np.float32)
