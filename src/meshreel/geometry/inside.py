"""Points spread evenly through the volume that a mesh encloses, found by libigl's fast winding number.

Mesh -> jittered grid points where |winding number| > 1/2 (Barill et al. 2018), so that slightly open and inside-out
meshes work. A component that encloses nothing (an open sheet) is sampled on its surface instead. Used by the encoder
only (paper, section 3.1); needs the extra `encode`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float64, Int64

from ..types import Mesh
from .closest_points import Surface
from .strict import rounded
from .topology import connected_faces, face_normals, weld

Points = Float64[np.ndarray, "N 3"]
Labels = Int64[np.ndarray, " N"]
OfFaces = Int64[np.ndarray, " F"]

BLOCK = 4  # grid points along a side of a block, which is classified at once if no surface crosses it (guess)
MOST_BLOCKS = 1 << 19  # of the sampling grid; bounds memory if a few small bodies lie far apart (guess)
SPECK = 0.002  # share of all samples below which a component is noise (guess)
SHEET = 0.05  # interior samples per area h^2 below which a component is a sheet, h the samples' distance (guess)


@dataclass(frozen=True, slots=True)
class Samples:
    """N points in the volume of a mesh, each with the body it belongs to; specks are not sampled."""

    points: Points
    bodies: Labels  # 0, 1, ..., largest volume first


def interior_samples(mesh: Mesh, count: int, generator: np.random.Generator) -> Samples:
    """Sample the volume of a mesh that has faces at about `count` points, one per equal cell, jittered by `generator`.

    Bodies are the connected components of the surface; one that lies inside another is a part of it.
    """
    solid = Mesh(mesh.vertices, mesh.faces[face_normals(mesh)[1] > 0])  # zero areas break the winding number's tree
    if solid.is_empty:
        return Samples(mesh.vertices[np.unique(mesh.faces)], np.zeros(len(np.unique(mesh.faces)), np.int64))
    area, parts = face_normals(solid)[1].sum(), _parts(solid)
    if (spacing := _spacing(solid, count, generator)) > 0:
        points = _inside_grid(solid, spacing, generator)
    else:
        points, spacing = np.zeros((0, 3)), float(np.sqrt(area / count))
    if parts.max() == 0 and len(points) >= SHEET * area / spacing**2:
        return Samples(points, np.zeros(len(points), np.int64))
    labels = parts[Surface(solid).closest(points).faces] if len(points) else np.zeros(0, np.int64)
    points, labels = _with_sheets(solid, parts, points, labels, spacing)
    sizes = np.bincount(labels)
    order = np.argsort(-sizes, kind="stable")
    large = order[: max(1, int((sizes > SPECK * len(points)).sum()))]
    rank = np.full(len(sizes), -1)  # of specks
    rank[large] = np.arange(len(large))
    bodies = rank[labels]
    return Samples(points[bodies >= 0], bodies[bodies >= 0])


def winding_inside(mesh: Mesh, queries: Points) -> Bool[np.ndarray, " N"]:
    """Return whether each query lies inside the mesh: |winding number| > 1/2, whatever the faces' orientation."""
    return np.abs(winding_numbers(mesh, queries)) > 0.5


def winding_numbers(mesh: Mesh, queries: Points) -> Float64[np.ndarray, " N"]:
    """Return the winding number of the mesh around each query: inside, 1 if faces point outward and -1 if inward.

    All faces must have an area above 0.
    """
    import igl

    if len(queries) == 0 or mesh.is_empty:  # without faces igl reads behind its arrays
        return np.zeros(len(queries))
    return np.atleast_1d(igl.fast_winding_number(mesh.vertices, mesh.faces.astype(np.int64), queries))


def _spacing(mesh: Mesh, count: int, generator: np.random.Generator) -> float:
    """Return the cell side at which about `count` cells fall inside; 0 if a pilot grid finds no interior."""
    low, size = mesh.vertices.min(axis=0), np.ptp(mesh.vertices, axis=0)
    for pilot in (16_384, 131_072):
        if size.min() <= 0:
            return 0.0
        step = rounded(float(size.prod() / pilot) ** (1 / 3))
        shape = np.maximum(np.ceil(size / step), 1).astype(np.int64)
        grid = np.indices(tuple(shape)).reshape(3, -1).T
        inside = winding_inside(mesh, low + (grid + generator.random(grid.shape)) * (size / shape))
        if inside.sum() >= 200:
            break
    cells = count / inside.mean() if inside.any() else np.inf
    return rounded(float(size.prod() / min(cells, MOST_BLOCKS * BLOCK**3)) ** (1 / 3)) if inside.any() else 0.0


