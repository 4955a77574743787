"""Soft shapes as the zero set of smoothly joined tapered capsules, and their meshes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from jaxtyping import Float64

from ...geometry.topology import drop_unreferenced, unique_edges
from ...types import Mesh

Points = Float64[np.ndarray, "N 3"]
Distances = Float64[np.ndarray, " N"]

_STEP = 1e-4  # m, of the difference quotient (guess)
_NEWTON_STEPS = 3  # rounds of smoothing and projection (guess)


@dataclass(frozen=True, slots=True)
class Chain:
    """Parts that blend into each other: tapered capsules from `starts` to `ends`."""

    starts: Float64[np.ndarray, "P 3"]  # m
    ends: Float64[np.ndarray, "P 3"]  # m
    radii: Float64[np.ndarray, "P 2"]  # m, at start and end
    blend: float  # m, width of the seam between parts
    join: float  # m, width of the seam to the rest of the body


Body = tuple[Chain, ...]


@dataclass(frozen=True, slots=True)
class Grid:
    """Rotated and shifted lattice: lattice point (i, j, k) lies at spacing * turn @ ((i, j, k) + shift)."""

    turn: Float64[np.ndarray, "3 3"]
    shift: Float64[np.ndarray, "3"]  # in cells
    spacing: float  # m


def field(bodies: tuple[Body, ...], touch: float, points: Points) -> Distances:
    """Return the approximate signed distance of points to the surface, m, negative inside; bodies blend by `touch`."""
    nowhere = np.full(len(points), np.inf)  # what is near nothing: the smaller of it and a distance is that distance
    total = nowhere
    for body in bodies:
        whole = nowhere
        for chain in body:
            distance = nowhere
            for start, end, radii in zip(chain.starts, chain.ends, chain.radii, strict=True):
                distance = smooth_min(distance, capsule(points, start, end, radii), chain.blend)
            whole = smooth_min(whole, distance, chain.join)
        total = smooth_min(total, whole, touch)
    return total


def polygonize(bodies: tuple[Body, ...], touch: float, grid: Grid) -> Mesh:
    """Mesh the zero set: marching cubes on the grid, then smoothing that keeps every vertex on the zero set."""
    from skimage.measure import marching_cubes

    margin = 2.5 * grid.spacing + max(touch, *(max(c.blend, c.join) for body in bodies for c in body))
    shift = grid.shift * grid.spacing
    lattice = [  # the chains in the lattice's axes, m
        [replace(c, starts=c.starts @ grid.turn - shift, ends=c.ends @ grid.turn - shift) for c in body]
        for body in bodies
    ]
    low, high = _bounds([chain for body in lattice for chain in body], margin, grid.spacing)
    values = np.full(high - low, margin, dtype=np.float32)
    for body in lattice:
        box, inner = _sampled_body(tuple(body), margin, grid.spacing, low)
        values[box] = smooth_min(values[box], inner, touch)
    corners, faces, _, _ = marching_cubes(values, level=0.0)
    vertices = ((corners.astype(np.float64) + low + grid.shift) * grid.spacing) @ grid.turn.T
    return _evened(drop_unreferenced(Mesh.of(vertices, faces)), partial(field, bodies, touch))


def capsule(points: np.ndarray, start: np.ndarray, end: np.ndarray, radii: np.ndarray) -> np.ndarray:
    """Return the signed distance of points (... x 3) to a tapered capsule, whose radius is taken at the projection."""
    axis = end - start
    offset = points - start
    along = np.clip(offset @ axis / max(float(axis @ axis), 1e-12), 0.0, 1.0)
    offset = offset - along[..., None] * axis
    return np.sqrt(np.einsum("...d,...d->...", offset, offset)) - (radii[0] + along * (radii[1] - radii[0]))


def smooth_min(a: np.ndarray, b: np.ndarray, width: float) -> np.ndarray:
    """Return the smaller of two distances, blended quadratically where they differ by less than `width`."""
    near = np.maximum(width - np.abs(a - b), 0)
    return np.minimum(a, b) - near * near / (4 * width)


def _bounds(chains: list[Chain], margin: float, spacing: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the first cell of the box around chains, widened by `margin`, and the cell behind its last."""
    reach = np.concatenate([c.radii.max(axis=1) for c in chains])[:, None] + margin
    starts, ends = np.concatenate([c.starts for c in chains]), np.concatenate([c.ends for c in chains])
    low = (np.minimum(starts, ends) - reach).min(axis=0)
    high = (np.maximum(starts, ends) + reach).max(axis=0)
    return np.floor(low / spacing).astype(int), np.ceil(high / spacing).astype(int) + 1


def _box(chains: list[Chain], margin: float, spacing: float, low: np.ndarray) -> tuple[tuple[slice, ...], np.ndarray]:
    """Return the slices that chains occupy in an array whose first cell is `low`, and the first cell of the slices."""
    first, last = _bounds(chains, margin, spacing)
    return tuple(slice(a, b) for a, b in zip(first - low, last - low, strict=True)), first


def _sampled_body(body: Body, margin: float, spacing: float, low: np.ndarray) -> tuple[tuple[slice, ...], np.ndarray]:
    """Sample the field of one body near its surface, `margin` elsewhere; each part is sampled in its own box only."""
    box, first = _box(list(body), margin, spacing, low)
    values = np.full([s.stop - s.start for s in box], margin, dtype=np.float32)
    for chain in body:
        chain_box, chain_first = _box([chain], margin, spacing, first)
        inner = np.full(values[chain_box].shape, margin, dtype=np.float32)
        for start, end, radii in zip(chain.starts, chain.ends, chain.radii, strict=True):
            one = Chain(start[None], end[None], radii[None], chain.blend, chain.join)
            part_box, part_first = _box([one], margin, spacing, chain_first)
            sides = zip(part_box, part_first, strict=True)
            axes = [np.arange(s.stop - s.start, dtype=np.float32) + f for s, f in sides]
            centers = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1) * np.float32(spacing)
            part = capsule(centers, *(x.astype(np.float32) for x in (start, end, radii)))
            inner[part_box] = smooth_min(inner[part_box], part, chain.blend)
        values[chain_box] = smooth_min(values[chain_box], inner, chain.join)
    return box, values


def _evened(mesh: Mesh, distance: Callable[[Points], Distances]) -> Mesh:
    """Remove slivers: move vertices towards the middle of their neighbours and back onto the zero set."""
    edges, _ = unique_edges(mesh.faces)
    count = len(mesh.vertices)
    degree = np.maximum(np.bincount(edges.reshape(-1), minlength=count), 1)[:, None]
    vertices = mesh.vertices
    for _ in range(_NEWTON_STEPS):
        total = np.zeros_like(vertices)
        for axis in range(3):
            total[:, axis] += np.bincount(edges[:, 0], vertices[edges[:, 1], axis], count)
            total[:, axis] += np.bincount(edges[:, 1], vertices[edges[:, 0], axis], count)
        vertices = _landed((vertices + total / degree) / 2, distance)
    return Mesh.of(_landed(vertices, distance), mesh.faces)


def _landed(points: Points, distance: Callable[[Points], Distances]) -> Points:
    """Move points by one Newton step towards the zero set."""
    here = distance(points)
    slope = np.stack([(distance(points + _STEP * axis) - here) / _STEP for axis in np.eye(3)], axis=1)
    return points - here[:, None] * slope / np.maximum(np.einsum("nd,nd->n", slope, slope), 0.25)[:, None]
