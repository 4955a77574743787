"""Bake colours: onto textures, vertices, and backgrounds.

In: a mesh, and a painted surface or several. Out: places of its faces in a texture (by xatlas, extra `color`, or by
projection to cameras), and a picture without empty texels, so that a video of such pictures has no edges that the
surface lacks; or colours of vertices by least squares; or medians over frames, so that people who pass by a background
leave no ghosts.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float64, Int32, Int64, UInt8

from ...errors import InputError, needed
from ...geometry.atlas import Layout
from ...geometry.color_views import Paint, spread_colors
from ...geometry.drawing import box_pixels
from ...geometry.splats import located
from ...geometry.topology import blend, face_normals
from ...geometry.work import passed
from ...types import GREY, Mesh
from .projection import BLOCK, steady_normals

Points = Float64[np.ndarray, "N 3"]
Weights = Float64[np.ndarray, "N 3"]  # of the corners of faces
Numbers = Int64[np.ndarray, " N"]
Colors = UInt8[np.ndarray, "N 3"]
Known = Bool[np.ndarray, " N"]  # whose colour is known
# Samples of each face: its middle, and a point towards each corner. Samples at vertices alone would alias.
PLACES = np.array([[1, 1, 1], [4, 1, 1], [1, 4, 1], [1, 1, 4]]) / np.array([[3], [6], [6], [6]])
REFINEMENTS = 4  # rounds of least squares: the rest of the error falls below a grey level (guess)
TOGETHER = 1 << 16  # places whose medians are taken at a time: 16 frames of them take 10 MB
TEXELS_TOGETHER = 1 << 16  # bounds memory (guess)
GUTTERS = 128  # in the width of a texture; 8 texels of 1024 keep charts apart in three mip levels
PACKINGS = 8  # rounds of packing, with texels per metre corrected after each; as many more halve them (guess)
MARGIN = 0.995  # of the size that would just fit: packing is not quite proportional (guess)
BESIDE = 1.0  # texels from a chart within which a texel is mixed with those of the chart: they are blended


@dataclass(frozen=True, slots=True)
class Texels:
    """The texels of an atlas that show the mesh, with their places on it: at borders of charts, the nearest ones."""

    height: int
    width: int
    pixels: Numbers  # number of each in the picture, row after row
    faces: Int32[np.ndarray, " N"]  # of the mesh after its subdivisions
    barycentric: Weights

    def places(self, mesh: Mesh) -> Points:
        """Return the positions of the texels on a mesh with these faces."""
        return blend(mesh.vertices, mesh.faces[self.faces], self.barycentric)


def texels_of(layout: Layout, levels: int) -> Texels:
    """Find the texels of an atlas on a base mesh that is subdivided `levels` times.

    Those within `BESIDE` of a chart are mixed with its texels where it is shown, and so are of it, too.
    """
    corners = layout.places.astype(np.float64)
    size = np.array([layout.width, layout.height])
    low = np.clip(np.ceil(corners.min(axis=1) - 0.5 - BESIDE), 0, None).astype(np.int64)
    high = np.minimum(np.floor(corners.max(axis=1) - 0.5 + BESIDE), size - 1).astype(np.int64)
    across, down = np.maximum(high - low + 1, 0).T
    edges = np.roll(corners, 1, axis=1) - np.roll(corners, -1, axis=1)  # opposite to each corner
    (v0, v1), (w0, w1) = (np.moveaxis(corners[:, k] - corners[:, 0], 1, 0) for k in (1, 2))
    areas = v0 * w1 - v1 * w0
    counts = np.where(areas == 0, 0, across * down)
    found = list[tuple[np.ndarray, ...]]()
    for some in np.split(np.arange(len(corners)), np.flatnonzero(np.diff(np.cumsum(counts) // TEXELS_TOGETHER)) + 1):
        face, column, row = box_pixels(low, high + 1, some[counts[some] > 0])
        x, y = column + 0.5 - corners[face, 0, 0], row + 0.5 - corners[face, 0, 1]
        v, w = (x * w1[face] - y * w0[face]) / areas[face], (v0[face] * y - v1[face] * x) / areas[face]
        shares = np.stack([1 - v - w, v, w], axis=1)
        heights = np.abs(areas[face])[:, None] / np.hypot(edges[face, :, 0], edges[face, :, 1])  # over their edges
        outside = np.maximum(-(shares * heights).min(axis=1), 0)
        near = outside <= BESIDE
        texel = row[near] * layout.width + column[near]
        found.append((texel, face[near], np.maximum(shares[near], 0), outside[near]))
    pixels, faces, weights, away = (np.concatenate(each) for each in zip(*found, strict=True))
    order = np.argsort(away, kind="stable")  # the nearest face has a texel
    numbers, first = np.unique(pixels[order], return_index=True)
    chosen = order[first]
    shares = weights[chosen] / weights[chosen].sum(axis=1, keepdims=True)
    finer, barycentric, _ = located(faces[chosen], shares, levels)
    return Texels(layout.height, layout.width, numbers, finer.astype(np.int32), barycentric)


def bake(paint: Paint, mesh: Mesh, texels: Texels) -> tuple[Colors, Known]:
    """Return the colours of the texels of a mesh, and a mask of the known ones."""
    colors, known = paint.at(texels.places(mesh), face_normals(mesh)[0][texels.faces])
    return np.clip(np.rint(colors), 0, 255).astype(np.uint8), known


def picture(texels: Texels, mesh: Mesh, colors: Colors, seen: Known) -> UInt8[np.ndarray, "H W 3"]:
    """Return a picture with these colours of its texels on a mesh, of which those that are not seen have others.

    These have the colours of the surface around them, whatever lies between in the picture; what is beside the surface
    has those of texels nearby.
    """
    shape, pixels = (texels.height, texels.width), texels.pixels
    values, known = (
        np.full((texels.height * texels.width, 3), float(GREY)),
        np.zeros(texels.height * texels.width, bool),
    )
    values[pixels], known[pixels] = colors, seen
    if seen.any() and not seen.all():
        smooth = _around(texels, mesh, colors, seen)
        values[pixels] -= smooth
        values[pixels] = smooth + _filled(values.reshape(*shape, 3), known.reshape(shape)).reshape(-1, 3)[pixels]
        known[pixels] = True
    filled = _filled(values.reshape(*shape, 3), known.reshape(shape))
    return np.clip(np.rint(filled), 0, 255).astype(np.uint8)


def _around(texels: Texels, mesh: Mesh, colors: Colors, seen: Known) -> Points:
    """Return the colours of all texels as vertices would have them: means of texels seen around, or of neighbours."""
    corners, count = mesh.faces[texels.faces], len(mesh.vertices)
    at, shares = corners[seen].reshape(-1), texels.barycentric[seen]
    weights = np.bincount(at, shares.reshape(-1), count)
    sums = [np.bincount(at, (shares * channel[:, None]).reshape(-1), count) for channel in colors[seen].T]
    means = np.stack(sums, axis=1) / np.where(weights > 0, weights, 1)[:, None]
    return blend(spread_colors(mesh, means, weights > 0).astype(np.float64), corners, texels.barycentric)


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


def vertex_colors(paint: Paint, mesh: Mesh) -> UInt8[np.ndarray, "V 3"]:
    """Return the colours of a mesh's vertices; vertices of unknown colour get the means of their neighbours."""
    return fitted_colors(mesh, *paint.at(*face_places(mesh)))


