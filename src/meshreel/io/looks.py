"""Looks of faces, colours and pictures of materials -> colours of vertices and one texture, perhaps of several."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from jaxtyping import Bool, Float32, Float64, Int64, UInt8

from ..types import GREY, Texture
from .pictures import MOST_PIXELS
from .polygons import Polygons, Unreadable

_TRIED = 8  # times the texels of a picture may be looked at: faces that cover it so often overlap (guess)
_AT_ONCE = 1 << 20  # texels, some 200 MB
_CLASH = 0.02  # of full light: two lights at one texel that differ by more are two (guess)


@dataclass(frozen=True, slots=True)
class Look:
    """A colour (sRGB), or a picture; or neither."""

    color: tuple[int, int, int] | None = None
    picture: Texture | None = None


@dataclass(frozen=True, slots=True)
class Part:
    """The polygons of a scene that have one look."""

    vertices: Float64[np.ndarray, "V 3"]
    corners: Int64[np.ndarray, " C"]  # vertex of each corner of each polygon
    sizes: Int64[np.ndarray, " P"]  # corners of each polygon
    colors: UInt8[np.ndarray, "V 3"] | None = None  # sRGB
    uv: Float32[np.ndarray, "C 2"] | None = None  # as `Mesh.uv`
    look: Look = Look()


def joined(parts: Sequence[Part]) -> Polygons:
    """Return the parts of a scene as one surface."""
    counts = np.array([len(part.vertices) for part in parts], np.int64)
    begins = np.cumsum(counts) - counts
    vertices = np.concatenate([np.zeros((0, 3)), *(part.vertices for part in parts)])
    corners = np.concatenate(
        [np.zeros(0, np.int64), *(part.corners + begin for part, begin in zip(parts, begins, strict=True))]
    )
    # A vertex without colours beside others has none of its own; its look may have one.
    colored = np.repeat(np.array([part.colors is not None for part in parts], bool), counts)
    none = [np.zeros((len(part.vertices), 3), np.uint8) if part.colors is None else part.colors for part in parts]
    colors = np.concatenate([np.zeros((0, 3), np.uint8), *none])
    places = [np.full((len(p.corners), 2), np.nan, np.float32) if p.uv is None else p.uv for p in parts]
    uv = np.concatenate([np.zeros((0, 2), np.float32), *places])
    sizes = np.concatenate([np.zeros(0, np.int64), *(part.sizes for part in parts)])
    which = np.repeat(np.arange(len(parts)), [len(part.sizes) for part in parts])
    uv_or_none = uv if np.isfinite(uv).any() else None
    looks = [part.look for part in parts]
    # Beside colours, what has none is white, not unknown.
    if colored.any() or any(look.color is not None for look in looks):
        looks = [look if look != Look() else Look((255, 255, 255)) for look in looks]
    return with_looks(Polygons(vertices, corners, sizes, colors=colors, colored=colored, uv=uv_or_none), looks, which)


def check_corners(name: object, corners: Int64[np.ndarray, " C"], sizes: Int64[np.ndarray, " P"], count: int) -> None:
    """Raise Unreadable, which names a mesh of `count` vertices, where its polygons have other corners."""
    if sizes.sum() != len(corners) or (sizes < 0).any():
        raise Unreadable(f"{name} has {len(corners)} corners, and its polygons {int(sizes.sum())}")
    wrong = corners[(corners < 0) | (corners >= count)]
    if len(wrong):
        raise Unreadable(f"{name} refers to point {wrong[0]}, and has {count}")


CONSTANT, FACES, VERTICES, CORNERS = "constant", "uniform", "vertex", "faceVarying"  # whose values are, in USD's words


def of_vertices(
    colors: UInt8[np.ndarray, "N 3"],
    scope: str | None,
    count: int,
    corners: Int64[np.ndarray, " C"],
    sizes: Int64[np.ndarray, " P"],
) -> tuple[UInt8[np.ndarray, "V 3"] | None, tuple[int, int, int] | None]:
    """Return the colours of `count` vertices, those of faces and corners as their means; or one for all of them.

    Where the file does not say whose the colours are, and `scope` is None, their number tells. Colours of another
    number are none.
    """
    scope = scope or _scope(len(colors), count, corners, sizes)
    if scope == CONSTANT and len(colors):
        red, green, blue = colors[0].tolist()
        return None, (red, green, blue)
    if scope == VERTICES:
        return (colors if len(colors) == count else None), None
    own = np.repeat(colors, sizes, axis=0) if scope == FACES and len(colors) == len(sizes) else colors
    if not len(own) or len(own) != len(corners):
        return None, None
    counts = np.maximum(np.bincount(corners, minlength=count), 1)
    sums = [np.bincount(corners, own[:, axis], count) for axis in range(3)]
    return np.rint(np.stack(sums, axis=1) / counts[:, None]).astype(np.uint8), None


def of_corners(
    values: Float32[np.ndarray, "N 2"], scope: str | None, count: int, corners: Int64[np.ndarray, " C"]
) -> Float32[np.ndarray, "C 2"] | None:
    """Return the values of corners, of which `count` vertices or the corners have some; None of another number."""
    scope = scope or _scope(len(values), count, corners, np.zeros(0, np.int64))
    if scope == CORNERS:
        return values if len(values) == len(corners) else None
    return values[corners] if scope == VERTICES and len(values) == count else None


def _scope(number: int, count: int, corners: np.ndarray, sizes: np.ndarray) -> str:
    numbers = {1: CONSTANT, len(sizes): FACES, len(corners): CORNERS, count: VERTICES}
    return numbers.get(number, "")


def backwards(sizes: Int64[np.ndarray, " P"]) -> Int64[np.ndarray, " C"]:
    """Return the order of corners in which each polygon runs the other way."""
    ends = np.cumsum(sizes)
    return np.repeat(ends - sizes + ends - 1, sizes) - np.arange(int(sizes.sum()))


def with_looks(polygons: Polygons, looks: Sequence[Look], which: Int64[np.ndarray, " P"]) -> Polygons:
    """Return polygons with their looks, whose numbers are `which`, -1 for none, as colours of vertices and a picture.

    A vertex without a colour of its own has the mean of its faces' own colours, or else of the colours of their looks.
    Several pictures become one.
    """
    if polygons.face_colors is not None:
        count = len(polygons.sizes)
        polygons = _with_means(polygons, polygons.face_colors.astype(np.float64), np.ones(count, bool))
    stated = [look.color for look in looks if look.color is not None]
    face_colors = np.array([look.color or (0, 0, 0) for look in looks] + [(0, 0, 0)], np.float64)[which]
    has_color = np.array([look.color is not None for look in looks] + [False], bool)[which]
    named = set[str]()
    if len({*stated}) == 1 and has_color.all() and len({*stated[0]}) == 1 and not _colored(polygons).any():
        named.add("the one grey of all faces")  # how programs draw surfaces that have no colours
        polygons = replace(polygons, colors=None, colored=None)
    else:
        polygons = _with_means(polygons, face_colors, has_color)
    pictures = list(dict.fromkeys(look.picture for look in looks if look.picture is not None))
    if polygons.uv is None or not pictures:
        lost = {"texture coordinates"} if polygons.uv is not None and np.isfinite(polygons.uv).any() else set[str]()
        return replace(polygons, uv=None).naming(named | lost)
    numbers = np.array([-1 if look.picture is None else pictures.index(look.picture) for look in looks] + [-1])[which]
    numbers = np.repeat(numbers, polygons.sizes)
    uv = np.where((numbers >= 0)[:, None], polygons.uv, np.float32(np.nan))
    if len(pictures) == 1:
        return replace(polygons, uv=uv, texture=pictures[0]).naming(named)
    uv, beyond = _in_cells(uv, numbers, polygons.sizes, len(pictures))
    named |= {"pictures that repeat within a face, of several"} if beyond else set()
    return replace(polygons, uv=uv, texture=Texture(partial(_sheet, tuple(pictures)))).naming(named)


def _colored(polygons: Polygons) -> Bool[np.ndarray, " V"]:
    """Return which vertices have a colour of their own."""
    if polygons.colored is not None:
        return polygons.colored
    return np.full(len(polygons.vertices), polygons.colors is not None)


def _with_means(polygons: Polygons, face_colors: np.ndarray, has_color: Bool[np.ndarray, " P"]) -> Polygons:
    """Return polygons whose other vertices have the mean of their faces' colours, or grey; none if there are none."""
    colored, colors = _colored(polygons), polygons.colors
    if not colored.any() and not has_color.any():
        return replace(polygons, colors=None, colored=None, face_colors=None)
    corners, chosen = polygons.corners, np.repeat(has_color, polygons.sizes)
    corners = np.where((corners >= 0) & (corners < len(polygons.vertices)), corners, 0)  # checked later
    values = np.repeat(face_colors, polygons.sizes, axis=0)[chosen]
    counts = np.bincount(corners[chosen], minlength=len(polygons.vertices))
    sums = [np.bincount(corners[chosen], values[:, k], len(polygons.vertices)) for k in range(3)]
    means = np.rint(np.stack(sums, axis=1) / np.maximum(counts, 1)[:, None])
    found = np.where((counts > 0)[:, None], means, GREY).astype(np.uint8)
    found = found if colors is None else np.where(colored[:, None], colors, found)
    return replace(polygons, colors=found, colored=None, face_colors=None)


