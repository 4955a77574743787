"""PCQM: how much worse people find a coloured surface than its original, by its curvature and its lightness.

Source: G. Meynet, Y. Nehmé, J. Digne, G. Lavoué, *PCQM: A Full-Reference Quality Metric for Colored 3D Point Clouds*,
QoMEX 2020, with the radii and constants that its authors publish. It was fitted to opinions on point clouds.

Differs from the paper: points are spread over surfaces, at most `MOST`; at most `SLACK` times the usual number count in
a neighbourhood; the box has its own sides, not the sums of the absolute values of its ends; where several quadrics fit,
the flattest counts.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float64, Int64
from scipy.spatial import cKDTree

from meshreel.geometry.color_views import Painted
from meshreel.geometry.topology import face_normals
from meshreel.metrics.surface_samples import scatter
from meshreel.types import Mesh

RADIUS = 0.004  # of the longest side of the original's box: of what curvature is taken from (the authors')
AROUND = 2.0  # of the radius: of what is compared; the weights are Gaussian, one radius wide (the authors')
NEAREST = 20  # points of the other surface to which a point is projected (the authors')
WITHIN = 16  # points within a radius, on average: enough for a quadric, which has six numbers (guess)
MOST = 250_000  # points on a surface, for time and memory: a room has fewer within a radius (guess)
SLACK = 2.5  # times as many points as on average that are looked at within a radius (guess)
BATCH = 20_000  # points that are compared at once, for memory
WEIGHTS = np.array([0.0057, 0.9771, 0.0172])  # of structure of curvature, lightness, structure of lightness (paper)
CURVED, LIGHT, STRUCTURED = 1.0, 0.002, 0.1  # constants of the three (the authors')
LEAST = 1e-9  # added to the squares of a quadric's numbers: of several quadrics that fit, the flattest
WORST = 1.0  # where one of two surfaces is empty
Points = Float64[np.ndarray, "N 3"]
Numbers = Float64[np.ndarray, " N"]


def pcqm(original: Mesh, decoded: Mesh) -> float:
    """Return the PCQM of a decoded mesh: 0 is equal, larger is worse, at most about 1."""
    original, decoded = (mesh.with_faces(face_normals(mesh)[1] > 0) for mesh in (original, decoded))
    if original.is_empty or decoded.is_empty:
        return 0.0 if original.is_empty and decoded.is_empty else WORST
    low, high = original.box
    largest = float((high - low).max())
    own, other = (Cloud.of(mesh, RADIUS * largest) for mesh in (original, decoded))
    batches = [slice(start, start + BATCH) for start in range(0, len(own.points), BATCH)]
    feet, light, bends = zip(*(_onto(other, own.points[some]) for some in batches), strict=True)
    found = _Compared(np.concatenate(feet), np.concatenate(light), largest * np.concatenate(bends))
    bend = largest * np.concatenate([own.curvature(own.points[some]) for some in batches])
    mean = sum((_features(own, bend, found, some).sum(axis=0) for some in batches), np.zeros(3)) / len(own.points)
    return float(WEIGHTS @ mean)


def lightness(colors: Points) -> Numbers:
    """Return the lightness of sRGB colours, 0 to 255, in steps that look alike: CIE L*, spaced as CIEDE2000 has it."""
    linear = np.where(colors <= 10.31475, colors / (255 * 12.92), ((colors / 255 + 0.055) / 1.055) ** 2.4)
    y = linear @ [0.2126, 0.7152, 0.0722]
    star = np.where(y > 216 / 24389, 116 * np.cbrt(y) - 16, y * 24389 / 27)
    at = np.linspace(0, 100, 10_001)
    slope = 1 / (1 + 0.015 * (at - 50) ** 2 / np.sqrt(20 + (at - 50) ** 2))
    return np.interp(star, at, np.concatenate([[0], np.cumsum((slope[1:] + slope[:-1]) / 2 * 0.01)]))


@dataclass(frozen=True)
class Cloud:
    """Points spread over a surface, and their lightness."""

    points: Points
    light: Numbers
    radius: float  # of the neighbourhoods of which curvature is taken

    @classmethod
    def of(cls, mesh: Mesh, radius: float) -> Cloud:
        count = WITHIN * float(face_normals(mesh)[1].sum()) / (np.pi * radius**2)
        some = scatter(mesh, np.ones(len(mesh.faces), bool), int(np.clip(count, NEAREST, MOST)))
        colors = Painted(mesh).on(some.faces.astype(np.int32), some.barycentric)
        return cls(some.points, lightness(colors), radius)

    @cached_property
    def tree(self) -> cKDTree:
        return cKDTree(self.points)

    def near(self, points: Points, radius: float, most: int) -> tuple[Float64[np.ndarray, "N k"], np.ndarray]:
        """Return distances and numbers of points within a radius; infinite, and the number of points, where none is."""
        return self.tree.query(points, most, distance_upper_bound=radius)

    def curvature(self, points: Points) -> Numbers:
        """Return the mean curvature, without its sign, of a quadric through the points around each of N points."""
        distances, which = self.near(points, self.radius, int(SLACK * WITHIN))
        return np.abs(self._quadrics(points, distances, which)[1])

    def feet(self, points: Points) -> tuple[Points, Int64[np.ndarray, " N"]]:
        """Return where points are projected to, and the points nearest to them."""
        distances, which = self.near(points, np.inf, min(NEAREST, len(self.points)))
        offsets, _ = self._quadrics(points, distances, which)
        is_far = np.linalg.norm(offsets, axis=1) > distances[:, 0]
        return np.where(is_far[:, None], self.points[which[:, 0]], points + offsets), which[:, 0]

    def _quadrics(
        self, points: Points, distances: Float64[np.ndarray, "N k"], which: Int64[np.ndarray, "N k"]
    ) -> tuple[Points, Numbers]:
        """Return the offsets of N points to quadrics through k points around each, and the mean curvature there."""
        there = np.isfinite(distances)
        around = (self.points[np.where(there, which, 0)] - points[:, None]) / self.radius * there[..., None]
        count = np.maximum(there.sum(axis=1), 1)
        middle = around.sum(axis=1) / count[:, None]
        spread = np.einsum("nki,nkj->nij", around, around) / count[:, None, None]
        axes = np.linalg.eigh(spread - middle[:, :, None] * middle[:, None])[1]  # the normal first
        z, y, x = np.moveaxis(around @ axes, 2, 0)
        rows = np.stack([x * x, y * y, x * y, x, y, np.ones_like(x)], axis=2) * there[..., None]
        squares = np.einsum("nki,nkj->nij", rows, rows) + LEAST * np.eye(6)
        xx, yy, xy, dx, dy, off = np.linalg.solve(squares, np.einsum("nki,nk->ni", rows, z)[..., None])[..., 0].T
        bend = (1 + dx * dx) * 2 * yy + (1 + dy * dy) * 2 * xx - 2 * xy * dx * dy
        mean = bend / (2 * (1 + dx * dx + dy * dy) ** 1.5)
        return self.radius * off[:, None] * axes[:, :, 0], mean / self.radius


@dataclass(frozen=True, slots=True)
class _Compared:
    """Feet of a cloud's points on the other surface, with its lightness and its curvature there."""

    feet: Points
    light: Numbers
    bend: Numbers


