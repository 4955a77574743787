"""Solids put together from smooth parts, one after the other, and the mesh of their surface."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Float64

from ...geometry.decimate import decimate_faces
from ...types import Mesh
from .implicit import capsule, smooth_min

Places = Float[np.ndarray, "... 3"]  # m
Depths = Float[np.ndarray, "..."]  # m, signed distances: negative inside
Vector = Float64[np.ndarray, "3"]
Place = Vector | Sequence[float]
MARGIN = 0.02  # m from a part's surface within which it is computed, beyond its blend (guess)


@dataclass(frozen=True, slots=True)
class Part:
    """Solid that is joined to those before it, or cut out of them."""

    distance: Callable[[Places], Depths]
    low: Vector  # m, corners of a box that holds it
    high: Vector
    blend: float  # m, width of the seam
    is_cut: bool = False


def ball(center: Place, radii: Place, blend: float, turn: np.ndarray | None = None, is_cut: bool = False) -> Part:
    """Return an ellipsoid; the columns of `turn` are its axes."""
    axes, middle, sizes = np.eye(3) if turn is None else turn, np.asarray(center, float), np.asarray(radii, float)

    def distance(points: Places) -> Depths:
        own = (points - middle.astype(np.float32)) @ (axes / sizes).astype(np.float32)
        steep = np.einsum("...d,...d->...", own / sizes.astype(np.float32), own / sizes.astype(np.float32))
        share = np.sqrt(np.einsum("...d,...d->...", own, own))
        return share * (share - 1) / np.sqrt(np.maximum(steep, np.float32(1e-6)))

    reach = np.sqrt(((axes * sizes) ** 2).sum(axis=1))
    return Part(distance, middle - reach, middle + reach, blend, is_cut)


def rod(start: Place, end: Place, radii: tuple[float, float], blend: float) -> Part:
    """Return a tapered capsule."""
    ends = np.array([start, end], np.float32)
    thick = np.array(radii, np.float32)
    low, high = ends.min(axis=0) - max(radii), ends.max(axis=0) + max(radii)
    return Part(lambda points: capsule(points, ends[0], ends[1], thick), low.astype(float), high.astype(float), blend)


def block(low: Place, high: Place, rounding: float, blend: float) -> Part:
    """Return a box with round edges."""
    first, last = np.asarray(low, float), np.asarray(high, float)
    middle, half = (first + last) / 2, (last - first) / 2 - rounding

    def distance(points: Places) -> Depths:
        beyond = np.abs(points - middle.astype(np.float32)) - half.astype(np.float32)
        outside = np.sqrt((np.maximum(beyond, 0) ** 2).sum(axis=-1))
        return outside + np.minimum(beyond.max(axis=-1), 0) - np.float32(rounding)

    return Part(distance, first, last, blend)


@dataclass(frozen=True, slots=True)
class Tube:
    """Tube with elliptic sections and flat ends along a straight axis."""

    start: Vector  # m
    way: Vector  # unit vector along the axis
    front: Vector  # unit vector across it, of the second radius
    rows: Float64[np.ndarray, "R 4"]  # m along the axis; radii to the side and to the front; shift to the front

    def part(self, blend: float) -> Part:
        """Return the solid."""
        reach = np.abs(self.rows[:, 1:]).max() * 1.3
        ends = self.start + self.rows[[0, -1], :1] * self.way
        return Part(self.distance, ends.min(axis=0) - reach, ends.max(axis=0) + reach, blend)

    def distance(self, points: Places) -> Depths:
        """Return signed distances, about right near the surface."""
        from scipy.interpolate import PchipInterpolator

        own = points - self.start.astype(np.float32)
        along = own @ self.way.astype(np.float32)
        first, last = self.rows[0, 0], self.rows[-1, 0]
        grid = np.linspace(first, last, 256)
        side, front, shift = (
            np.interp(along, grid, PchipInterpolator(self.rows[:, 0], self.rows[:, k])(grid)).astype(np.float32)
            for k in (1, 2, 3)
        )
        x = own @ np.cross(self.way, self.front).astype(np.float32) / side
        z = (own @ self.front.astype(np.float32) - shift) / front
        share = np.sqrt(x * x + z * z)
        across = share * (share - 1) / np.sqrt(np.maximum((x / side) ** 2 + (z / front) ** 2, np.float32(1e-6)))
        beyond = np.maximum(np.float32(first) - along, along - np.float32(last))
        outside = np.sqrt(np.maximum(across, 0) ** 2 + np.maximum(beyond, 0) ** 2)
        return outside + np.minimum(np.maximum(across, beyond), 0)


def depths(parts: Sequence[Part], points: Places) -> Depths:
    """Return the signed distances of points to the solid that the parts make."""
    total = np.full(points.shape[:-1], np.float32(MARGIN))
    for part in parts:
        reach = MARGIN + part.blend
        near = ((points > part.low - reach) & (points < part.high + reach)).all(axis=-1)
        total[near] = _combined(total[near], part.distance(points[near]), part)
    return total


def meshed(parts: Sequence[Part], spacing: float, faces: int) -> Mesh:
    """Return the closed surface, from a lattice with this spacing (m), with about so many faces."""
    from skimage.measure import marching_cubes

    low = np.min([part.low for part in parts], axis=0) - 2 * spacing
    high = np.max([part.high for part in parts], axis=0) + 2 * spacing
    axes = [np.arange(a, b + spacing, spacing, dtype=np.float32) for a, b in zip(low, high, strict=True)]
    values = np.full([len(axis) for axis in axes], np.float32(MARGIN))
    for part in parts:
        reach = MARGIN + part.blend
        corners = zip(axes, part.low - reach, part.high + reach, strict=True)
        box = tuple(slice(*np.searchsorted(axis, (a, b))) for axis, a, b in corners)
        points = np.stack(np.meshgrid(*(axis[s] for axis, s in zip(axes, box, strict=True)), indexing="ij"), axis=-1)
        values[box] = _combined(values[box], part.distance(points), part)
    corners, triangles, _, _ = marching_cubes(values, level=0.0)
    return decimate_faces(Mesh.of(corners * spacing + [axis[0] for axis in axes], triangles), faces)


def _combined(before: Depths, own: Depths, part: Part) -> Depths:
    """Return the distances to a solid after a part is joined to it, or cut out of it."""
    a, b = (-before, own) if part.is_cut else (before, own)
    found = smooth_min(a, b, max(part.blend, 1e-6))
    return (-found if part.is_cut else found).astype(np.float32)
