"""Bake colours: onto textures, vertices, and backgrounds.

In: a mesh, and a painted surface or several. Out: places of its faces in a texture (by xatlas, extra `color`, or by
projection to cameras), and a picture without empty texels, so that a video of such pictures has no edges that the
surface lacks; or colours of vertices by least squares; or medians over frames, so that people who pass by a background
leave no ghosts.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float64, Int32, Int64, UInt8

from ...errors import InputError, needed
from ...geometry.atlas import MOST_SIDE, Layout
from ...geometry.bisection import bisected
from ...geometry.color_views import ColorViews, Paint, View, spread_colors
from ...geometry.drawing import box_pixels, draw
from ...geometry.splats import located
from ...geometry.topology import blend, face_means, face_normals, unique_edges
from ...geometry.work import passed
from ...types import GREY, Mesh

Points = Float64[np.ndarray, "N 3"]
Weights = Float64[np.ndarray, "N 3"]  # of the corners of faces
PerFace = Float64[np.ndarray, " F"]
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
ENLARGED = 3.0  # largest number of texels along a pixel: 39 dB of living_room; with 2: 38, with 1: 36, at similar rates
SMALL = 0.025  # of a picture's longer side: longest side of a face of which it need not have all, 5 cm at 2 m (guess)
TURNS, SEAM = 16, 1.0  # rounds of choosing pictures; what neighbours count beside how well a picture shows (guess)
THIN, THIN_ROUNDS = 0.05, 4  # height over length of faces whose normals are rounding; how many lie side by side (guess)
COUNTED = (
    1.5  # by which the middles of pixels inside a face differ from its area, per root of its border's pixels (guess)
)
BENT = 0.002  # of a picture's longer side, by which perspective may bend an edge (guess)
CUTS = 16  # rounds of cutting faces in two, at most: one of 3 m to 5 cm takes 12
USUAL_SIDE = 1024  # texels, side up to which small pictures are enlarged (guess)
BESIDE = 1.0  # texels from a chart within which a texel is mixed with those of the chart: they are blended
BLOCK = 16  # texels: the height of the texture is a multiple, as video has blocks


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


def projected(mesh: Mesh, views: ColorViews) -> tuple[Layout, float]:
    """Return the faces' places in the cameras' pictures, laid side by side, and the texels along a pixel.

    A face is in a picture that sees it frontally, if possible in that of the faces beside it: thin faces and seams
    between pictures show. A face that no picture has entirely has no place. Small pictures are enlarged, because
    corners are on whole texels, and large ones are reduced to fit a texture.
    """
    shown = [_Shown.of(mesh, view) for view in views.views]
    weights = np.stack([np.where(each.has_all | (each.longest <= SMALL), each.weights, 0.0) for each in shown])
    best = _with_few_seams(mesh, weights)
    places, left, height = np.zeros((len(mesh.faces), 3, 2)), 0, 0
    for number, (view, each) in enumerate(zip(views.views, shown, strict=True)):
        camera = view.picture.camera
        places[best == number] = each.corners[best == number] + [left, 0]
        left, height = left + camera.width, max(height, camera.height)
    side = max(left, height)
    scale = min(ENLARGED, max(1.0, USUAL_SIDE / side), MOST_SIDE / side)
    scaled = np.where(best[:, None, None] < 0, 0.0, places * scale)
    sides = [max(2, -(-round(side * scale) // BLOCK) * BLOCK) for side in (left, height)]
    return Layout(sides[0], sides[1], np.ascontiguousarray(np.rint(scaled).astype(np.int32))), scale


def _with_few_seams(mesh: Mesh, weights: Float64[np.ndarray, "views F"]) -> Numbers:
    """Return the number of a picture for each face, by how well it shows the face and its neighbours; -1 for none."""
    most = weights.max(axis=0)
    own = weights / np.maximum(most, 1e-300)
    edges, face_edges = unique_edges(mesh.faces)
    lengths = np.linalg.norm(mesh.vertices[edges[:, 0]] - mesh.vertices[edges[:, 1]], axis=1)[face_edges]
    best, shares = own.argmax(axis=0), lengths / np.maximum(lengths.sum(axis=1, keepdims=True), 1e-300)
    for turn in range(TURNS):
        beside = np.empty_like(own)
        for number in range(len(own)):
            is_there = best == number
            around = np.bincount(face_edges.reshape(-1), np.repeat(is_there, 3), len(edges))[face_edges]
            beside[number] = ((around - is_there[:, None]) * shares).sum(axis=1)
        better = np.where(weights > 0, own + SEAM * beside, -1.0).argmax(axis=0)
        best = np.where(np.arange(len(best)) % 2 == turn % 2, better, best)  # neighbours would swap for ever
    return np.where(most > 0, best, -1)


def steady_normals(mesh: Mesh) -> Points:
    """Return unit normals of the faces; those of thin ones, which tell nothing, are of the faces beside them."""
    (normals, areas), edges = face_normals(mesh), unique_edges(mesh.faces)
    lengths = np.linalg.norm(mesh.vertices[edges[0][:, 0]] - mesh.vertices[edges[0][:, 1]], axis=1)
    thin = np.flatnonzero(2 * areas <= THIN * lengths[edges[1]].max(axis=1) ** 2)
    sides, sums = edges[1].reshape(-1), normals * areas[:, None]
    for _ in range(THIN_ROUNDS if len(thin) else 0):
        of_edges = [np.bincount(sides, np.repeat(sums[:, k], 3), len(lengths)) for k in range(3)]
        sums[thin] = np.stack(of_edges, axis=1)[edges[1][thin]].sum(axis=1)
    return sums / np.maximum(np.linalg.norm(sums, axis=1), 1e-300)[:, None]


def shown_whole(mesh: Mesh, views: ColorViews) -> Mesh:
    """Return a mesh whose large faces are cut until a picture has them entirely, or none has any of them.

    Of a large face that something hides in part, a picture has what hides it, too; and a picture shows it in
    perspective, of which a texture knows nothing.
    """
    for _ in range(CUTS):
        wanted, most = np.zeros(len(mesh.faces), bool), np.zeros(len(mesh.faces))
        edges, sides = unique_edges(mesh.faces)
        for view in views.views:
            shown, side = _Shown.of(mesh, view), max(view.picture.camera.width, view.picture.camera.height)
            middles, ends = mesh.vertices[edges].mean(axis=1), view.picture.project(mesh.vertices)[0][edges]
            with np.errstate(invalid="ignore"):
                off = np.linalg.norm(view.picture.project(middles)[0] - ends.mean(axis=1), axis=1)[sides].max(axis=1)
            large, better = ~(shown.longest <= SMALL), shown.has_all & (shown.weights > most)
            most[better], wanted[better] = shown.weights[better], (large & (off > BENT * side))[better]
            wanted |= shown.has_some & large & (most == 0)
        if not wanted.any():
            break
        mesh = bisected(mesh, wanted)
    return mesh


@dataclass(frozen=True, slots=True)
class _Shown:
    """How a picture shows the faces of a mesh."""

    corners: Float64[np.ndarray, "F 3 2"]  # where they are in the picture
    longest: PerFace  # side, as a share of the picture's longer one; NaN where a corner is behind the camera
    weights: PerFace  # of their middles; 0 where the face is not within the picture
    has_some: Known  # of the face
    has_all: Known

    @staticmethod
    def of(mesh: Mesh, view: View) -> _Shown:
        taken, normals, middles = view.picture, steady_normals(mesh), face_means(mesh.vertices, mesh.faces)
        size = np.array([taken.camera.width, taken.camera.height])
        corners = taken.project(mesh.vertices)[0][mesh.faces]
        with np.errstate(invalid="ignore"):
            inside = ((corners >= 0) & (corners <= size)).all(axis=(1, 2))
            longest = _sides(corners).max(axis=1) / size.max()
        weights = np.where(inside, view.weights(middles, normals, at_step=0.1), 0.0)
        drawn = draw(mesh, view.camera).faces
        counts = np.bincount(drawn[drawn >= 0], minlength=len(mesh.faces))
        straight = replace(taken, camera=view.camera).project(mesh.vertices)[0][mesh.faces]
        a, b, c = np.moveaxis(straight, 1, 0)
        with np.errstate(invalid="ignore"):
            areas = np.abs((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]) / 2
            has_all = counts >= areas - COUNTED * np.sqrt(_sides(straight).sum(axis=1)) - 1
        return _Shown(corners, longest, weights, counts > 0, has_all & (weights > 0))


def _sides(corners: Float64[np.ndarray, "F 3 2"]) -> Float64[np.ndarray, "F 3"]:
    return np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