def _onto(other: Cloud, points: Points) -> tuple[Points, Numbers, Numbers]:
    feet, nearest = other.feet(points)
    return feet, other.light[nearest], other.curvature(points)


def _features(own: Cloud, bend: Numbers, other: _Compared, some: slice) -> Float64[np.ndarray, "_ 3"]:
    """Return structure of curvature, lightness and structure of lightness at some points, 0 where they are equal."""
    distances, which = own.near(own.points[some], AROUND * own.radius, int(SLACK * AROUND**2 * WITHIN))
    there = np.isfinite(distances)
    which = np.where(there, which, 0)
    moved = np.linalg.norm(other.feet[which] - other.feet[some, None], axis=2)
    sides = [
        np.exp(-((each / own.radius) ** 2) / 2, where=there, out=np.zeros_like(each)) for each in (distances, moved)
    ]
    sides = [each / each.sum(axis=1, keepdims=True) for each in sides]
    evenly = there / there.sum(axis=1, keepdims=True)
    bends = _Statistics.of(bend[which], other.bend[which], *sides)
    lights = _Statistics.of(own.light[which], other.light[which], *sides)
    even = _Statistics.of(own.light[which], other.light[which], evenly, evenly)
    structure = np.abs(bends.deviation - bends.together) / (bends.deviation + CURVED)
    return np.stack([
        np.minimum(structure, 1),
        1 - 1 / (LIGHT * lights.apart**2 + 1),
        1 - (even.together + STRUCTURED) / (even.deviation + STRUCTURED),
    ], axis=1)  # fmt: skip


@dataclass(frozen=True, slots=True)
class _Statistics:
    """Of two numbers around N points: how far their means are apart, the product of their deviations, covariance."""

    apart: Numbers
    deviation: Numbers
    together: Numbers

    @classmethod
    def of(cls, a: np.ndarray, b: np.ndarray, of_a: np.ndarray, of_b: np.ndarray) -> _Statistics:
        """`of_a` and `of_b` are the weights of k numbers around each of N points; covariance has those of `a`."""
        means = [(each * weights).sum(axis=1, keepdims=True) for each, weights in ((a, of_a), (b, of_b))]
        a, b = a - means[0], b - means[1]
        deviation = np.sqrt((a * a * of_a).sum(axis=1) * (b * b * of_b).sum(axis=1))
        return cls((means[0] - means[1])[:, 0], deviation, (a * b * of_a).sum(axis=1))