def face_places(mesh: Mesh) -> tuple[Points, Points]:
    """Return the places on the faces of a mesh whose colours tell those of its vertices, with their normals."""
    points = np.einsum("pk,fkc->fpc", PLACES, mesh.vertices[mesh.faces]).reshape(-1, 3)
    return points, steady_normals(mesh).repeat(len(PLACES), axis=0)


def fitted_colors(mesh: Mesh, colors: Points, known: Known) -> UInt8[np.ndarray, "V 3"]:
    """Return the colours of vertices which, blended, are nearest to the known ones of `face_places`."""
    target, areas = colors.reshape(len(mesh.faces), len(PLACES), 3), face_normals(mesh)[1]
    weights = (areas[:, None] * known.reshape(-1, len(PLACES)))[..., None] * PLACES  # places on corners
    total = _gathered(mesh, weights.sum(axis=1)[..., None])[:, 0]
    known_vertices = total > 0
    fitted = np.full((len(mesh.vertices), 3), float(GREY))
    for _ in range(REFINEMENTS):
        blended = np.einsum("pk,fkc->fpc", PLACES, fitted[mesh.faces])
        change = _gathered(mesh, np.einsum("fpk,fpc->fkc", weights, target - blended))
        fitted[known_vertices] += change[known_vertices] / total[known_vertices, None]
    return spread_colors(mesh, fitted, known_vertices)


