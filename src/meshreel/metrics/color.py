"""Errors of colours between two surfaces, point by point as MPEG's tools measure them, and in unlit renders on white.

Points are spread evenly over one surface and have their colours compared with those of the closest points of the other;
the same the other way round, and the worse counts. Luma and colour differences are those of ITU-R BT.709, full range.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int32

from ..geometry.cameras import Rays
from ..geometry.color_views import Painted
from ..types import LUMA, Mesh
from .render import MARGIN, Picture, Pixels, crop_of, ssim_view
from .surface_samples import scatter
from .viewpoints import AnyCamera

POINTS = 60_000  # on each surface: a seventh of the texels of a person's texture of 1024 x 1024 (guess)
PEAK = 255.0
LEAST = 1e-12  # squared difference; smaller ones are rounding of equal colours
COLORS = ("y_psnr", "u_psnr", "v_psnr", "yuv_psnr")  # the last one: (6 Y + U + V) / 8
RENDERS = ("view_y_psnr", "view_y_psnr_inside", "view_ssim")
SHARES = np.array([6.0, 1.0, 1.0]) / 8  # of luma and of colour differences in one number, as MPEG weighs PSNRs
TO_YUV = np.array([LUMA, (-LUMA[0] / 1.8556, -LUMA[1] / 1.8556, 0.5), (0.5, -LUMA[1] / 1.5748, -LUMA[2] / 1.5748)])


def color_errors(original: Mesh, decoded: Mesh) -> dict[str, float]:
    """Return PSNRs of the colours of two meshes, dB, by name, the worse of both directions each.

    They are infinite for equal colours. A mesh without colours is grey; two empty ones are equal, where one is empty
    PSNRs are 0.
    """
    if original.is_empty or decoded.is_empty:
        found = [math.inf if original.is_empty and decoded.is_empty else 0.0] * 3
    else:
        pair = Painted(original), Painted(decoded)
        found = [psnr(s) for s in np.maximum(_squares(original, *pair), _squares(decoded, *pair[::-1])).tolist()]
    return dict(zip(COLORS, (*found, float(SHARES @ found)), strict=True))


def psnr(square: float) -> float:
    """Return the PSNR of a mean squared difference of 8-bit values, dB; infinite for equal ones."""
    return 10 * math.log10(PEAK**2 / square) if square > LEAST else math.inf


def _squares(mesh: Mesh, own: Painted, other: Painted) -> Float64[np.ndarray, " 3"]:
    """Return the mean squared differences of luma and colour differences at points of a mesh."""
    sample = scatter(mesh, np.ones(len(mesh.faces), bool), POINTS)
    errors = own.on(sample.faces.astype(np.int32), sample.barycentric) - other.at(sample.points, sample.points)[0]
    return np.square(errors @ TO_YUV.T).mean(axis=0)


@dataclass(frozen=True, slots=True)
class ColorView(Picture):
    """Picture of a mesh in its colours, and the faces that it sees."""

    faces: Int32[np.ndarray, "H W"]  # -1 where nothing is seen


class Colored:
    """A mesh prepared for several views in its colours; a mesh without colours is grey (`render.Visible`)."""

    def __init__(self, mesh: Mesh) -> None:
        self._surface = None if mesh.is_empty else (Rays(mesh), Painted(mesh))

    def look(self, pixels: Pixels) -> ColorView:
        shape, image = pixels.crop.shape, np.ones((*pixels.crop.shape, 3), np.float32)
        if self._surface is None:
            return ColorView(np.zeros(shape, bool), image, np.full(shape, -1, np.int32))
        rays, painted = self._surface
        hit = rays.cast(*pixels.world_rays)
        covered = hit.faces >= 0
        colors = painted.on(hit.faces[covered], hit.barycentric[covered])
        image.reshape(-1, 3)[covered] = np.clip(np.rint(colors), 0, 255) / 255
        return ColorView(covered.reshape(shape), image, hit.faces.reshape(shape))


def render_errors(original: Mesh, decoded: Mesh, cameras: Sequence[AnyCamera]) -> dict[str, float]:
    """Return errors of pictures of two meshes in their colours over all views, by name.

    The PSNR of luma, dB, is over pixels that either mesh covers, so that silhouettes count, and over those that both
    cover; SSIM is masked, as in `ssim_normals`. Meshes that no view sees are equal.
    """
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
    found = psnr(union), psnr(inside), float(np.mean(scores)) if scores else 1.0
    return dict(zip(RENDERS, found, strict=True))
