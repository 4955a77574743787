"""SSIM of normal-colored renderings, over the whole picture (the paper's form) and over covered pixels only.

Two meshes and cameras -> NormalSsim, as scikit-image has it: 7 x 7 uniform windows, three channels, data range 1, its
3-pixel border left out. The white background scores 1 and inflates the whole-picture form; the masked form is the mean
over pixels that either mesh covers. Only the crop around the meshes is rendered: outside, SSIM is 1 by definition.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float32, Float64
from scipy.ndimage import uniform_filter

from ..types import Mesh
from .render import Crop, Picture, Pixels, Visible, crop_of
from .viewpoints import AnyCamera

_SIDE = 7  # pixels, side of the SSIM window: scikit-image's default
_UNBIASED = _SIDE**2 / (_SIDE**2 - 1)  # of covariances in a window
_C1, _C2 = 0.01**2, 0.03**2  # Wang et al., at data range 1
BORDER = _SIDE // 2
MARGIN = 2 * _SIDE  # pixels of a crop around what is seen


@dataclass(frozen=True, slots=True)
class NormalSsim:
    """SSIM of one frame, averaged over the views; 1 is identical."""

    whole: float  # over the whole picture
    masked: float  # over pixels that either mesh covers, views that see neither left out


@dataclass(frozen=True, slots=True)
class _Drawn:
    """A normal-colored picture without the surface behind it (`render.Picture`)."""

    covered: Bool[np.ndarray, "H W"]
    colors: Float32[np.ndarray, "H W 3"]


class Remembered:
    """A mesh that keeps its normal-colored pictures, for comparisons with several meshes from the same cameras."""

    def __init__(self, mesh: Mesh) -> None:
        self.mesh, self._visible = mesh, Visible(mesh)
        self._drawn = list[tuple[AnyCamera, Crop, _Drawn]]()

    def look(self, pixels: Pixels) -> Picture:
        """Render the mesh in a crop of a camera's image, or return the picture from before."""
        for camera, crop, drawn in self._drawn:
            if camera is pixels.camera and crop == pixels.crop:
                return drawn
        view = self._visible.look(pixels)
        self._drawn.append((pixels.camera, pixels.crop, _Drawn(view.covered, view.colors)))
        return self._drawn[-1][-1]


def ssim_normals(original: Mesh | Remembered, decoded: Mesh, cameras: Sequence[AnyCamera]) -> NormalSsim:
    """Compute SSIM between the normal-colored renderings of two meshes (paper, section 4: four views)."""
    pair = original if isinstance(original, Remembered) else Remembered(original), Visible(decoded)
    views = [Pixels(camera, crop_of([pair[0].mesh, decoded], camera, MARGIN)) for camera in cameras]
    scores = [ssim_view(pair[0].look(pixels), pair[1].look(pixels), pixels) for pixels in views]
    counted = [masked for _, masked in scores if masked is not None]
    return NormalSsim(float(np.mean([whole for whole, _ in scores])), float(np.mean(counted)) if counted else 1.0)


def ssim_view(a: Picture, b: Picture, pixels: Pixels) -> tuple[float, float | None]:
    """Return SSIM of two pictures over the whole image, and over pixels that either covers; None without such."""
    camera, crop = pixels.camera, pixels.crop
    interior = np.zeros((camera.height, camera.width), dtype=bool)
    interior[BORDER:-BORDER, BORDER:-BORDER] = True
    inside = interior[crop.top : crop.bottom, crop.left : crop.right]
    if min(crop.shape) < _SIDE:  # the meshes are out of this picture or at its very edge
        return 1.0, None
    scores = ssim_map(a.colors.astype(np.float64), b.colors.astype(np.float64))
    outside = int(interior.sum()) - int(inside.sum())
    whole = (float(scores[inside].sum()) + outside) / int(interior.sum())
    covered = (a.covered | b.covered) & inside
    return whole, float(scores[covered].mean()) if covered.any() else None


def ssim_map(a: Float64[np.ndarray, "H W 3"], b: Float64[np.ndarray, "H W 3"]) -> Float64[np.ndarray, "H W"]:
    """Return the SSIM of every pixel, averaged over the three channels (Wang et al. 2004, eq. 13)."""

    def mean(values: Float64[np.ndarray, "H W 3"]) -> Float64[np.ndarray, "H W 3"]:
        return uniform_filter(values, (_SIDE, _SIDE, 1))

    ux, uy = mean(a), mean(b)
    vx, vy, vxy = (_UNBIASED * (mean(p * q) - u * v) for p, q, u, v in ((a, a, ux, ux), (b, b, uy, uy), (a, b, ux, uy)))
    means, spreads = ux * ux + uy * uy + _C1, vx + vy + _C2
    return np.asarray((2 * ux * uy + _C1) * (2 * vxy + _C2) / (means * spreads)).mean(axis=-1)
