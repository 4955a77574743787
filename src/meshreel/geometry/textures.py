"""Textures of several meshes side by side in one, so that the meshes can be one mesh.

In: textures, and places in them. Out: one texture, which is decoded when it is asked for, and places in that.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from itertools import accumulate
from typing import TypeAlias

import numpy as np

from ..shapes import Float32, UInt8
from ..types import GREY, Texture

Places: TypeAlias = Float32[np.ndarray, "_ 3 2"]  # of the corners of some faces, as `Mesh.uv`


def side_by_side(textures: Sequence[Texture], places: Sequence[tuple[int, Places]]) -> tuple[Texture, list[Places]]:
    """Return one texture with all of these, from left to right at its top; and places in some of them, in it.

    Where there is one texture, it is returned itself, and so are the places.
    """
    if len(textures) == 1:
        return textures[0], [uv for _, uv in places]
    shapes = tuple(texture.shape for texture in textures)
    height, width = max(rows for rows, _ in shapes), sum(columns for _, columns in shapes)
    lefts, found = [0, *accumulate(columns for _, columns in shapes)], list[Places]()
    for number, uv in places:
        rows, columns = shapes[number]
        scale, origin = np.array([columns / width, rows / height]), np.array([lefts[number] / width, 1 - rows / height])
        found.append((origin + scale * uv).astype(np.float32))
    return Texture(partial(_picture, tuple(textures), (height, width)), (height, width)), found


def _picture(textures: Sequence[Texture], size: tuple[int, int]) -> UInt8[np.ndarray, "H W 3"]:
    whole, left = np.full((*size, 3), GREY, np.uint8), 0
    for pixels in (texture.pixels for texture in textures):
        whole[: len(pixels), left : left + pixels.shape[1]] = pixels
        left += pixels.shape[1]
    return whole
