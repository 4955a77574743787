"""Colours of places on a surface: from camera pictures, from a texture, or blended from vertices.

In camera pictures, places are projected and blended: cameras that looked at a place most squarely count most. A picture
counts only where its camera saw the place: the surface drawn into it is there, as deep, the depth camera beside it, if
there is one, measured it as deep, and no step in depth is among the pixels that are mixed.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass, replace
from itertools import repeat
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Bool, Float, Float32, Float64, Int32, Int64, UInt8

from .. import _core
from ..types import GREY, Mesh, Placement
from . import work
from .cameras import Camera
from .closest_points import Surface
from .depth import STEP, DepthPicture, rise, smoothed, steps_of
from .drawing import draw
from .strict import products
from .threads import mapped
from .topology import blend, face_means, face_normals

Points = Float64[np.ndarray, "N 3"]  # also normals, and colours from 0 to 255
Mask = Bool[np.ndarray, " N"]
_Pair = tuple[Int64[np.ndarray, " N"], Int64[np.ndarray, " N"], Float64[np.ndarray, " N"]]

MOST_SIDE = 512  # pixels, of the depth pictures that test occlusion: a third of the time of whole ones (guess)
MARGIN = 0.01  # of the depth, and at least as many metres: how far a place may lie off the visible surface (guess)
FEATHER = 4.0  # pixels from a step in depth within which a colour counts less, and none at it: both sides mix (guess)
LEAST = 0.01  # of a frontal view's weight, near a step: at outlines, pixels mix a body with what is behind (measured)
BESIDE = 0.1  # of the usual depth, between two cameras: the largest distance at which both see the same (guess)
OUTLIER = 4.0  # standard deviations of measured depths from the drawn surface, beyond which they are of another (guess)
MEDIAN = 0.6745  # of an absolute value, in standard deviations


@dataclass(frozen=True, slots=True)
class ColorPicture:
    """A picture in sRGB with the camera that took it."""

    camera: Camera
    pixels: UInt8[np.ndarray, "H W 3"]
    gains: tuple[float, float, float] = (1.0, 1.0, 1.0)  # factors by which its channels are too bright

    def project(self, points: Points) -> tuple[Float64[np.ndarray, "N 2"], Float64[np.ndarray, " N"]]:
        """Return positions in the picture, NaN for points that are not in front, and depths along the optical axis."""
        local = self.camera.local(points)
        return self.camera.project(local), local[:, 2]

    def placed(self, place: Placement) -> ColorPicture:
        """Return the picture for places in normalised coordinates."""
        return replace(self, camera=self.camera.placed(place))


@runtime_checkable
class ColorFrames(Protocol):
    """The colour pictures of a recording, by frame; its cameras stand still."""

    def __getitem__(self, index: int, /) -> list[ColorPicture | None]:
        """Return a frame's pictures, one for each camera; None for a camera that lacks the frame."""


class ColorViews:
    """The pictures of one moment, prepared for repeated queries."""

    def __init__(
        self,
        pictures: Sequence[ColorPicture],
        hides: Mesh,
        margin: float = MARGIN,
        depths: Sequence[DepthPicture] = (),
    ) -> None:
        """Take pictures, all surface that may occlude a place, and what depth cameras measured at that moment.

        `margin` is in the unit of the vertices, as are the depths.
        """
        self.views = mapped(View.of, pictures, repeat(hides), repeat(margin), repeat(depths))

    @property
    def clear(self) -> ColorViews:
        """The same views, in which a place near a step in depth counts as hidden: pictures mix both sides there."""
        found = copy(self)
        found.views = mapped(View.cleared, self.views)
        return found

    @property
    def without_pictures(self) -> ColorViews:
        """The same views of the surface, to be given pictures before they are asked."""
        none = np.zeros((0, 0, 3), np.uint8)
        return self.with_pictures([replace(view.picture, pixels=none) for view in self.views])

    def with_pictures(self, pictures: Sequence[ColorPicture]) -> ColorViews:
        """Return the views with pictures of the same cameras."""
        found = copy(self)
        found.views = [replace(view, picture=picture) for view, picture in zip(self.views, pictures, strict=True)]
        return found

    @property
    def nbytes(self) -> int:
        """Memory of the depths, bytes."""
        return sum(view.depth.nbytes + view.from_step.nbytes for view in self.views)

    def at(self, points: Points, normals: Points) -> tuple[Points, Mask]:
        """Return the colours of places with these normals, 0 to 255, and a mask of those that some camera saw."""
        sums, weights = np.zeros((len(points), 3)), np.zeros(len(points))
        for view in self.views:
            view.add(points, normals, weights, sums)
        known = weights > 0
        sums[known] /= weights[known, None]
        return sums, known

    def pixels_on(self, mesh: Mesh) -> float:
        """Return how many pixels of the pictures show a mesh: each face counts in the picture that resolves it best."""
        normals, areas = face_normals(mesh)
        middles, most = face_means(mesh.vertices, mesh.faces), np.zeros(len(mesh.faces))
        for view in self.views:
            camera, depth = view.picture.camera, view.picture.project(middles)[1]
            cosine = np.cbrt(view.weights(middles, normals))  # less near steps
            finest = camera.focal[0] * camera.focal[1] / np.maximum(depth, 1e-9) ** 2
            most = np.maximum(most, finest * cosine * areas)
        return float(most.sum())