def light_in_picture(
    places: Float32[np.ndarray, "F 3 2"], light: Float64[np.ndarray, "F 3 3"], height: int, width: int
) -> Float32[np.ndarray, "{height} {width} 3"] | None:
    """Return the light that falls on each texel of a picture, of corners with places in it, as `Mesh.uv`.

    Between corners it is interpolated, and beside faces it is that of the nearest texel. None where there is no such
    picture: faces of other light share its texels, or repeat it.
    """
    from scipy.ndimage import distance_transform_edt

    local = places.astype(np.float64)
    if not len(local) or not np.isfinite(local).all():
        return None
    local -= np.floor(local.min(axis=1, keepdims=True) + 1e-4)
    x, y = local[..., 0] * width, (1 - local[..., 1]) * height
    first = [np.ceil(np.clip(c.min(axis=1) - 0.5, 0, n)).astype(int) for c, n in ((x, width), (y, height))]
    last = [np.floor(np.clip(c.max(axis=1) - 0.5, -1, n - 1)).astype(int) for c, n in ((x, width), (y, height))]
    columns, rows = (np.maximum(end - begin + 1, 0) for begin, end in zip(first, last, strict=True))
    ends = np.cumsum(columns * rows)
    if not (local <= 1 + 1e-4).all() or ends[-1] > _TRIED * height * width:
        return None
    corners = np.stack([x - 0.5, y - 0.5, np.ones(x.shape)], axis=1)  # column k: a corner, in texels
    has_area = np.abs(np.linalg.det(corners)) > 1e-9
    planes = np.zeros(corners.shape)  # what gives the shares of the corners at a texel (column, row, 1)
    planes[has_area], planes[~has_area, :, 2] = np.linalg.inv(corners[has_area]), -1
    found, clashes = np.full((height * width, 3), np.nan, np.float32), 0
    for begin in range(0, int(ends[-1]), _AT_ONCE):
        number = np.arange(begin, min(begin + _AT_ONCE, ends[-1]))
        face = np.searchsorted(ends, number, side="right")
        row, column = np.divmod(number - (ends - columns * rows)[face], columns[face])
        column, row = column + first[0][face], row + first[1][face]
        shares = np.einsum("nkc,nc->nk", planes[face], np.stack([column, row, np.ones(len(row))], axis=1))
        inside = shares.min(axis=1) >= -1e-9
        texels = (row * width + column)[inside]
        lit = np.einsum("nk,nkc->nc", shares[inside], light[face[inside]]).astype(np.float32)
        for again in (False, True):
            clashes += int((np.abs(found[texels] - lit) > _CLASH).any(axis=1).sum())
            if not again:
                found[texels] = lit
    known = np.isfinite(found[:, 0]).reshape(height, width)
    if clashes > 1e-3 * known.sum() or not known.any():
        return None
    if known.all():
        return found.reshape(height, width, 3)
    nearest = distance_transform_edt(~known, return_distances=False, return_indices=True)
    return found.reshape(height, width, 3)[tuple(nearest)]


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
