"""Errors of colours between two surfaces, point by point, as MPEG's tools measure them on sampled meshes.

An original and a decoded mesh with colours -> ColorErrors. Points are spread evenly over one surface and have their
colours compared with those of the closest points of the other; the same the other way round, and the worse counts.
Luma and colour differences are those of ITU-R BT.709, full range.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from ..geometry.color_views import Painted
from ..types import LUMA, Mesh
from .even_points import scatter

POINTS = 60_000  # on each surface: a seventh of the texels of a person's texture of 1024 x 1024 (guess)
PEAK = 255.0
LEAST = 1e-12  # squared difference; smaller ones are rounding of equal colours
SHARES = np.array([6.0, 1.0, 1.0]) / 8  # of luma and of colour differences in one number, as MPEG weighs PSNRs
TO_YUV = np.array([LUMA, (-LUMA[0] / 1.8556, -LUMA[1] / 1.8556, 0.5), (0.5, -LUMA[1] / 1.5748, -LUMA[2] / 1.5748)])


@dataclass(frozen=True, slots=True)
class ColorErrors:
    """PSNRs of colours, dB, the worse of both directions each; infinite for equal colours."""

    y: float
    u: float
    v: float

    @property
    def yuv(self) -> float:
        """(6 Y + U + V) / 8."""
        return float(SHARES @ [self.y, self.u, self.v])


def color_errors(original: Mesh, decoded: Mesh) -> ColorErrors:
    """Measure the colours of two meshes; a mesh without colours counts as grey.

    Two meshes without faces are equal; where one has none, PSNRs are 0.
    """
    if original.is_empty or decoded.is_empty:
        same = math.inf if original.is_empty and decoded.is_empty else 0.0
        return ColorErrors(same, same, same)
    pair = Painted(original), Painted(decoded)
    squares = np.maximum(_squares(original, *pair), _squares(decoded, *pair[::-1]))
    return ColorErrors(*map(psnr, squares.tolist()))


def psnr(square: float) -> float:
    """Return the PSNR of a mean squared difference of 8-bit values, dB; infinite for equal ones."""
    return 10 * math.log10(PEAK**2 / square) if square > LEAST else math.inf


def _squares(mesh: Mesh, own: Painted, other: Painted) -> Float64[np.ndarray, " 3"]:
    """Return the mean squared differences of luma and colour differences at points of a mesh."""
    sample = scatter(mesh, np.ones(len(mesh.faces), bool), POINTS)
    errors = own.on(sample.faces.astype(np.int32), sample.barycentric) - other.at(sample.points, sample.points)[0]
    return np.square(errors @ TO_YUV.T).mean(axis=0)
