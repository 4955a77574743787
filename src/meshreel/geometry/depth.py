"""Depth pictures: what a depth camera measures at a moment, those of a recording by frame, and steps in depth."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, Protocol, runtime_checkable

import numpy as np
from jaxtyping import Bool, Float, Float32, Float64, Int64, UInt16

from ..types import Placement, evenly
from .cameras import Camera

_Shares = tuple[Int64[np.ndarray, " N"], Float64[np.ndarray, " N"]]  # pixels, and how much each counts

FACING = 0.3  # least cosine between a surface's normal and the direction to a camera that measures it (guess)
THROUGH = (0.03, 0.015)  # m, and share of the depth: a measurement so far behind a place proves it free (guess)
APART = (0.06, 0.02)  # m, and share of the depth: measurements farther apart are of different surfaces (guess)
WORLD = Placement(1.0, (0.0, 0.0, 0.0))
STEP = 0.03  # of the depth, between neighbours: pixels that differ by more are of two surfaces (guess)
PLACES = 4  # frames in which it is asked where cameras are: one that moves is in no two at the same place (guess)
SMOOTHED = 5  # pixels across, of the median that a depth picture is smoothed by (guess)


def apart(depth: Float[np.ndarray, "..."]) -> Float[np.ndarray, "..."]:
    """Return by how much two measurements at a depth must differ to be of different surfaces, m."""
    return np.maximum(APART[0], APART[1] * depth)


def depth_noise(depth: Float64[np.ndarray, "..."]) -> Float64[np.ndarray, "..."]:
    """Return the usual noise of a depth camera, m, growing with depth: 15 mm at 2 m, 20 mm at 3 m (paper, 4.1)."""
    return 0.005 + 0.005 * depth


@dataclass(frozen=True, slots=True)
class DepthPicture:
    """Depths along the optical axis of a camera; 0 is no measurement."""

    camera: Camera
    depth: UInt16[np.ndarray, "H W"] | Float32[np.ndarray, "H W"]
    unit: float  # m, of a depth of 1
    far: float  # m, the largest depth that counts

    def placed(self, place: Placement) -> DepthPicture:
        """Return the picture for places in normalised coordinates."""
        return replace(self, camera=self.camera.placed(place), unit=self.unit / place.scale, far=self.far / place.scale)

    def finer(self, factor: int) -> DepthPicture:
        """Return the picture with `factor` times as many rows and columns, interpolated along surfaces.

        A plane stays a plane, for the inverse of its depth is linear in the picture. At a grazing angle,
        neighbouring rows are far apart in depth: on a grid of distances the surface would be stairs with cracks. No
        depth between two surfaces results: pixels farther apart than `STEP` are not mixed.
        """
        inverse = inverse_depths(self.depth)
        (rows, nearest_rows), (columns, nearest_columns) = (_between(count, factor) for count in inverse.shape)
        nearest = inverse[nearest_rows][:, nearest_columns]
        sums, weights = np.zeros(nearest.shape), np.zeros(nearest.shape)
        for row, down in rows:
            for column, right in columns:
                values = inverse[row][:, column]
                weight = np.where(np.abs(values - nearest) <= STEP * nearest, down[:, None] * right, 0.0)
                sums += weight * values
                weights += weight
        depth = np.where(sums > 0, weights / np.where(sums > 0, sums, 1), 0).astype(np.float32)
        return replace(self, camera=self.camera.resized(depth.shape[1], depth.shape[0]), depth=depth)


def inverse_depths(values: UInt16[np.ndarray, "H W"] | Float32[np.ndarray, "H W"]) -> Float[np.ndarray, "H W"]:
    """Return the reciprocals of depths or inverse depths; 0 stays 0."""
    measured = values > 0
    return np.where(measured, 1.0 / np.where(measured, values, 1), 0.0)


@dataclass(frozen=True, slots=True)
class FreeSpace:
    """Space that depth cameras saw through at one moment, queried in any coordinates."""

    pictures: tuple[DepthPicture, ...]  # each depth the least of nine pixels, 0 if one of them has none
    place: Placement  # of the coordinates, in the world

    @staticmethod
    def of(pictures: Sequence[DepthPicture | None], place: Placement = WORLD) -> FreeSpace:
        """Return the space that cameras saw through, in the coordinates of `place`."""
        from scipy.ndimage import minimum_filter

        eroded = (replace(each, depth=minimum_filter(each.depth, 3)) for each in pictures if each is not None)
        return FreeSpace(tuple(eroded), place)

    def at(self, points: Float64[np.ndarray, "N 3"]) -> Bool[np.ndarray, " N"]:
        """Return the points that some camera saw past: it measured a larger depth in all nine pixels around."""
        free = np.zeros(len(points), bool)
        for _, inside, depth, ahead, past in self._measured(points):
            free[inside[depth > ahead + past]] = True
        return free

    def faced(self, points: Float64[np.ndarray, "N 3"], normals: Float64[np.ndarray, "N 3"]) -> Bool[np.ndarray, " N"]:
        """Return the points with these normals that face some camera which measured nothing in front of them."""
        facing_points = np.zeros(len(points), bool)
        for way, inside, depth, ahead, past in self._measured(points):
            hidden = (depth > 0) & (depth < ahead - past)
            facing_points[inside[_facing(way, normals[inside]) & ~hidden]] = True
        return facing_points

    def blank(self, points: Float64[np.ndarray, "N 3"], normals: Float64[np.ndarray, "N 3"]) -> Bool[np.ndarray, " N"]:
        """Return the points with these normals that face some camera which measured nothing there."""
        blank_points = np.zeros(len(points), bool)
        for way, inside, depth, _, _ in self._measured(points):
            blank_points[inside[(depth == 0) & _facing(way, normals[inside])]] = True
        return blank_points

    def _measured(self, points: Float64[np.ndarray, "N 3"]) -> Iterator[tuple[Any, Any, Any, Any, Any]]:
        """Yield for each camera the ways to it from the points in its picture, their numbers, their measured and their
        own depths, and the difference of both that is significant, m.
        """
        world = np.asarray(self.place.origin) + self.place.scale * points
        for picture in self.pictures:
            pixels, inside, ahead = picture.camera.seen(world)
            depth = picture.depth.reshape(-1)[pixels] * picture.unit
            significant = np.maximum(THROUGH[0], THROUGH[1] * ahead)
            yield picture.camera.eye - world[inside], inside, depth, ahead, significant


def _facing(way: Float64[np.ndarray, "N 3"], normals: Float64[np.ndarray, "N 3"]) -> Bool[np.ndarray, " N"]:
    """Return whether surface with these normals faces what is that way."""
    return np.einsum("nd,nd->n", way, normals) > FACING * np.linalg.norm(way, axis=1)


def _between(count: int, factor: int) -> tuple[list[_Shares], Int64[np.ndarray, " N"]]:
    """Return the pixels of an axis before and after the middles of finer ones, with their shares, and the nearest."""
    places = (np.arange(count * factor) + 0.5) / factor - 0.5
    before = np.floor(places).astype(np.int64)
    share = places - before
    first, second, nearest = (np.clip(before + k, 0, count - 1) for k in (0, 1, share >= 0.5))
    return [(first, 1 - share), (second, share)], nearest


@runtime_checkable
class DepthFrames(Protocol):
    """The depth pictures of a recording, by frame; each has its camera, where it is in that frame."""

    def __getitem__(self, index: int, /) -> list[DepthPicture | None]:
        """Return a frame's pictures, one for each camera; None for a camera that lacks the frame."""


