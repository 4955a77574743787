"""Comparison of pictures of splats with pictures of the originals, for `meshreel compare`."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..analysis.appearance.splat_fit import SplatView
from ..analysis.appearance.splat_raster import draw
from ..analysis.appearance.splat_views import GOLDEN, rendered, ring, taken
from ..decoder.video import Video
from ..encoder.group.progress import Progress
from ..errors import InputError
from ..geometry.derived_sequences import captured
from ..geometry.splats import Bound
from ..metrics.color import PEAK, psnr
from ..metrics.ssim import BORDER, ssim_map
from ..types import MeshSequence, evenly

FRAMES, VIEWS, SIZE = 8, 4, 256  # frames that are compared, cameras around each, and pixels of the longer side
ASIDE = 0.11  # turns, from a camera to which the encoder fitted splats


def compare_splats(sequence: MeshSequence, video: Video, progress: Progress) -> dict[str, Any]:
    """Return PSNR, dB, and SSIM of pictures of splats in some frames, cropped to the bodies.

    They are compared with a rig's pictures, or with renders of coloured meshes from cameras that were not used to fit.
    Raises InputError if there are neither.
    """
    numbers, squares, scores = evenly(len(sequence), FRAMES), list[float](), list[float]()
    for done, number in enumerate(numbers, 1):
        if (bound := video.splats(number)) is not None:
            for square, score in (errors(bound, view) for view in held_out(sequence, video, number)):
                squares.append(square)
                scores.append(score)
        progress("splats", done, len(numbers))
    if not squares:
        raise InputError("--splats: no frame of the originals has colours and splats; compare with coloured originals")
    row = {"splats_psnr": psnr(PEAK**2 * float(np.mean(squares))), "splats_ssim": float(np.mean(scores))}
    return row | {"splats_views": len(squares)}


def held_out(sequence: MeshSequence, video: Video, number: int) -> tuple[SplatView, ...]:
    """Return pictures of a frame: a rig's, or renders from cameras that were not used to fit."""
    if (colors := captured(sequence).colors) is not None:
        pictures = [picture for picture in colors[number] if picture is not None]
        return taken(pictures, video.moving(number), sequence[number], SIZE)
    mesh, up = sequence[number], captured(sequence).up
    return rendered(mesh, ring(mesh, VIEWS, SIZE, GOLDEN * number + ASIDE, up)) if mesh.is_colored else ()


def errors(bound: Bound, view: SplatView) -> tuple[float, float]:
    """Return the mean squared error, of values 0 to 1, and SSIM of a picture of splats; unknown pixels are left out."""
    drawn = np.clip(draw(bound, view.camera), 0, 1)
    known = np.isfinite(view.pixels)
    target = np.where(known, view.pixels, drawn).astype(np.float64)
    inside = slice(BORDER, -BORDER)
    square = float(np.square(drawn - target)[known].mean()) if known.any() else 0.0
    return square, float(ssim_map(drawn.astype(np.float64), target)[inside, inside].mean())