@dataclass(frozen=True, slots=True)
class View:
    """A picture, and the depth of the surface that each of its pixels shows; a large picture's depths are coarser."""

    picture: ColorPicture
    shrink: int  # pixels of the picture, along a side, in each of these
    depth: Float32[np.ndarray, "H W"]  # through a lens without distortion; infinite where the camera saw no surface
    from_step: UInt8[np.ndarray, "H W"]  # distance from a step in depth, in 255ths of `FEATHER`
    margin: float

    @staticmethod
    def of(picture: ColorPicture, hides: Mesh, margin: float, depths: Sequence[DepthPicture] = ()) -> View:
        """Return the view of surface from where a picture was taken."""
        work.count("pictures drawn")
        camera = picture.camera
        shrink = max(1, -(-max(camera.width, camera.height) // MOST_SIDE))
        coarse = _of_depths(camera, shrink)
        depth = _confirmed(draw(hides, coarse).depth, coarse, margin, depths)
        return View(picture, shrink, depth, _from_step(depth, shrink), margin)

    @property
    def camera(self) -> Camera:
        """The camera of the depths: its lens has no distortion."""
        return _of_depths(self.picture.camera, self.shrink)

    def cleared(self) -> View:
        """Return the view in which places near a step are hidden, and at a hole: steps are those of smoothed depth."""
        clear = (_from_step(smoothed(self.depth), self.shrink) == 255) & (self.from_step > 0)
        return replace(self, from_step=np.where(clear, 255, 0).astype(np.uint8))

    def weights(self, points: Points, normals: Points, at_step: float = 0.0) -> Float64[np.ndarray, " N"]:
        """Return how well the picture shows places: the cube of the cosine of the view, less near steps; 0 if hidden.

        `at_step` is the share of the weight that remains at a step.
        """
        weights = np.zeros(len(points))
        self.add(points, normals, weights, at_step=at_step)
        return weights

    def add(
        self,
        points: Points,
        normals: Points,
        weights: Float64[np.ndarray, " N"],
        sums: Points | None = None,
        at_step: float = 0.0,
    ) -> None:
        """Add each place's weight to `weights`, and its colour in the picture times that weight to `sums`."""
        camera = self.picture.camera
        turn, shift = (np.ascontiguousarray(part) for part in (camera.extrinsic[:3, :3], camera.extrinsic[:3, 3]))
        lens, bend = np.array([*camera.focal, *camera.center]), np.array(camera.distortion, np.float64)
        size = np.array([camera.width, camera.height, self.shrink], np.int32)
        limits, gains = np.array([self.margin, MARGIN, LEAST, at_step]), np.array(self.picture.gains, np.float64)
        seen, pixels = (size, self.depth, self.from_step, limits), None if sums is None else self.picture.pixels
        total = np.zeros((0, 3)) if sums is None else sums
        _core.add_view(turn, shift, camera.eye, lens, bend, *seen, pixels, gains, points, normals, total, weights)


def _of_depths(camera: Camera, shrink: int) -> Camera:
    width, height = -(-camera.width // shrink), -(-camera.height // shrink)
    return Camera.of(width, height, camera.intrinsic / [[shrink], [shrink], [1.0]], camera.extrinsic)


def _confirmed(
    drawn: Float32[np.ndarray, "H W"], camera: Camera, margin: float, depths: Sequence[DepthPicture]
) -> Float32[np.ndarray, "H W"]:
    """Return the depths that a camera sees of a surface, infinite where the depth camera beside it measured none there.

    Surface that no measurement confirms was guessed, beyond the border of what was seen or between things. Depths are
    alike within the noise, which is measured here, and what the surface rises by in a pixel. Single pixels without a
    measurement count as their neighbours do; what lies beside the depth camera's picture counts as it is drawn.
    """
    from scipy.ndimage import binary_closing

    covered = np.isfinite(drawn)
    if not depths or not covered.any():
        return drawn
    beside = min(depths, key=lambda one: float(np.linalg.norm(one.camera.eye - camera.eye)))
    if np.linalg.norm(beside.camera.eye - camera.eye) > BESIDE * np.median(drawn[covered]):
        return drawn
    own = drawn[covered].astype(np.float64)
    local = camera.ahead[covered] * own[:, None]
    pixels, inside, there = beside.camera.seen(products(local - camera.extrinsic[:3, 3], camera.extrinsic[:3, :3]))
    measured = beside.depth.reshape(-1)[pixels] * beside.unit
    off = np.where((measured > 0) & (measured <= beside.far), np.abs(measured - there), np.inf) / there
    known = off[off < STEP]
    noise = float(np.median(known)) / MEDIAN if len(known) else 0.0
    pitch = max(1.0, camera.focal[0] / beside.camera.focal[0], camera.focal[1] / beside.camera.focal[1])
    allowed = np.maximum(margin / there, max(MARGIN, OUTLIER * noise)) + pitch * rise(drawn)[covered][inside] / there
    agrees = np.ones(len(own), bool)
    agrees[inside] = off <= allowed
    confirmed = np.zeros(drawn.shape, bool)
    confirmed[covered] = agrees
    confirmed |= binary_closing(confirmed, np.ones((2 * math.ceil(pitch) + 1,) * 2))
    return np.where(confirmed, drawn, np.inf).astype(np.float32)


def _from_step(depth: Float32[np.ndarray, "H W"], shrink: int) -> UInt8[np.ndarray, "H W"]:
    """Return the distance of each pixel from a step in depth, in 255ths of `FEATHER`, at most 255."""
    from scipy.ndimage import distance_transform_edt

    away = distance_transform_edt(~steps_of(depth)) * shrink
    return np.floor(np.minimum(away / FEATHER, 1.0) * 255).astype(np.uint8)


def sampled(
    pixels: UInt8[np.ndarray, "H W C"] | Float32[np.ndarray, "H W C"], positions: Float64[np.ndarray, "N 2"]
) -> Float64[np.ndarray, "N C"]:
    """Return the values at positions in a picture, blended between the middles of pixels."""
    height, width = pixels.shape[:2]
    x, y = np.clip(positions - 0.5, 0, [width - 1, height - 1]).T
    x0, y0 = np.minimum(x.astype(np.int64), width - 2), np.minimum(y.astype(np.int64), height - 2)
    return _between(pixels, (x0, x0 + 1, x - x0), (y0, y0 + 1, y - y0))


def spread_colors(mesh: Mesh, colors: Points, seen: Mask) -> UInt8[np.ndarray, "N 3"]:
    """Return colours of all vertices of a mesh: those that no camera saw have the means of neighbours, ring by ring."""
    ends = np.concatenate([mesh.faces, mesh.faces[:, [1, 2, 0]]]).reshape(-1)
    others = np.concatenate([mesh.faces[:, [1, 2, 0]], mesh.faces]).reshape(-1)
    values, reached_vertices = np.where(seen[:, None], colors, float(GREY)), seen.copy()
    while True:
        reached = reached_vertices[others] & ~reached_vertices[ends]
        if not reached.any():
            return np.clip(np.rint(values), 0, 255).astype(np.uint8)
        at, counts = ends[reached], np.bincount(ends[reached], minlength=len(reached_vertices))
        sums = np.stack([np.bincount(at, values[others[reached], k], len(reached_vertices)) for k in range(3)], axis=1)
        new = counts > 0
        values[new] = sums[new] / counts[new, None]
        reached_vertices |= new


@runtime_checkable
class Paint(Protocol):
    """Source of colours of points on a surface."""

    def at(self, points: Points, normals: Points) -> tuple[Points, Mask]:
        """Return the colours of points with these normals, 0 to 255, and a mask of the known ones."""

    def pixels_on(self, mesh: Mesh) -> float:
        """Return the number of pixels of its pictures that show a mesh; infinite without pictures."""


class Painted:
    """A mesh with faces and colours, prepared for repeated queries."""

    def __init__(self, mesh: Mesh, far: float = np.inf) -> None:
        """Take the mesh; colours of points farther from it than `far`, in the unit of its vertices, are unknown."""
        self._mesh, self._surface, self._far = mesh, Surface(mesh), far
        self._pixels = None if mesh.uv is None or mesh.texture is None else mesh.texture.pixels

    def at(self, points: Points, normals: Points) -> tuple[Points, Mask]:
        """Return the colours at the closest points of the mesh, whatever the normals, and a mask of near points."""
        del normals
        hits = self._surface.closest(points)
        return self.on(hits.faces, hits.barycentric), np.linalg.norm(hits.points - points, axis=1) <= self._far

    def pixels_on(self, mesh: Mesh) -> float:
        """Return the number of texels of the painted mesh, whatever `mesh`; infinite without a texture."""
        del mesh
        if self._pixels is None or self._mesh.uv is None:
            return np.inf
        a, b, c = np.moveaxis(self._mesh.uv.astype(np.float64), 1, 0)
        areas = np.abs((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]) / 2
        return float(np.nansum(areas)) * self._pixels.shape[0] * self._pixels.shape[1]

    def on(self, faces: Int32[np.ndarray, " N"], barycentric: Float64[np.ndarray, "N 3"]) -> Points:
        """Return the colours at places inside faces."""
        return colors_on(self._mesh, self._pixels, faces, barycentric)


def colors_on(
    mesh: Mesh,
    pixels: UInt8[np.ndarray, "H W 3"] | None,
    faces: Int32[np.ndarray, " N"],
    barycentric: Float64[np.ndarray, "N 3"],
) -> Points:
    """Return the colours at places inside faces of a mesh whose texture, if it has one, has these pixels."""
    if mesh.colors is None:
        colors = np.full((len(faces), 3), float(GREY))
    else:
        colors = blend(mesh.colors.astype(np.float64), mesh.faces[faces], barycentric)
    if pixels is not None and mesh.uv is not None:
        places = np.einsum("nkc,nk->nc", mesh.uv[faces].astype(np.float64), barycentric)
        textured = np.isfinite(places).all(axis=1)
        colors[textured] = bilinear(pixels, places[textured])
    return colors


def bilinear(pixels: UInt8[np.ndarray, "H W 3"], places: Float[np.ndarray, "N 2"]) -> Points:
    """Return the colours at places of a texture, as in `Mesh.uv`; outside of 0 to 1 the texture is repeated."""
    height, width = pixels.shape[:2]
    x, y = np.asarray(places, np.float64).T
    x, y = (x - np.floor(x)) * width - 0.5, (1.0 - (y - np.floor(y))) * height - 0.5
    left, above = np.floor(x), np.floor(y)
    x0, y0 = left.astype(np.int64) % width, above.astype(np.int64) % height
    return _between(pixels, (x0, (x0 + 1) % width, x - left), (y0, (y0 + 1) % height, y - above))


def _between(
    pixels: UInt8[np.ndarray, "H W C"] | Float32[np.ndarray, "H W C"], columns: _Pair, rows: _Pair
) -> Float64[np.ndarray, "N C"]:
    """Blend the pixels of two columns and two rows each; a pair ends with the share of its second."""
    (x0, x1, fx), (y0, y1, fy) = ((first, second, share[:, None]) for first, second, share in (columns, rows))
    width, flat = pixels.shape[1], pixels.reshape(-1, pixels.shape[2])
    upper = flat[y0 * width + x0] * (1 - fx) + flat[y0 * width + x1] * fx
    lower = flat[y1 * width + x0] * (1 - fx) + flat[y1 * width + x1] * fx
    return upper * (1 - fy) + lower * fy
