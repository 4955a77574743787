"""Signed distances of a mesh on a sparse grid of blocks: 8^3 cells with the 9^3 voxels at their corners.

The sign is that of the closest feature's pseudonormal (Baerentzen and Aanaes 2005), right for every closed mesh. Past a
mesh's border it is that of the border's plane, and soon unknown, unless the mesh is closed but for holes: then winding
numbers tell.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float64, Int64

from meshreel.geometry.closest_points import Hits, Surface
from meshreel.geometry.inside import winding_inside
from meshreel.geometry.topology import clean, unique_edges, weld
from meshreel.geometry.voxels import Lattice, around, distinct, spread
from meshreel.types import Mesh

SIDE = 8  # cells of a block along an axis
POINTS = SIDE + 1  # voxels
VOLUME = POINTS**3
OFFSETS = np.indices((POINTS,) * 3).reshape(3, -1).T  # of a block's voxels, in the order of its values
_CELLS, _BLOCKS = Lattice(np.zeros(3), 1.0), Lattice(np.zeros(3), float(SIDE))
_FEATURE = 1e-3  # a barycentric weight below it is on an edge
_CROSSED = 1.2  # distances at an edge's ends sum up to at most its length where the surface crosses it: 1, and rounding
_ASIDE = 1.0  # voxels past a border beyond which nothing is known
_ASKED, _ALIKE = 4000, 0.98  # voxels whose winding numbers are looked at; the share of them that must agree
_CHUNK = 1 << 20  # voxels whose distances are looked for at once
_Values = Float64[np.ndarray, " N"]
_Mask = Bool[np.ndarray, "B N"]


@dataclass(frozen=True, slots=True)
class Blocks:
    """Blocks that hold surface, and the distances at their voxels."""

    places: Int64[np.ndarray, "B 3"]  # in blocks, sorted by place
    values: Float64[np.ndarray, "B N"]  # voxels, positive outside
    known: _Mask  # false past a border, and where signs contradict each other
    near: _Mask  # ends of an edge that the surface crosses


def prepared(mesh: Mesh) -> Mesh:
    """Return the mesh welded and without faces of zero area, which have no sign."""
    return clean(weld(mesh))


def sample(mesh: Mesh) -> Blocks:
    """The blocks of a prepared mesh in voxel units that its surface passes through."""
    if mesh.is_empty:
        none = np.zeros((0, VOLUME), bool)
        return Blocks(np.zeros((0, 3), np.int64), np.zeros((0, VOLUME)), none, none)
    cells = around(distinct(_CELLS.keys(spread(mesh, 1.0)[0])))  # beside the surface
    places = _BLOCKS.cells(distinct(_BLOCKS.keys(_CELLS.centers(cells))))
    keys, index = voxel_index(places)
    values, known = signed_distances(mesh, _CELLS.cells(keys).astype(np.float64))
    values, known = values[index], known[index]
    near, phantom = _crossings(values, known)
    active = near.any(axis=1)
    return Blocks(places[active], values[active], (known & ~phantom)[active], near[active])


def voxel_index(places: Int64[np.ndarray, "B 3"]) -> tuple[Int64[np.ndarray, " U"], Int64[np.ndarray, "B N"]]:
    """The keys of the different voxels of blocks, sorted, and the number of each block's voxels among them."""
    voxels = (SIDE * places[:, None, :] + OFFSETS).reshape(-1, 3)
    keys, index = np.unique(_CELLS.keys(voxels + 0.5), return_inverse=True)
    return keys, index.reshape(len(places), VOLUME)


def block_keys(places: Int64[np.ndarray, "B 3"]) -> Int64[np.ndarray, " B"]:
    """Keys that order blocks, or cells, by their place."""
    return _CELLS.keys(places + 0.5)


