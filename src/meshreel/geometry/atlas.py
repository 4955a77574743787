"""The layout of a texture: where the corners of a mesh's faces are in it, also after midpoint subdivisions."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..shapes import Float32, Int32

MOST_SIDE = 2048  # texels, of a texture: pictures that a decoder keeps take 60 MB then


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
        found = finer_places(places, levels) / [self.width, self.height]
        found[..., 1] = 1.0 - found[..., 1]
        return found.astype(np.float32)


def finer_places(places: np.ndarray, levels: int) -> np.ndarray:
    """Cut triangles of places in four, `levels` times, in the order of `topology.subdivide_midpoint`."""
    for _ in range(levels):
        a, b, c = places[:, 0], places[:, 1], places[:, 2]
        ab, bc, ca = (a + b) / 2, (b + c) / 2, (c + a) / 2
        cut = [np.stack(corners, axis=1) for corners in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))]
        places = np.stack(cut, axis=1).reshape(-1, 3, 2)
    return places