def _gathered(mesh: Mesh, values: Float64[np.ndarray, "F 3 C"]) -> Float64[np.ndarray, "V C"]:
    """Return the sums of values of faces' corners over the vertices."""
    places = mesh.faces.reshape(-1)
    flat = values.reshape(len(places), -1)
    return np.stack([np.bincount(places, column, len(mesh.vertices)) for column in flat.T], axis=1)


def median_colors(points: Points, normals: Points, paints: Iterable[Paint]) -> tuple[Colors, Known]:
    """Return the medians over frames of the points' colours, and a mask of known colours; others are grey."""
    stack, masks = list[np.ndarray](), list[np.ndarray]()
    for paint in paints:
        passed("room")
        colors, mask = paint.at(points, normals)
        stack.append(np.clip(np.rint(colors), 0, 255).astype(np.uint8))
        masks.append(mask)
    medians_or_grey = np.full(points.shape, GREY, np.uint8)
    if not stack:
        return medians_or_grey, np.zeros(len(points), bool)
    mask = np.any(masks, axis=0)
    for start in range(0, len(points), TOGETHER):
        block = slice(start, start + TOGETHER)
        known = np.stack([array[block] for array in masks])
        values = np.stack([array[block] for array in stack]).astype(np.int16)
        values[~known] = 256  # last in order
        ordered, count = np.sort(values, axis=0), known.sum(axis=0)
        middles = np.maximum(count - 1, 0) // 2, np.minimum(count // 2, len(stack) - 1)
        low, high = (np.take_along_axis(ordered, at[None, :, None], 0)[0] for at in middles)
        medians_or_grey[block][count > 0] = np.rint((low + high)[count > 0] / 2).astype(np.uint8)
    return medians_or_grey, mask


def unwrap(base: Mesh, sizes: Sequence[int]) -> Layout:
    """Return places of all corners of a base mesh in a texture, in the first of these widths into which they fit.

    It is at most as high as wide. Raises InputError if xatlas is missing, or the mesh fits into none of them.
    """
    for size in sizes:
        if (layout := _packed(base, size)) is not None:
            return layout
    raise InputError(f"a base of {len(base.faces)} faces does not fit a texture of {size} texels; give a larger one")


def _packed(base: Mesh, size: int) -> Layout | None:
    with needed("textures need the extra `color`: pip install 'meshreel[color]', or give --color vertices"):
        import xatlas
    density = 0.0
    for attempt in range(2 * PACKINGS):
        atlas = xatlas.Atlas()
        atlas.add_mesh(base.vertices.astype(np.float32), base.faces.astype(np.uint32))
        options = xatlas.PackOptions()
        options.padding, options.texels_per_unit = size // GUTTERS, density
        options.resolution = 0 if density else size  # with both, it would begin another texture
        atlas.generate(xatlas.ChartOptions(), options)
        widest = max(atlas.width, atlas.height)
        if widest <= size and density:
            break
        fitting = MARGIN * size / max(widest, 1)
        density = atlas.texels_per_unit * (fitting if attempt < PACKINGS else min(fitting, 0.5))
    else:
        return None
    _, corners, uv = atlas[0]
    places = np.rint(uv.astype(np.float64) * [atlas.width, atlas.height]).astype(np.int32)[corners]
    height = -(-int(places[..., 1].max(initial=1)) // BLOCK) * BLOCK
    return Layout(size, min(height, size), np.ascontiguousarray(places))
