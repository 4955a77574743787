"""The layout of a texture: the places of a mesh's face corners in it, also after midpoint subdivisions.

Textures of several meshes are joined side by side, so that the meshes can become one mesh.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from itertools import accumulate
from typing import TypeAlias

import numpy as np

from ..shapes import Float32, Int32, UInt8
from ..types import GREY, Texture

Places: TypeAlias = Float32[np.ndarray, "_ 3 2"]  # of the corners of some faces, as `Mesh.uv`

MOST_SIDE = 2048  # texels, largest side of a texture: the pictures kept by its decoder take 60 MB


@dataclass(frozen=True, slots=True)
class Layout:
    """A texture's size, and the places of the corners of a mesh's faces in it, from its upper left corner."""

    width: int  # texels
    height: int
    places: Int32[np.ndarray, "F 3 2"]  # right and down

    def uv(self, levels: int) -> Float32[np.ndarray, "G 3 2"]:
        """Return the places of the corners of the faces that `levels` subdivisions make, as `Mesh.uv` has them.

        A face whose corners are all in one place has none: it has the colours of its vertices.
        """
        places = self.places.astype(np.float64)
        places[(self.places == self.places[:, :1]).all(axis=(1, 2))] = np.nan
        uv = finer_places(places, levels) / [self.width, self.height]
        uv[..., 1] = 1.0 - uv[..., 1]
        return uv.astype(np.float32)


def finer_places(places: np.ndarray, levels: int) -> np.ndarray:
    """Cut triangles of places in four, `levels` times, in the order of `topology.subdivide_midpoint`."""
    for _ in range(levels):
        a, b, c = places[:, 0], places[:, 1], places[:, 2]
        ab, bc, ca = (a + b) / 2, (b + c) / 2, (c + a) / 2
        cut = [np.stack(corners, axis=1) for corners in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))]
        places = np.stack(cut, axis=1).reshape(-1, 3, 2)
    return places


def side_by_side(textures: Sequence[Texture], places: Sequence[tuple[int, Places]]) -> tuple[Texture, list[Places]]:
    """Join textures from left to right, and convert places, each with its texture's number, to the joined one.

    A single texture is returned unchanged, with its places.
    """
    if len(textures) == 1:
        return textures[0], [uv for _, uv in places]
    shapes = tuple(texture.shape for texture in textures)
    height, width = max(rows for rows, _ in shapes), sum(columns for _, columns in shapes)
    lefts, moved = [0, *accumulate(columns for _, columns in shapes)], list[Places]()
    for number, uv in places:
        rows, columns = shapes[number]
        scale, origin = np.array([columns / width, rows / height]), np.array([lefts[number] / width, 1 - rows / height])
        moved.append((origin + scale * uv).astype(np.float32))
    return Texture(partial(_picture, tuple(textures), (height, width)), (height, width)), moved


def _picture(textures: Sequence[Texture], size: tuple[int, int]) -> UInt8[np.ndarray, "H W 3"]:
    whole, left = np.full((*size, 3), GREY, np.uint8), 0
    for source in (texture.pixels for texture in textures):
        whole[: len(source), left : left + source.shape[1]] = source
        left += source.shape[1]
    return whole