def signed_distances(mesh: Mesh, points: Float64[np.ndarray, "N 3"]) -> tuple[_Values, Bool[np.ndarray, " N"]]:
    """Return distances in the unit of the mesh, positive outside, and a mask of those whose sign is known."""
    surface, normals = Surface(mesh), _Normals(mesh)
    values, known, past = np.empty(len(points)), np.ones(len(points), bool), np.zeros(len(points), bool)
    for start in range(0, len(points), _CHUNK):
        part = slice(start, start + _CHUNK)
        hits = surface.closest(points[part])
        away = points[part] - hits.points
        distance = np.linalg.norm(away, axis=1)
        along = np.einsum("nd,nd->n", away, surface.normals[hits.faces])
        side = np.einsum("nd,nd->n", away, normals.at(hits))
        beyond = surface.past_border(hits)
        aside = np.sqrt(np.maximum(distance**2 - along**2, 0))
        values[part] = np.where(beyond, np.copysign(distance, along), np.copysign(distance, side))
        known[part] = ~beyond | (aside <= _ASIDE)
        past[part] = beyond
    if past.any() and _is_nearly_closed(mesh, points[~past], values[~past]):
        values[past] = np.where(winding_inside(mesh, points[past]), -1.0, 1.0) * np.abs(values[past])
        known[:] = True
    return values, known


def _is_nearly_closed(mesh: Mesh, points: Float64[np.ndarray, "N 3"], values: _Values) -> bool:
    """Return whether winding numbers agree with the signs near the surface."""
    near = np.flatnonzero(np.abs(values) < 1)
    some = near[:: max(len(near) // _ASKED, 1)]
    return bool((winding_inside(mesh, points[some]) == (values[some] < 0)).sum() > _ALIKE * len(some))


class _Normals:
    """Pseudonormals of the faces, edges and vertices of a mesh."""

    def __init__(self, mesh: Mesh) -> None:
        self._mesh, (edges, self._edges) = mesh, unique_edges(mesh.faces)
        corners = mesh.vertices[mesh.faces]
        onward = np.roll(corners, -1, axis=1) - corners
        back = -np.roll(onward, 1, axis=1)
        turns, dots = np.cross(onward, back), np.einsum("fkd,fkd->fk", onward, back)
        lengths = np.linalg.norm(turns, axis=2)
        self._faces, angles = turns[:, 0] / lengths[:, :1], np.arctan2(lengths, dots)
        self._at_edges = _summed(self._edges, np.repeat(self._faces[:, None], 3, axis=1), len(edges))
        self._at_vertices = _summed(mesh.faces, self._faces[:, None] * angles[:, :, None], len(mesh.vertices))

    def at(self, hits: Hits) -> Float64[np.ndarray, "N 3"]:
        """The pseudonormal at each closest point; not of unit length."""
        found = self._faces[hits.faces]
        for opposite in range(3):
            on = hits.barycentric[:, opposite] < _FEATURE
            found[on] = self._at_edges[self._edges[hits.faces[on], (opposite + 1) % 3]]
        for corner in range(3):
            on = hits.barycentric[:, corner] > 1 - _FEATURE
            found[on] = self._at_vertices[self._mesh.faces[hits.faces[on], corner]]
        return found


def _summed(index: np.ndarray, vectors: Float64[np.ndarray, "F 3 3"], count: int) -> Float64[np.ndarray, "K 3"]:
    flat = index.reshape(-1)
    return np.stack([np.bincount(flat, vectors[..., axis].reshape(-1), count) for axis in range(3)], axis=1)


def _crossings(values: Float64[np.ndarray, "B N"], known: _Mask) -> tuple[_Mask, _Mask]:
    """Return masks of voxels at edges that the surface crosses, and of those whose sign changes only far from it."""
    shape = (len(values), POINTS, POINTS, POINTS)
    values, known = values.reshape(shape), known.reshape(shape)
    near, phantom = np.zeros(shape, bool), np.zeros(shape, bool)
    for axis in range(1, 4):
        v, k, n, p = (np.moveaxis(each, axis, 0) for each in (values, known, near, phantom))  # views
        changes = ((v[:-1] < 0) != (v[1:] < 0)) & k[:-1] & k[1:]
        real = np.abs(v[:-1]) + np.abs(v[1:]) <= _CROSSED
        for end in (slice(None, -1), slice(1, None)):
            n[end] |= changes & real
            p[end] |= changes & ~real
    return near.reshape(len(values), -1), (phantom & ~near).reshape(len(values), -1)
