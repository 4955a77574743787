"""Bake pictures: sample a painted surface at the texels of an atlas, and fill the gaps between its charts.

In: an atlas, its mesh in a frame, and a painted surface. Out: a picture without empty texels, so that a video of such
pictures has no edges that the surface lacks.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float64, Int32, Int64, UInt8

from ...geometry.atlas import Layout
from ...geometry.color_views import Paint
from ...geometry.topology import blend, face_normals
from ...types import GREY, Mesh


@dataclass(frozen=True, slots=True)
class Texels:
    """The texels of an atlas whose middles are on the mesh, with their places on it."""

    height: int
    width: int
    pixels: Int64[np.ndarray, " N"]  # number of each in the picture, row after row
    faces: Int32[np.ndarray, " N"]  # of the mesh after its subdivisions
    barycentric: Float64[np.ndarray, "N 3"]  # weights of the face's three corners

    def places(self, mesh: Mesh) -> Float64[np.ndarray, "N 3"]:
        """Return the positions of the texels on a mesh with these faces."""
        return blend(mesh.vertices, mesh.faces[self.faces], self.barycentric)


def texels_of(layout: Layout, levels: int) -> Texels:
    """Find the texels of an atlas on a base mesh that is subdivided `levels` times."""
    pixels, faces, weights = list[np.ndarray](), list[np.ndarray](), list[np.ndarray]()
    corners = layout.places.astype(np.float64)
    low = np.clip(np.ceil(corners.min(axis=1) - 0.5), 0, None).astype(np.int64)
    high = np.floor(corners.max(axis=1) - 0.5).astype(np.int64)
    for face, ((a, b, c), (x0, y0), (x1, y1)) in enumerate(zip(corners, low, high, strict=True)):
        area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
        if area == 0 or x1 < x0 or y1 < y0:
            continue
        x, y = np.meshgrid(np.arange(x0, x1 + 1) + 0.5, np.arange(y0, y1 + 1) + 0.5)
        v = ((x - a[0]) * (c[1] - a[1]) - (y - a[1]) * (c[0] - a[0])) / area
        w = ((b[0] - a[0]) * (y - a[1]) - (b[1] - a[1]) * (x - a[0])) / area
        inside = (v >= 0) & (w >= 0) & (v + w <= 1)
        pixels.append((y[inside].astype(np.int64)) * layout.width + x[inside].astype(np.int64))
        faces.append(np.full(int(inside.sum()), face))
        weights.append(np.stack([1 - v[inside] - w[inside], v[inside], w[inside]], axis=1))
    numbers, first = np.unique(np.concatenate([np.zeros(0, np.int64), *pixels]), return_index=True)
    base_faces = np.concatenate([np.zeros(0, np.int64), *faces])[first]
    finer, barycentric = _finer(base_faces, np.concatenate([np.zeros((0, 3)), *weights])[first], levels)
    return Texels(layout.height, layout.width, numbers, finer.astype(np.int32), barycentric)


def _finer(
    faces: Int64[np.ndarray, " N"], weights: Float64[np.ndarray, "N 3"], levels: int
) -> tuple[Int64[np.ndarray, " N"], Float64[np.ndarray, "N 3"]]:
    """Convert places on faces to places on the faces after `levels` midpoint subdivisions."""
    for _ in range(levels):
        largest = weights.argmax(axis=1)
        at_corner = weights[np.arange(len(weights)), largest] >= 0.5
        finer = 2 * weights
        rows = np.flatnonzero(at_corner)
        finer[rows, largest[rows]] -= 1  # (a, ab, ca), (ab, b, bc), (ca, bc, c)
        inner = ~at_corner
        a, b, c = weights[inner].T
        finer[inner] = np.stack([1 - 2 * c, 1 - 2 * a, 1 - 2 * b], axis=1)  # (ab, bc, ca)
        faces, weights = 4 * faces + np.where(at_corner, largest, 3), finer
    return faces, weights


def bake(paint: Paint, mesh: Mesh, texels: Texels) -> tuple[UInt8[np.ndarray, "N 3"], Bool[np.ndarray, " N"]]:
    """Return the colours of the texels of a mesh, and a mask of the known ones."""
    colors, known = paint.at(texels.places(mesh), face_normals(mesh)[0][texels.faces])
    return np.clip(np.rint(colors), 0, 255).astype(np.uint8), known


def picture(
    texels: Texels, colors: UInt8[np.ndarray, "N 3"], seen: Bool[np.ndarray, " N"]
) -> UInt8[np.ndarray, "H W 3"]:
    """Return a picture with these colours of its texels, interpolated elsewhere."""
    values = np.full((texels.height * texels.width, 3), float(GREY))
    values[texels.pixels] = colors
    known = np.zeros(len(values), bool)
    known[texels.pixels] = seen
    shape = (texels.height, texels.width)
    filled = _filled(values.reshape(*shape, 3), known.reshape(shape))
    return np.clip(np.rint(filled), 0, 255).astype(np.uint8)


def _filled(values: Float64[np.ndarray, "H W 3"], known: Bool[np.ndarray, "H W"]) -> Float64[np.ndarray, "H W 3"]:
    """Fill unknown pixels with means of known ones nearby, from recursively halved pictures."""
    if known.all() or not known.any() or min(known.shape) < 2:
        mean = values[known].mean(axis=0) if known.any() else np.full(3, float(GREY))
        return np.where(known[..., None], values, mean)
    height, width = (size + size % 2 for size in known.shape)
    pad = ((0, height - known.shape[0]), (0, width - known.shape[1]))
    weights = np.pad(known, pad).astype(np.float64)
    sums = _halved(np.pad(np.where(known[..., None], values, 0.0), (*pad, (0, 0))))
    counts = _halved(weights[..., None])
    coarse = _filled(sums / np.maximum(counts, 1), counts[..., 0] > 0)
    return np.where(known[..., None], values, _doubled(coarse)[: known.shape[0], : known.shape[1]])


def _halved(values: Float64[np.ndarray, "H W C"]) -> Float64[np.ndarray, "h w C"]:
    """Return the sums of 2 x 2 pixels."""
    return values[::2, ::2] + values[1::2, ::2] + values[::2, 1::2] + values[1::2, 1::2]


def _doubled(values: Float64[np.ndarray, "h w 3"]) -> Float64[np.ndarray, "H W 3"]:
    """Return a picture of twice the size, blended between pixels."""
    for axis in (0, 1):
        before = np.concatenate([values.take([0], axis), values.take(range(values.shape[axis] - 1), axis)], axis)
        after = np.concatenate([values.take(range(1, values.shape[axis]), axis), values.take([-1], axis)], axis)
        pairs = np.stack([0.75 * values + 0.25 * before, 0.75 * values + 0.25 * after], axis=axis + 1)
        values = pairs.reshape(*values.shape[:axis], 2 * values.shape[axis], *values.shape[axis + 1 :])
    return values
