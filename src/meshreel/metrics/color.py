"""Errors of colours between two surfaces, point by point as MPEG's tools measure them, and in unlit renders on white.

Points are spread evenly over one surface and have their colours compared with those of the closest points of the other;
the same the other way round, and the worse counts. Luma and colour differences are those of ITU-R BT.709, full range.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from ..geometry.color_views import Painted
from ..geometry.drawing import Crop, SeenPlaces, Viewer, draw_places
from ..types import LUMA, Mesh
from .render import MARGIN, Picture, crop_of, ssim_view
from .surface_samples import scatter

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
    """Picture of a mesh in its colours, and the places that it sees."""

    places: SeenPlaces


class Colored:
    """A mesh prepared for several views in its colours; a mesh without colours is grey (`render.Visible`)."""

    def __init__(self, mesh: Mesh) -> None:
        self._mesh, self._painted = mesh, None if mesh.is_empty else Painted(mesh)

    def look(self, camera: Viewer, crop: Crop | None = None) -> ColorView:
        """Return the picture in a crop, or the whole picture."""
        seen = draw_places(self._mesh, camera, crop)
        image = np.ones((*seen.covered.shape, 3), np.float32)
        if self._painted is not None:
            image[seen.covered] = np.clip(np.rint(self._painted.on(seen.faces, seen.barycentric)), 0, 255) / 255
        return ColorView(seen.covered, image, seen)


def render_errors(original: Mesh, decoded: Mesh, cameras: Sequence[Viewer]) -> dict[str, float]:
    """Return errors of pictures of two meshes in their colours over all views, by name.

    The PSNR of luma, dB, is over pixels that either mesh covers, so that silhouettes count, and over those that both
    cover; SSIM is masked, as in `ssim_normals`. Meshes that no view sees are equal.
    """
    pair, scores = (Colored(original), Colored(decoded)), list[float]()
    squares, counts = np.zeros(2), np.zeros(2)
    for camera in cameras:
        crop = crop_of([original, decoded], camera, MARGIN)
        a, b = (colored.look(camera, crop) for colored in pair)
        squared_luma = np.square(PEAK * ((a.colors - b.colors).astype(np.float64) @ TO_YUV[0]))
        for area, mask in enumerate((a.covered | b.covered, a.covered & b.covered)):
            squares[area] += squared_luma[mask].sum()
            counts[area] += mask.sum()
        masked = ssim_view(a, b, camera, crop)[1]
        scores += [] if masked is None else [masked]
    union, inside = (squares / np.maximum(counts, 1)).tolist()
    found = psnr(union), psnr(inside), float(np.mean(scores)) if scores else 1.0
    return dict(zip(RENDERS, found, strict=True))
