"""Splats on a mesh: flat Gaussians at places of a base mesh's faces, which move with the mesh.

In: splats, and the mesh of a frame after any number of subdivisions. Out: Gaussians in space. A place inside a face of
the base mesh is found on each finer mesh, so that every layer of a group has the splats.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..shapes import Bool, Float64, Int32, Int64

THIN = 0.1  # ratio of the third scale, along the normal, to the shorter one (guess): surfaces are thin


@dataclass(frozen=True, slots=True)
class Splats:
    """Gaussians on the faces of a base mesh; lengths are normalised."""

    faces: Int32[np.ndarray, " N"]  # of the base mesh
    weights: Float64[np.ndarray, "N 2"]  # of the second and third corner of the face; the first has the rest of 1
    offsets: Float64[np.ndarray, " N"]  # from the face, along its normal
    turns: Float64[np.ndarray, " N"]  # rad, of the longer axis from the face's first edge, about its normal
    scales: Float64[np.ndarray, "N 2"]  # standard deviations along the longer axis and the shorter
    opacities: Float64[np.ndarray, " N"]  # 0 to 1
    colors: Float64[np.ndarray, "N 3"]  # red, green, blue, sRGB, 0 to 1

    def __len__(self) -> int:
        return len(self.faces)

    def take(self, chosen: Int64[np.ndarray, " M"] | Bool[np.ndarray, " N"]) -> Splats:
        return Splats(*(getattr(self, name)[chosen] for name in self.__slots__))


@dataclass(frozen=True, slots=True)
class Bound:
    """Gaussians in space, in a frame."""

    means: Float64[np.ndarray, "N 3"]
    axes: Float64[np.ndarray, "N 3 3"]  # rows: along the longer scale, the shorter, and the normal; right-handed
    scales: Float64[np.ndarray, "N 3"]  # standard deviations along these
    opacities: Float64[np.ndarray, " N"]  # 0 to 1; 0 where the frame lacks the face
    colors: Float64[np.ndarray, "N 3"]  # sRGB, 0 to 1

    @staticmethod
    def join(parts: Sequence[Bound]) -> Bound:
        """Return the Gaussians of all parts, of which there is at least one."""
        return Bound(*(np.concatenate([getattr(part, name) for part in parts]) for name in Bound.__slots__))


@dataclass(frozen=True, slots=True)
class Carrier:
    """The mesh of a frame that carries splats: the base mesh after some subdivisions."""

    vertices: Float64[np.ndarray, "V 3"]
    faces: Int32[np.ndarray, "F 3"]
    levels: int  # midpoint subdivisions of the base mesh
    lacking: Bool[np.ndarray, " F"] | None = None  # faces that the frame lacks
    unit: float = 1.0  # unit of splats' lengths, in the unit of the vertices


def bind(splats: Splats, carrier: Carrier) -> Bound:
    """Return the splats in a frame; a splat on a face that the frame lacks, or without area, is transparent."""
    finer, weights, along = locate(splats.faces, splats.weights, carrier.levels)
    corners, shape = carrier.vertices[carrier.faces[finer]], (splats.offsets, splats.turns, splats.scales, carrier.unit)
    means, axes, scales = pose(np, corners, weights, along, shape)
    is_there = axes.any(axis=2).all(axis=1)
    if carrier.lacking is not None:
        is_there &= ~carrier.lacking[finer]
    return Bound(means, axes, scales, np.where(is_there, splats.opacities, 0.0), splats.colors)


def pose(xp: Any, corners: Any, weights: Any, along: Any, shape: tuple[Any, Any, Any, float]) -> tuple[Any, Any, Any]:
    """Return means, axes and scales of splats, from the corners of their faces; `xp` is NumPy, or torch.

    `shape` are their offsets, turns and scales, and the unit of these. Axes on a face without area are 0.
    """
    offsets, turns, scales, unit = shape
    first = _unit(xp, (along[:, 0, :, None] * corners).sum(axis=1))
    normals = _unit(xp, _cross(xp, corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]))
    second = _cross(xp, normals, first)
    means = (weights[:, :, None] * corners).sum(axis=1) + unit * offsets[:, None] * normals
    cosines, sines = xp.cos(turns)[:, None], xp.sin(turns)[:, None]
    axes = xp.stack([cosines * first + sines * second, cosines * second - sines * first, normals], axis=1)
    return means, axes, unit * xp.stack([scales[:, 0], scales[:, 1], THIN * scales[:, 1]], axis=1)


def locate(
    faces: Int32[np.ndarray, " N"], weights: Float64[np.ndarray, "N 2"], levels: int
) -> tuple[Int64[np.ndarray, " N"], Float64[np.ndarray, "N 3"], Float64[np.ndarray, "N 2 3"]]:
    """Convert places on a base mesh to places on the mesh after `levels` subdivisions.

    Return the faces, the weights of their corners, and the derivatives of these by the second and third base weight.
    """
    return located(faces, np.column_stack([1 - weights.sum(axis=1), weights]), levels)


def located(
    faces: Int32[np.ndarray, " N"] | Int64[np.ndarray, " N"], corner_weights: Float64[np.ndarray, "N 3"], levels: int
) -> tuple[Int64[np.ndarray, " N"], Float64[np.ndarray, "N 3"], Float64[np.ndarray, "N 2 3"]]:
    """Convert places as `locate` does, given the weights of all three corners."""
    finer, along = faces.astype(np.int64), np.tile(np.array([[-1.0, 1.0, 0.0], [-1.0, 0.0, 1.0]]), (len(faces), 1, 1))
    for _ in range(levels):
        largest = corner_weights.argmax(axis=1)
        is_inner = corner_weights.max(axis=1, initial=0) < 0.5
        corner_weights, along = 2 * corner_weights, 2 * along
        corner_weights[np.arange(len(corner_weights)), largest] -= 1  # faces (a, ab, ca), (ab, b, bc), (ca, bc, c)
        corner_weights[is_inner, largest[is_inner]] += 1
        corner_weights[is_inner] = 1 - corner_weights[is_inner][:, [2, 0, 1]]  # (ab, bc, ca)
        along[is_inner] = -along[is_inner][:, :, [2, 0, 1]]
        finer = 4 * finer + np.where(is_inner, 3, largest)
    return finer, corner_weights, along


def _cross(xp: Any, a: Any, b: Any) -> Any:
    return xp.stack([a[:, i] * b[:, j] - a[:, j] * b[:, i] for i, j in ((1, 2), (2, 0), (0, 1))], axis=1)


def _unit(xp: Any, vectors: Any) -> Any:
    squares = (vectors * vectors).sum(axis=1)
    return vectors / xp.sqrt(xp.where(squares > 0, squares, xp.ones_like(squares)))[:, None]
