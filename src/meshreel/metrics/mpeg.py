"""MPEG's own measures of meshes, as its tool mmetric and the conditions of V-DMC define them: D1, D2 and IBSM.

Read from mmetric 1.1 (MPEGGroup/mpeg-pcc-mmetric) and the configurations of V-DMC's test model 4, for facts. D1 and D2
compare points where the lines of a grid meet each surface, IBSM pictures from sixteen sides. Left out: the mean over
points that are equally near, and mmetric's culling of back faces, which closed meshes hide anyway.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float64, Int64
from scipy.spatial import cKDTree

from ..errors import InputError
from ..geometry.cameras import matrix_of
from ..geometry.color_views import Painted
from ..geometry.drawing import Crop, Parallel, draw_places
from ..geometry.topology import face_normals
from ..types import Mesh
from .color import PEAK, TO_YUV
from .render import crop_of
from .surface_samples import used_surface
from .viewpoints import Box

Points = Float64[np.ndarray, "N 3"]
Values = Float64[np.ndarray, " N"]
Way = Float64[np.ndarray, " 3"]  # a direction, or a place
MEASURES = ("mpeg_d1_psnr", "mpeg_d2_psnr", "ibsm_geometry_psnr", "ibsm_luma_psnr")
CEILING = 99.99  # dB
VIEWS = 16  # on a Fibonacci sphere
DEPTH_PEAK = 3.0  # radii: mmetric's depth buffer ends there, though surface lies within two of the camera
BORDER = 1.01  # radius of the pictures, in half diagonals of the box of both meshes


@dataclass(frozen=True, slots=True)
class MpegOptions:
    """Options of MPEG's measures; the defaults are mmetric's."""

    pixels: int = 2048  # side of the pictures of IBSM
    grid: int = 1024  # lines along the longest edge of the box (`gridSize` of V-DMC's conditions)
    edge: float | None = None  # m, longest edge of the box of all of which these frames are a part; None: of their own

    def __post_init__(self) -> None:
        if self.pixels < 8 or self.grid < 8:
            raise InputError(f"pictures of {self.pixels} pixels, a grid of {self.grid} lines: give at least 8 of each")
        if self.edge is not None and not 0 < self.edge < math.inf:
            raise InputError(f"an edge of {self.edge:g} m: give a length above 0")


def mpeg_errors(original: Mesh, decoded: Mesh, box: Box, options: MpegOptions = MpegOptions()) -> dict[str, float]:
    """Return the PSNRs of a decoded frame, dB, by name; `box` is that of all original frames.

    D1 (point to point) and D2 (point to plane) are the worse of both directions, whose peak is three squares of the
    box's longest edge, or of the edge in the options. IBSM is of depth and, for meshes with colours, of luma. Where one
    mesh alone is empty: 0 dB.
    """
    names = MEASURES if original.is_colored and decoded.is_colored else MEASURES[:3]
    pair = original, decoded
    if any(used_surface(mesh).is_empty for mesh in pair):
        worst = CEILING if all(used_surface(mesh).is_empty for mesh in pair) else 0.0
        return dict.fromkeys(names, worst)
    edge = float(box.size.max()) if options.edge is None else options.edge
    clouds = [Cloud.of(mesh, box.low, edge / (options.grid - 1) or 1.0) for mesh in pair]
    ways = np.maximum(clouds[0].squares(clouds[1]), clouds[1].squares(clouds[0]))
    d1, d2 = (_psnr(square / 3, edge) for square in ways.tolist())
    depth, luma = _picture_squares(original, decoded, options.pixels)
    return dict(zip(names, (d1, d2, _psnr(depth, DEPTH_PEAK), _psnr(luma, PEAK)), strict=False))


@dataclass(frozen=True, slots=True)
class Cloud:
    """Points of a surface with the normals of their faces; points at one place are one, with their mean normal."""

    points: Points
    normals: Points

    @classmethod
    def of(cls, mesh: Mesh, low: Way, step: float) -> Cloud:
        """Sample a mesh where the lines of a grid, along the axis nearest to a face's normal, meet the face.

        `low` is a corner of the grid, `step` its spacing, m.
        """
        normals, areas = face_normals(mesh)
        axes = np.where(areas > 0, np.abs(normals).argmax(axis=1), -1)
        crossings = [_crossed(mesh, np.flatnonzero(axes == axis), axis, (low, step)) for axis in range(3)]
        points, faces = (np.concatenate(parts) for parts in zip(*crossings, strict=True))
        if not len(points):  # a mesh smaller than the grid's spacing: its vertices
            points, faces = mesh.vertices[mesh.faces.reshape(-1)], np.repeat(np.arange(len(mesh.faces)), 3)
        places, at, counts = np.unique(points.astype(np.float32), axis=0, return_inverse=True, return_counts=True)
        sums = [np.bincount(at.reshape(-1), normals[faces, axis]) for axis in range(3)]
        return cls(places.astype(np.float64), np.stack(sums, axis=1) / counts[:, None])

    def squares(self, other: Cloud) -> Float64[np.ndarray, " 2"]:
        """Return the mean squared distances from these points to the nearest of the other's, and to its plane."""
        tree = cKDTree(other.points, balanced_tree=False, compact_nodes=False)  # medians of a grid are slow
        nearest = tree.query(self.points)[1]
        offsets = other.points[nearest] - self.points
        along = np.einsum("nd,nd->n", offsets, other.normals[nearest])
        return np.array([np.einsum("nd,nd->n", offsets, offsets).mean(), np.square(along).mean()])