class _Taken(Protocol):
    """A picture and its camera."""

    @property
    def camera(self) -> Camera: ...


def is_carried(pictures: Callable[[int], Sequence[_Taken | None]], count: int) -> bool:
    """Return whether a camera of the depth or colour pictures of `count` frames is elsewhere in another frame."""
    seen = dict[int, Camera]()
    for index in evenly(count, PLACES):
        for number, picture in enumerate(pictures(index)):
            if picture is not None and seen.setdefault(number, picture.camera) != picture.camera:
                return True
    return False


def looked_at(pictures: Sequence[DepthPicture | None], points: Float64[np.ndarray, "N 3"]) -> Bool[np.ndarray, " N"]:
    """Return the points that some camera would measure if surface were there: nothing nearer hides them."""
    seen = np.zeros(len(points), bool)
    for picture in pictures:
        if picture is not None:
            pixels, inside, depth = picture.camera.seen(points)
            measured = picture.depth.reshape(-1)[pixels] * picture.unit
            seen[inside[measured > depth - apart(depth)]] = True
    return seen


def rise(depth: Float32[np.ndarray, "H W"]) -> Float32[np.ndarray, "H W"]:
    """Return the change of depth from each pixel to its neighbours on the same surface, the largest."""
    largest = np.zeros_like(depth)
    for axis in (0, 1):
        before, after = np.moveaxis(depth, axis, 0)[:-1], np.moveaxis(depth, axis, 0)[1:]
        with np.errstate(invalid="ignore"):
            change = np.abs(before - after)
            change[~(change <= STEP * np.minimum(before, after))] = 0
        there = np.moveaxis(largest, axis, 0)
        for side in (there[:-1], there[1:]):
            np.maximum(side, change, out=side)
    return largest


def smoothed(depth: Float32[np.ndarray, "H W"]) -> Float32[np.ndarray, "H W"]:
    """Return a depth picture without holes and noise, so that steps are those of the surface.

    A hole takes the depth of the nearest pixel: between near and far surface its middle is a step.
    """
    from scipy.ndimage import distance_transform_edt, median_filter

    nearest = distance_transform_edt(~np.isfinite(depth), return_distances=False, return_indices=True)
    return median_filter(depth[tuple(nearest)], SMOOTHED)


def steps_of(depth: Float32[np.ndarray, "H W"]) -> Bool[np.ndarray, "H W"]:
    """Return the pixels beside a step in depth."""
    steps = np.zeros(depth.shape, bool)
    for axis in (0, 1):
        before, after = np.moveaxis(depth, axis, 0)[:-1], np.moveaxis(depth, axis, 0)[1:]
        with np.errstate(invalid="ignore"):
            differ = ~(np.abs(before - after) <= STEP * np.minimum(before, after))  # also if one is a hole
        differ &= np.isfinite(before) | np.isfinite(after)
        edge = np.moveaxis(steps, axis, 0)
        edge[:-1] |= differ
        edge[1:] |= differ
    return steps
