"""Splats in pictures, as in the player's `splat_shaders.ts`: projected by the local affine approximation (EWA).

In: Gaussians in space, a camera, a picture. Out: the picture with the Gaussians blended over it, the farthest first.
Unlike those of the fit (`analysis/appearance/splat_raster.py`), the same pictures come on every machine. Sizes and
limits are those of 3DGS (Kerbl et al. 2023) and of gsplat.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..shapes import Float64, Int64
from .cameras import Camera
from .drawing import box_pixels
from .splats import Bound
from .strict import exp, inverses, log2, products

if TYPE_CHECKING:
    from .picture import Rgba

BLUR = 0.3  # pixels squared, added to projected variances so that no Gaussian falls between pixels
LEAST = 1 / 255  # smallest opacity that is drawn: less changes no 8-bit picture
MOST = 0.999  # largest opacity, so that Gaussians behind it have a gradient in the fit (guess)
TOGETHER = 1 << 20  # pairs of a pixel and a Gaussian that are in memory together: some 100 MB (guess)
NEAR = 1e-6  # depth up to which nothing is drawn

Pairs = Int64[np.ndarray, " P"]  # a number for each pair of a pixel and a Gaussian
Chosen = Int64[np.ndarray, " K"]  # Gaussians
Places = Float64[np.ndarray, "N 2"]  # pixels


@dataclass(frozen=True, slots=True)
class FlatSplats:
    """Gaussians in a picture, the farthest first."""

    centers: Places
    conics: Float64[np.ndarray, "N 2 2"]  # inverse covariances, 1 / pixels squared
    reach: Places  # half the sides of the box in which it is drawn
    depths: Float64[np.ndarray, " N"]
    opacities: Float64[np.ndarray, " N"]
    colors: Float64[np.ndarray, "N 3"]  # sRGB, 0 to 1

    @staticmethod
    def of(bound: Bound, camera: Camera) -> FlatSplats:
        """Project Gaussians; those behind the camera are left out."""
        local = camera.local(bound.means)
        shown = np.flatnonzero((local[:, 2] > NEAR) & (bound.opacities >= LEAST))
        shown = shown[np.argsort(-local[shown, 2], kind="stable")]
        local, depths, opacities = local[shown], local[shown, None, 2:], bound.opacities[shown]
        axes = (bound.axes[shown] * bound.scales[shown, :, None]).reshape(-1, 3)
        axes = products(axes, camera.extrinsic[:3, :3].T).reshape(-1, 3, 3)
        deviations = (axes[..., :2] - local[:, None, :2] / depths * axes[..., 2:]) / depths * camera.focal
        variances = np.einsum("nki,nkj->nij", deviations, deviations) + BLUR * np.eye(2)
        spreads = 2 * math.log(2) * log2(opacities / LEAST)[:, None] * variances[:, [0, 1], [0, 1]]
        look = depths[:, 0, 0], opacities, bound.colors[shown]
        return FlatSplats(camera.project(local), inverses(variances), np.sqrt(spreads), *look)

    def lay(self, picture: Rgba, top: int, nearest: Float64[np.ndarray, "R S"]) -> None:
        """Blend Gaussians over rows of a picture, from `top` on, where their depths are below `nearest` of samples."""
        height, width = picture.shape[:2]
        reaching = np.flatnonzero(np.abs(self.centers[:, 1] - top - height / 2) < self.reach[:, 1] + height / 2)
        sizes = np.minimum(2 * self.reach[reaching] + 1, (width, height)).prod(axis=1)
        for some in np.split(reaching, np.flatnonzero(np.diff(np.cumsum(sizes) // TOGETHER)) + 1):
            self._blend(some, picture, top, nearest)

    def _blend(self, some: Chosen, picture: Rgba, top: int, nearest: Float64[np.ndarray, "R S"]) -> None:
        height, width = picture.shape[:2]
        index, x, y = pairs(self.centers, self.reach, some, (0, top, width, top + height))
        away = np.stack([x, y], axis=1) + 0.5 - self.centers[index]
        power = np.einsum("pi,pij,pj->p", away, self.conics[index], away)
        alphas, pixels = self.opacities[index] * exp(-power / 2), (y - top) * width + x
        drawn = np.flatnonzero(alphas >= LEAST)
        drawn = drawn[stable_order(pixels[drawn])]
        index, pixels, alphas = index[drawn], pixels[drawn], np.minimum(alphas[drawn], MOST)
        alphas *= (self.depths[index, None] < nearest[pixels]).mean(axis=1)
        first = np.flatnonzero(np.diff(pixels, prepend=-1))
        layer = np.arange(len(pixels)) - np.repeat(first, np.diff(first, append=len(pixels)))
        order = stable_order(layer)
        ends, rows = np.cumsum(np.bincount(layer)), picture.reshape(-1, 4)
        for at in np.split(order, ends[:-1]):  # a Gaussian of each pixel at a time
            alpha = alphas[at, None]
            rows[pixels[at], :3] += alpha * (self.colors[index[at]] - rows[pixels[at], :3])
            rows[pixels[at], 3:] += alpha * (1 - rows[pixels[at], 3:])


def pairs(
    centers: Places, reach: Places, order: Chosen, window: tuple[int, int, int, int]
) -> tuple[Pairs, Pairs, Pairs]:
    """Return Gaussian, column and row of each pixel of a window in the boxes of Gaussians, these in an order.

    The window is its first column and row, and those beyond its last.
    """
    least, most = np.array(window[:2]), np.array(window[2:])
    low = np.clip(np.ceil(centers - reach - 0.5), least, most).astype(np.int64)
    high = np.clip(np.floor(centers + reach - 0.5) + 1, least, most).astype(np.int64)
    return box_pixels(low, high, order)


def stable_order(numbers: Pairs) -> Pairs:
    """Return a stable order of numbers from 0, by NumPy's radix sort, which exists for 16 bits."""
    order = np.argsort((numbers & 0xFFFF).astype(np.uint16), kind="stable")
    if numbers.max(initial=0) > 0xFFFF:
        order = order[np.argsort((numbers >> 16).astype(np.uint16)[order], kind="stable")]
    return order
