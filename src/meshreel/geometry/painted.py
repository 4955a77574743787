"""Colours of places on and near a surface: of its texture, or blended from its vertices.

In: a mesh with colours, and places. Out: red, green and blue, 0 to 255, at the closest point of the mesh to each.
"""

from __future__ import annotations

from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Bool, Float32, Float64, Int32, UInt8

from ..types import GREY, Mesh
from .closest_points import Surface
from .topology import blend


@runtime_checkable
class Paint(Protocol):
    """Source of colours of points on a surface."""

    def at(
        self, points: Float64[np.ndarray, "N 3"], normals: Float64[np.ndarray, "N 3"]
    ) -> tuple[Float64[np.ndarray, "N 3"], Bool[np.ndarray, " N"]]:
        """Return the colours of points with these normals, 0 to 255, and a mask of the known ones."""

    def pixels_on(self, mesh: Mesh) -> float:
        """Return the number of pixels of its pictures that show a mesh; infinite without pictures."""


class Painted:
    """A mesh with faces and colours, prepared for repeated queries."""

    def __init__(self, mesh: Mesh, far: float = np.inf) -> None:
        """Take the mesh; colours of points farther from it than `far`, in the unit of its vertices, are unknown."""
        self._mesh, self._surface, self._far = mesh, Surface(mesh), far
        self._pixels = None if mesh.uv is None or mesh.texture is None else mesh.texture.pixels

    def at(
        self, points: Float64[np.ndarray, "N 3"], normals: Float64[np.ndarray, "N 3"]
    ) -> tuple[Float64[np.ndarray, "N 3"], Bool[np.ndarray, " N"]]:
        """Return the colours at the closest points of the mesh, whatever the normals, and a mask of near points."""
        del normals
        hits = self._surface.closest(points)
        if self._far == np.inf:
            near = np.ones(len(points), bool)
        else:
            near = np.linalg.norm(hits.points - points, axis=1) <= self._far
        return self.on(hits.faces, hits.barycentric), near

    def pixels_on(self, mesh: Mesh) -> float:
        """Return the number of texels of the painted mesh, whatever `mesh`; infinite without a texture."""
        del mesh
        if self._pixels is None or self._mesh.uv is None:
            return np.inf
        a, b, c = np.moveaxis(self._mesh.uv.astype(np.float64), 1, 0)
        areas = np.abs((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]) / 2
        return float(np.nansum(areas)) * self._pixels.shape[0] * self._pixels.shape[1]

    def on(self, faces: Int32[np.ndarray, " N"], barycentric: Float64[np.ndarray, "N 3"]) -> Float64[np.ndarray, "N 3"]:
        """Return the colours at places inside faces."""
        mesh = self._mesh
        if mesh.colors is None:
            colors = np.full((len(faces), 3), float(GREY))
        else:
            colors = blend(mesh.colors.astype(np.float64), mesh.faces[faces], barycentric)
        if self._pixels is not None and mesh.uv is not None:
            places = np.einsum("nkc,nk->nc", mesh.uv[faces].astype(np.float64), barycentric)
            textured = np.isfinite(places).all(axis=1)
            colors[textured] = bilinear(self._pixels, places[textured])
        return colors


def bilinear(
    pixels: UInt8[np.ndarray, "H W 3"], places: Float64[np.ndarray, "N 2"] | Float32[np.ndarray, "N 2"]
) -> Float64[np.ndarray, "N 3"]:
    """Return the colours at places of a texture, as in `Mesh.uv`; outside of 0 to 1 the texture is repeated."""
    height, width = pixels.shape[:2]
    x, y = np.asarray(places, np.float64).T
    x, y = (x - np.floor(x)) * width - 0.5, (1.0 - (y - np.floor(y))) * height - 0.5
    left, above = np.floor(x), np.floor(y)
    fx, fy = (x - left)[:, None], (y - above)[:, None]
    x0, y0 = left.astype(np.int64) % width, above.astype(np.int64) % height
    x1, y1 = (x0 + 1) % width, (y0 + 1) % height
    flat = pixels.reshape(-1, 3)
    upper = flat[y0 * width + x0] * (1 - fx) + flat[y0 * width + x1] * fx
    lower = flat[y1 * width + x0] * (1 - fx) + flat[y1 * width + x1] * fx
    return upper * (1 - fy) + lower * fy