def _inside_grid(mesh: Mesh, spacing: float, generator: np.random.Generator) -> Points:
    """Return the jittered grid points inside the mesh; blocks far from the surface are classified as a whole."""
    low, side = mesh.vertices.min(axis=0), BLOCK * spacing
    shape = np.floor(np.ptp(mesh.vertices, axis=0) / side).astype(np.int64) + 1
    centers = low + (np.indices(tuple(shape)).reshape(3, -1).T + 0.5) * side
    near = _touched((mesh.vertices[mesh.faces] - low) / side, shape)
    winding = np.zeros(len(centers))
    winding[~near] = np.abs(winding_numbers(mesh, centers[~near]))
    near |= np.abs(winding - 0.5) < 0.3  # in the mouth of a hole it changes smoothly, without a surface
    offsets = (np.indices((BLOCK,) * 3).reshape(3, -1).T - BLOCK / 2) * spacing
    points = (centers[near | (winding > 0.5), None] + offsets).reshape(-1, 3)
    points += generator.random(points.shape) * spacing
    unsure = np.repeat(near[near | (winding > 0.5)], BLOCK**3)
    keep = ~unsure
    keep[unsure] = winding_inside(mesh, points[unsure])
    return points[keep]


def _touched(places: Float64[np.ndarray, "F 3 3"], shape: Int64[np.ndarray, " 3"]) -> Bool[np.ndarray, " B"]:
    """Return a mask of the blocks that any face's bounding box meets; `places` of the corners are in blocks."""
    corners = np.floor(places).astype(np.int64)
    first, last = corners.min(axis=1), corners.max(axis=1)
    touched = np.zeros(tuple(shape), dtype=bool)
    small = (last - first).max(axis=1) <= 1
    for corner in np.indices((2, 2, 2)).reshape(3, -1).T:
        touched[tuple(np.where(corner, last[small], first[small]).T)] = True
    for a, b in zip(first[~small], last[~small] + 1, strict=True):
        touched[a[0] : b[0], a[1] : b[1], a[2] : b[2]] = True
    return touched.reshape(-1)


def _parts(mesh: Mesh) -> OfFaces:
    """Label each face with its body: its connected component, or the component that encloses it."""
    labels = connected_faces(mesh.faces, len(mesh.vertices))
    if labels.max() > 0:  # UV seams look like gaps until equal positions are welded
        welded = weld(mesh)
        if len(welded.faces) == len(mesh.faces):
            labels = connected_faces(welded.faces, len(welded.vertices))
    labels = np.unique(labels, return_inverse=True)[1].reshape(-1)
    areas = np.bincount(labels, face_normals(mesh)[1])
    large = np.flatnonzero(areas > SPECK * areas.sum())
    for inner in large if len(large) > 1 else ():
        corner = mesh.vertices[mesh.faces[np.argmax(labels == inner), :1]]
        for outer in large[areas[large] > areas[inner]]:
            if winding_inside(Mesh(mesh.vertices, mesh.faces[labels == outer]), corner)[0]:
                labels[labels == inner] = outer
                break
    return labels


def _with_sheets(
    mesh: Mesh, parts: OfFaces, points: Points, labels: Labels, spacing: float
) -> tuple[Float64[np.ndarray, "S 3"], Int64[np.ndarray, " S"]]:
    """Add samples on the surface of parts that enclose almost no volume."""
    areas = np.bincount(parts, face_normals(mesh)[1])
    sheet = np.bincount(labels, minlength=len(areas)) < SHEET * areas / spacing**2
    weights = face_normals(mesh)[1] * sheet[parts]
    count = int(weights.sum() / spacing**2)
    if count == 0 and len(points):
        return points, labels
    count, total = max(count, 1), np.cumsum(weights)
    faces = np.searchsorted(total, (np.arange(count) + 0.5) * total[-1] / count)
    # Inside a face, points follow a low-discrepancy pattern (R2, M. Roberts 2018).
    u, v = np.mod(np.arange(1, count + 1)[:, None] * np.array([0.7548776662466927, 0.5698402909980532]), 1).T
    flip = u + v > 1
    u, v = np.where(flip, 1 - u, u), np.where(flip, 1 - v, v)
    a, b, c = np.moveaxis(mesh.vertices[mesh.faces[faces]], 1, 0)
    more = a + u[:, None] * (b - a) + v[:, None] * (c - a)
    return np.concatenate([points, more]), np.concatenate([labels, parts[faces]])