def _crossed(
    mesh: Mesh, faces: Int64[np.ndarray, " F"], axis: int, grid: tuple[Way, float]
) -> tuple[Points, Int64[np.ndarray, " N"]]:
    """Return the points where a grid's lines along an axis meet faces, and those faces; `grid`: corner and spacing."""
    low, step = grid
    corners = mesh.vertices[mesh.faces[faces]]
    across = [other for other in range(3) if other != axis]
    flat = (corners[:, :, across] - low[across]) / step
    first = np.ceil(flat.min(axis=1)).astype(np.int64)
    sizes = np.maximum(np.floor(flat.max(axis=1)).astype(np.int64) - first + 1, 0)
    counts = sizes.prod(axis=1)
    face_numbers = np.repeat(np.arange(len(faces)), counts)
    number = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
    lines = first[face_numbers] + np.stack(np.divmod(number, np.maximum(sizes[face_numbers, 1], 1)), axis=1)
    a, b, c = (flat[face_numbers, corner] for corner in range(3))
    barycentric = np.stack([_turn(t - s, lines - s) for s, t in ((b, c), (c, a), (a, b))], axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):  # no line is inside a face that is seen edge-on
        barycentric /= _turn(b - a, c - a)[:, None]
    inside = (barycentric >= 0).all(axis=1)
    face_numbers, lines, barycentric = face_numbers[inside], lines[inside], barycentric[inside]
    points = np.empty((len(face_numbers), 3))
    points[:, across] = low[across] + lines * step
    points[:, axis] = np.einsum("nk,nk->n", barycentric, corners[face_numbers, :, axis])
    return points, faces[face_numbers]


def _turn(a: Float64[np.ndarray, "N 2"], b: Float64[np.ndarray, "N 2"]) -> Values:
    return a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]


def _picture_squares(original: Mesh, decoded: Mesh, pixels: int) -> tuple[float, float]:
    """Return mean squared differences of depth (radii) and luma, over pixels of all views that see both meshes."""
    box = Box.of([original, decoded])
    radius = BORDER * float(np.linalg.norm(box.size)) / 2
    pair = [(mesh, Painted(mesh) if mesh.is_colored else None) for mesh in (original, decoded)]
    sums, count = np.zeros(2), 0
    for way in directions():
        camera = _camera(way, box.center, radius, pixels)
        crop = crop_of([original, decoded], camera)
        a, b = (_seen(*each, camera, crop) for each in pair)
        both = a[0] & b[0]
        count += int(both.sum())
        sums += [np.square((a[1] - b[1])[both] / radius).sum(), np.square((a[2] - b[2])[both]).sum()]
    return (float(sums[0]) / count, float(sums[1]) / count) if count else (math.inf, math.inf)


def _seen(
    mesh: Mesh, painted: Painted | None, camera: Parallel, crop: Crop
) -> tuple[Bool[np.ndarray, "H W"], Float64[np.ndarray, "H W"], Float64[np.ndarray, "H W"]]:
    """Return a mask of the pixels that see a mesh, their depths, and the luma there."""
    seen = draw_places(mesh, camera, crop)
    depth, luma = np.zeros(crop.shape), np.zeros(crop.shape)
    depth[seen.covered] = seen.depth
    if painted is not None:
        colors = np.clip(np.rint(painted.on(seen.faces, seen.barycentric)), 0, PEAK)
        luma[seen.covered] = np.rint(colors @ TO_YUV[0])
    return seen.covered, depth, luma


def directions() -> Iterator[Way]:
    """Yield the directions from the middle of the box to the cameras, from +y to -y."""
    for number in range(VIEWS):
        y, turn = 1 - 2 * number / (VIEWS - 1), math.pi * (3 - math.sqrt(5)) * number
        yield np.array([math.cos(turn) * math.sqrt(1 - y * y), y, math.sin(turn) * math.sqrt(1 - y * y)])


def _camera(way: Way, center: Way, radius: float, pixels: int) -> Parallel:
    """Return the camera that looks at the middle from a direction, whose middle pixel sees it."""
    up = np.array([0.0, 0.0, 1.0]) if abs(abs(way[1]) - 1) < 1e-6 else np.array([0.0, 1.0, 0.0])
    right = np.cross(up, way) / np.linalg.norm(np.cross(up, way))
    turn = np.stack([right, np.cross(way, right), -way])
    side = pixels + 1 - pixels % 2
    return Parallel(side, side, 2 * radius / pixels, matrix_of(turn, -turn @ center))


def _psnr(square: float, peak: float) -> float:
    """Return 10 log10(peak^2 / square), at most `CEILING` and at least 0."""
    if square == 0:
        return CEILING
    return 0.0 if math.isinf(square) else min(CEILING, 10 * math.log10(peak**2 / square))
