"""Textures of several meshes side by side in one, so that the meshes can be one mesh.

In: textures, and places in them. Out: one texture, which is decoded when it is asked for, and places in that.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np

from ..shapes import Float32, UInt8
from ..types import GREY, Texture


def side_by_side(textures: Sequence[Texture]) -> Texture:
    """Return one texture with all of these, from left to right at its top; itself where there is one."""
    if len(textures) == 1:
        return textures[0]
    return Texture(partial(_picture, tuple(textures)), _size(textures))


def moved(
    uv: Float32[np.ndarray, "F 3 2"], texture: Texture, textures: Sequence[Texture]
) -> Float32[np.ndarray, "F 3 2"]:
    """Return places in one of several textures as places in all of them side by side."""
    if len(textures) == 1:
        return uv
    (height, width), (rows, columns), at = _size(textures), texture.shape, textures.index(texture)
    left = sum(one.shape[1] for one in textures[:at])
    scale, origin = np.array([columns / width, rows / height]), np.array([left / width, 1 - rows / height])
    return (origin + scale * uv).astype(np.float32)


def _size(textures: Sequence[Texture]) -> tuple[int, int]:
    return max(one.shape[0] for one in textures), sum(one.shape[1] for one in textures)


def _picture(textures: Sequence[Texture]) -> UInt8[np.ndarray, "H W 3"]:
    whole, left = np.full((*_size(textures), 3), GREY, np.uint8), 0
    for texture in textures:
        rows, columns = texture.shape
        whole[:rows, left : left + columns] = texture.pixels
        left += columns
    return whole
