"""Ray-cast pictures of coloured surfaces, unlit, on white, and the errors between those of two meshes.

Two meshes and cameras -> RenderErrors. Luma is that of ITU-R BT.709, full range; SSIM is that of `metrics.ssim`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float32, Int32

from ..geometry.cameras import Rays
from ..geometry.color_views import Painted
from ..types import Mesh
from .color import PEAK, TO_YUV, psnr
from .render import Pixels, crop_of
from .ssim import MARGIN, ssim_view
from .viewpoints import AnyCamera


@dataclass(frozen=True, slots=True)
class RenderErrors:
    """Errors of coloured pictures, over all views; PSNRs are those of luma, dB, infinite for equal pictures."""

    y_union: float  # over pixels that either mesh covers: silhouettes count
    y_inside: float  # over those that both cover
    ssim: float  # masked, as `NormalSsim.masked`


@dataclass(frozen=True, slots=True)
class ColorView:
    """Surface and colours that one camera sees in one crop (`render.Picture`)."""

    colors: Float32[np.ndarray, "H W 3"]  # 0 to 1
    faces: Int32[np.ndarray, "H W"]  # -1 where nothing is seen

    @property
    def covered(self) -> Bool[np.ndarray, "H W"]:
        return self.faces >= 0


class Colored:
    """A mesh prepared for several views in its colours; a mesh without colours is grey (`render.Visible`)."""

    def __init__(self, mesh: Mesh) -> None:
        self._surface = None if mesh.is_empty else (Rays(mesh), Painted(mesh))

    def look(self, pixels: Pixels) -> ColorView:
        shape, image = pixels.crop.shape, np.ones((*pixels.crop.shape, 3), np.float32)
        if self._surface is None or 0 in shape:
            return ColorView(image, np.full(shape, -1, np.int32))
        rays, painted = self._surface
        hit = rays.cast(*pixels.world_rays)
        covered = hit.faces >= 0
        colors = painted.on(hit.faces[covered], hit.barycentric[covered])
        image.reshape(-1, 3)[covered] = np.clip(np.rint(colors), 0, 255) / 255
        return ColorView(image, hit.faces.reshape(shape))


def render_errors(original: Mesh, decoded: Mesh, cameras: Sequence[AnyCamera]) -> RenderErrors:
    """Compare pictures of two meshes in their colours; meshes that no view sees are equal."""
    pair, scores = (Colored(original), Colored(decoded)), list[float]()
    squares, counts = np.zeros(2), np.zeros(2)
    for camera in cameras:
        pixels = Pixels(camera, crop_of([original, decoded], camera, MARGIN))
        a, b = (colored.look(pixels) for colored in pair)
        squared_luma = np.square(PEAK * ((a.colors - b.colors).astype(np.float64) @ TO_YUV[0]))
        for area, mask in enumerate((a.covered | b.covered, a.covered & b.covered)):
            squares[area] += squared_luma[mask].sum()
            counts[area] += mask.sum()
        masked = ssim_view(a, b, pixels)[1]
        scores += [] if masked is None else [masked]
    union, inside = (squares / np.maximum(counts, 1)).tolist()
    return RenderErrors(psnr(union), psnr(inside), float(np.mean(scores)) if scores else 1.0)
