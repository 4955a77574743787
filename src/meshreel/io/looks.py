"""Looks of faces, colours and pictures of materials, as colours of vertices and one texture.

In: polygons and the look of each. Out: polygons with colours, and places in one picture, which may be made of several.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from jaxtyping import Bool, Float32, Int64, UInt8

from ..types import GREY, Texture
from .pictures import MOST_PIXELS
from .polygons import Polygons


@dataclass(frozen=True, slots=True)
class Look:
    """A colour (sRGB), or a picture; or neither."""

    color: tuple[int, int, int] | None = None
    picture: Texture | None = None


def with_looks(
    polygons: Polygons,
    looks: Sequence[Look],
    which: Int64[np.ndarray, " P"],
    colors: UInt8[np.ndarray, "V 3"] | None = None,
    colored: Bool[np.ndarray, " V"] | None = None,
) -> Polygons:
    """Return polygons with their looks, whose numbers are `which`, -1 for none.

    A vertex without a colour of its own (`colors`, `colored`) has the mean of its faces' colours. Several pictures
    become one.
    """
    stated = [look.color for look in looks if look.color is not None]
    face_colors = np.array([look.color or (0, 0, 0) for look in looks] + [(0, 0, 0)], np.float64)[which]
    has_color = np.array([look.color is not None for look in looks] + [False], bool)[which]
    named = set[str]()
    is_colored = np.zeros(len(polygons.vertices), bool) if colored is None else colored
    if len({*stated}) == 1 and has_color.all() and len({*stated[0]}) == 1 and not is_colored.any():
        named.add("the one grey of all faces")  # how programs draw surfaces that have no colours
        colors = None
    else:
        colors = with_face_colors(polygons, face_colors, has_color, colors, is_colored)
    pictures = list(dict.fromkeys(look.picture for look in looks if look.picture is not None))
    if polygons.uv is None or not pictures:
        lost = {"texture coordinates"} if polygons.uv is not None and np.isfinite(polygons.uv).any() else set[str]()
        return replace(polygons, colors=colors, uv=None).naming(named | lost)
    numbers = np.array([-1 if look.picture is None else pictures.index(look.picture) for look in looks] + [-1])[which]
    numbers = np.repeat(numbers, polygons.sizes)
    uv = np.where((numbers >= 0)[:, None], polygons.uv, np.float32(np.nan))
    if len(pictures) == 1:
        return replace(polygons, colors=colors, uv=uv, texture=pictures[0]).naming(named)
    uv, beyond = _in_cells(uv, numbers, polygons.sizes, len(pictures))
    named |= {"pictures that repeat within a face, of several"} if beyond else set()
    return replace(polygons, colors=colors, uv=uv, texture=Texture(partial(_sheet, tuple(pictures)))).naming(named)


def with_face_colors(
    polygons: Polygons,
    face_colors: np.ndarray,
    has_color: Bool[np.ndarray, " P"],
    colors: UInt8[np.ndarray, "V 3"] | None,
    colored: Bool[np.ndarray, " V"],
) -> UInt8[np.ndarray, "V 3"] | None:
    """Return colours of vertices: their own, or the mean of their faces' colours, or grey; None if there are none."""
    if not colored.any() and not has_color.any():
        return None
    corners, chosen = polygons.corners, np.repeat(has_color, polygons.sizes)
    corners = np.where((corners >= 0) & (corners < len(polygons.vertices)), corners, 0)  # checked later
    values = np.repeat(face_colors, polygons.sizes, axis=0)[chosen]
    counts = np.bincount(corners[chosen], minlength=len(polygons.vertices))
    sums = [np.bincount(corners[chosen], values[:, k], len(polygons.vertices)) for k in range(3)]
    means = np.rint(np.stack(sums, axis=1) / np.maximum(counts, 1)[:, None])
    found = np.where((counts > 0)[:, None], means, GREY).astype(np.uint8)
    return found if colors is None else np.where(colored[:, None], colors, found)


def _grid(count: int) -> tuple[int, int]:
    """Return rows and columns of a sheet of pictures."""
    columns = int(np.ceil(np.sqrt(count)))
    return -(-count // columns), columns


def _in_cells(
    uv: Float32[np.ndarray, "C 2"], numbers: np.ndarray, sizes: Int64[np.ndarray, " P"], count: int
) -> tuple[Float32[np.ndarray, "C 2"], bool]:
    """Return places in the sheet of pictures, and True if some were beyond the borders of their picture."""
    rows, columns = _grid(count)
    begins = np.cumsum(sizes) - sizes
    low = np.floor(np.fmin.reduceat(uv, begins, axis=0) + 1e-4) if len(sizes) else np.zeros((0, 2), np.float32)
    local = uv - np.repeat(low, sizes, axis=0)
    beyond = bool((local > 1 + 1e-4).any())
    local = np.clip(local, 0, 1)
    cell = np.stack([numbers % columns, rows - 1 - numbers // columns], axis=1)
    return ((local + cell) / [columns, rows]).astype(np.float32), beyond


def _sheet(pictures: tuple[Texture, ...]) -> UInt8[np.ndarray, "H W 3"]:
    """Return pictures side by side, each as large as the largest."""
    from PIL import Image

    rows, columns = _grid(len(pictures))
    height, width = np.max([picture.shape for picture in pictures], axis=0)
    share = min(1.0, float(np.sqrt(MOST_PIXELS / (rows * columns * height * width))))
    height, width = max(1, int(height * share)), max(1, int(width * share))
    sheet = np.zeros((rows * height, columns * width, 3), np.uint8)
    for number, picture in enumerate(pictures):
        row, column = divmod(number, columns)
        image = Image.fromarray(np.ascontiguousarray(picture.pixels)).resize((width, height), Image.Resampling.BILINEAR)
        sheet[row * height : (row + 1) * height, column * width : (column + 1) * width] = np.asarray(image)
    return sheet
