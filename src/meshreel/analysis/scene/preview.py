"""Pictures of a segmentation for inspection: moving faces in the colors of their bodies, and sheets of such pictures.

In: the moving faces of some frames, and the views. Out: colors, and pictures as arrays.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Integer, UInt8

from ...geometry.cameras import Camera, Rays, Seen
from ...types import Mesh
from .pictures import normal_picture

_RESTS, _NO_BODY = (205, 205, 205), (90, 90, 90)
_BODIES = (
    (214, 39, 40),
    (31, 119, 180),
    (44, 160, 44),
    (255, 127, 14),
    (148, 103, 189),
    (23, 190, 207),
)
_LIGHT = np.array([0.36, 0.80, 0.48])
_AMBIENT = 0.45  # share of the color that unlit surface keeps: chosen by eye
_GAP, _LEFT, _TOP, _TEXT = 4, 64, 24, 14  # pixels: between pictures, left of them, above and below them, of text
_LEGEND = "light gray: still; colors: moving, one color per body (six in turn); dark gray: moving, part of no body"


def label_colors(moving: Bool[np.ndarray, " F"], bodies: Integer[np.ndarray, " F"]) -> UInt8[np.ndarray, "F 3"]:
    """Return a color for each face: light gray if still, one of six by the body's number, dark gray if of no body."""
    by_body = np.array(_BODIES, np.uint8)[(bodies.astype(np.int64) - 1) % len(_BODIES)]
    colors = np.where((bodies > 0)[:, None], by_body, np.array(_NO_BODY, np.uint8))
    return np.where(moving[:, None], colors, np.array(_RESTS, np.uint8))


def colored_picture(seen: Seen, view: Camera, colors: UInt8[np.ndarray, "F 3"]) -> UInt8[np.ndarray, "H W 3"]:
    """Render a view in the faces' colors under one light; white where nothing is seen."""
    normals = normal_picture(seen, view).astype(np.float64) * (2 / 255) - 1
    light = _AMBIENT + (1 - _AMBIENT) * np.abs(normals @ _LIGHT)
    hit = seen.faces >= 0
    picture = np.full((*hit.shape, 3), 255, np.uint8)
    picture[hit] = np.rint(colors[seen.faces[hit]] * np.minimum(light[hit], 1)[:, None])
    return picture


def look_at_labels(
    mesh: Mesh, moving: Bool[np.ndarray, " F"], bodies: Integer[np.ndarray, " F"], views: Sequence[Camera]
) -> tuple[list[UInt8[np.ndarray, "H W 3"]], list[int]]:
    """Return each view's picture, and the number of moving faces that it sees."""
    rays, colors = Rays(mesh), label_colors(moving, bodies)
    looks = [rays.look(view) for view in views]
    pictures = [colored_picture(seen, view, colors) for seen, view in zip(looks, views, strict=True)]
    return pictures, [int(moving[np.unique(seen.faces[seen.faces >= 0])].sum()) for seen in looks]


@dataclass(frozen=True, slots=True)
class FrameViews:
    """Pictures of one frame, one for each view."""

    frame: int
    pictures: Sequence[UInt8[np.ndarray, "H W 3"]]


def sheet(rows: Sequence[FrameViews], views: Sequence[int]) -> UInt8[np.ndarray, "Y X 3"]:
    """Draw pictures of one size on a sheet: a row per frame, a column per view, with their numbers and a legend."""
    from PIL import Image, ImageDraw, ImageFont

    height, width, _ = rows[0].pictures[0].shape
    size = (_LEFT + len(views) * (width + _GAP), _TOP + len(rows) * (height + _GAP) + _TOP)
    image = Image.new("RGB", size, "white")
    draw, font = ImageDraw.Draw(image), ImageFont.load_default(_TEXT)
    for k, view in enumerate(views):
        draw.text((_LEFT + k * (width + _GAP), _GAP), f"view {view}", "black", font)
    for i, row in enumerate(rows):
        top = _TOP + i * (height + _GAP)
        draw.text((_GAP, top), f"frame\n{row.frame}", "black", font)
        for k, picture in enumerate(row.pictures):
            image.paste(Image.fromarray(picture), (_LEFT + k * (width + _GAP), top))
    draw.text((_LEFT, size[1] - _TOP + _GAP), _LEGEND, "black", font)
    return np.asarray(image)
