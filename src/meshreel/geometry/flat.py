"""Lays surface that is flat within its noise onto planes, so that a few faces hold it, and its edges are straight.

In: a mesh and the RMS distance by which its surface may be off. Out: where its vertices are then, and which moved.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float64, Int64

from ..types import Mesh
from .strict import eigen, norm
from .topology import connected_faces, edge_lengths, face_means, face_normals

RINGS = 6  # of faces around each, over which normals and places are averaged to find planes (guess)
NEAR_RINGS = 2  # of those that tell on which of two planes a face lies (guess)
ALIKE, SIMILAR = 0.95, 0.5  # least cosines between a plane's normal and those averages (guess)
OFF = 4.0  # times what is allowed, largest distance of a vertex from its plane (guess)
# Times what is allowed, the largest distance of the mean of the surface around a face from its plane, over `RINGS` and
# `NEAR_RINGS` (guess).
LEVEL, GROWN = 1.5, 2.0
# Times what is allowed, the largest RMS distance of a piece from its plane. Of what is much rougher, too, the part
# within `OFF` would be near: 1.8 times for a normal distribution of twice what is allowed.
SHARE = 1.5
ACROSS = 12  # usual edges, the width of the smallest piece (guess)
ROUNDS = 4  # of fitting a plane to what lies on it (guess)
TURNS = 8  # of laying a vertex onto each of its planes in turn (guess)
FADING, FADE = 12, 0.9  # rings of faces around planes that move with these, and how much from ring to ring (guess)
FULL = 0.25  # of the smallest piece, the least surface at one height in which a plane is looked for (guess)
CELL = 0.25  # of directions, in which surface that faces the same way is counted (guess)

Normals = Float64[np.ndarray, "F 3"]
Areas = Float64[np.ndarray, " F"]
Most = Float64[np.ndarray, " V"]


@dataclass(frozen=True, slots=True)
class _Planes:
    """Planes, and on which of them each face lies."""

    of_face: Int64[np.ndarray, " F"]  # -1 for none
    normals: Float64[np.ndarray, "P 3"]
    offsets: Float64[np.ndarray, " P"]

    def off(self, vertices: Float64[np.ndarray, "N 3"], numbers: Int64[np.ndarray, " N"]) -> Float64[np.ndarray, " N"]:
        """Return how far places are before these planes."""
        return np.einsum("nc,nc->n", vertices, self.normals[numbers]) - self.offsets[numbers]


def flattened(mesh: Mesh, most: Most) -> tuple[Mesh, Bool[np.ndarray, " V"]]:
    """Return a mesh whose flat pieces lie on planes, and which of its vertices do, on those that are near.

    A piece is connected surface that lies within `SHARE` times `most`, RMS, of a plane and faces its way. What is
    rough, curved or small is as it was.
    """
    if mesh.is_empty:
        return mesh, np.zeros(len(mesh.vertices), bool)
    lengths, middle = edge_lengths(mesh), mesh.vertices.mean(axis=0)
    local = mesh.at(mesh.vertices - middle)
    normals, areas = face_normals(local)
    of_face, found = np.full(len(areas), -1), list[tuple[np.ndarray, float]]()
    least = (ACROSS * float(np.median(lengths))) ** 2
    for faces, normal, offset in _pieces(local, normals, areas, most, least):
        of_face[faces] = len(found)
        found.append((normal, offset))
    if not found:
        return mesh, np.zeros(len(mesh.vertices), bool)
    planes = _Planes(of_face, np.stack([normal for normal, _ in found]), np.array([offset for _, offset in found]))
    smooth, places = _averaged(local, normals, areas, NEAR_RINGS), face_means(local.vertices, local.faces)
    _grow(local, planes, smooth, _means(local, places, NEAR_RINGS), most)
    vertices, moved = _moved(local, planes, most)
    return mesh.at(vertices + middle), moved


def _averaged(mesh: Mesh, normals: Normals, areas: Areas, rings: int) -> Normals:
    """Return the directions of the mean normals around each face."""
    sums = normals * (areas / max(areas.max(), 1e-300))[:, None]
    for _ in range(rings):
        sums = face_means(_at_vertices(mesh, sums) / 6, mesh.faces)  # usually six faces meet
    return sums / np.maximum(np.linalg.norm(sums, axis=1), 1e-300)[:, None]


def _means(mesh: Mesh, places: Normals, rings: int) -> Normals:
    """Return the middles of the surface around each face, which are as far from a plane as that is in the mean."""
    times = _times(mesh)
    for _ in range(rings):
        places = face_means(_at_vertices(mesh, places) / times, mesh.faces)
    return places


def _at_vertices(mesh: Mesh, values: Normals) -> Float64[np.ndarray, "V 3"]:
    """Return the sums of the values of the faces at each vertex."""
    corners = mesh.faces.T.reshape(-1)
    return np.stack([np.bincount(corners, np.tile(of, 3), len(mesh.vertices)) for of in values.T], axis=1)


def _times(mesh: Mesh) -> Int64[np.ndarray, "V 1"]:
    """Return how many faces meet at each vertex, at least 1."""
    return np.maximum(np.bincount(mesh.faces.reshape(-1), minlength=len(mesh.vertices)), 1)[:, None]


def _pieces(
    mesh: Mesh, normals: Normals, areas: Areas, most: Most, least: float
) -> Iterator[tuple[Int64[np.ndarray, " n"], Float64[np.ndarray, "3"], float]]:
    """Yield the faces of each flat piece, of the largest planes first, with the plane's normal and offset."""
    smooth, places = _averaged(mesh, normals, areas, RINGS), face_means(mesh.vertices, mesh.faces)
    level = _means(mesh, places, RINGS)  # noise averages out there, relief and bends do not
    allowed, side = face_means(np.repeat(most[:, None], 3, axis=1), mesh.faces)[:, 0], round(1 / CELL)
    cells = (np.rint(smooth / CELL).astype(np.int64) + side) @ ((2 * side + 1) ** np.arange(3))
    is_free = areas > 0
    free = np.flatnonzero(is_free)
    while len(free) and (share := np.bincount(cells[free], areas[free])).max() >= least:
        own = free[cells[free] == share.argmax()]
        normal = _mean(smooth[own], areas[own])
        height = _along(places[own], normal)
        step = 2 * OFF * float(np.median(allowed[own]))
        bins = np.rint((height - height.min()) / step).astype(np.int64)
        at_heights = np.bincount(bins, areas[own])
        if at_heights.max() < FULL * least:  # clutter
            is_free[own] = False
            free = np.flatnonzero(is_free)
            continue
        on, reach = own[bins == at_heights.argmax()], step
        is_free[on] = False  # whether or not a piece comes of it
        normal, offset = _plane(places[on], areas[on], normal)
        around = free[np.abs(_along(places[free], normal) - offset) <= 2 * step]
        for _ in range(ROUNDS):
            near = np.abs(_along(level[around], normal) - offset) <= np.maximum(reach, LEVEL * allowed[around])
            on, reach = around[near & (_along(smooth[around], normal) >= ALIKE)], 0.0
            if not len(on):
                break
            normal, offset = _plane(places[on], areas[on], normal)
        is_free[on] = False
        free = np.flatnonzero(is_free)
        pieces = connected_faces(mesh.faces[on], len(mesh.vertices))
        for piece in np.flatnonzero(np.bincount(pieces, areas[on]) >= least):
            found = on[pieces == piece]
            normal, offset = _plane(places[found], areas[found], normal)
            off = (_along(places[found], normal) - offset) / allowed[found]
            if (areas[found] * off**2).sum() <= SHARE**2 * areas[found].sum():
                yield found, normal, offset


def _along(vectors: Float64[np.ndarray, "N 3"], way: Float64[np.ndarray, "3"]) -> Float64[np.ndarray, " N"]:
    return np.einsum("nc,c->n", vectors, way)


def _mean(normals: Normals, areas: Areas) -> Float64[np.ndarray, "3"]:
    total = (normals * areas[:, None]).sum(axis=0)
    return total / max(norm(total), 1e-300)


def _plane(places: Normals, areas: Areas, normal: Float64[np.ndarray, "3"]) -> tuple[Float64[np.ndarray, "3"], float]:
    """Return the normal and the offset of the plane through places, on the side of a normal."""
    middle = (areas[:, None] * places).sum(axis=0) / areas.sum()
    away = places - middle
    _, vectors = eigen(np.einsum("n,ni,nj->ij", areas, away, away))
    found = vectors[:, 0] * (1.0 if (vectors[:, 0] * normal).sum() >= 0 else -1.0)
    return found, float((found * middle).sum())


def _grow(mesh: Mesh, planes: _Planes, smooth: Normals, level: Normals, most: Most) -> None:
    """Give faces beside a piece that lie near its plane to it, in place, ring by ring, to where two pieces meet."""
    for _ in range(2 * RINGS):
        on, rest = np.flatnonzero(planes.of_face >= 0), np.flatnonzero(planes.of_face < 0)
        of_vertex = np.full(len(mesh.vertices), -1)
        of_vertex[mesh.faces[on].T.reshape(-1)] = np.tile(planes.of_face[on], 3)
        beside = of_vertex[mesh.faces[rest]]
        rest, beside = rest[(beside >= 0).any(axis=1)], beside[(beside >= 0).any(axis=1)]
        grown = False
        for number in beside.T:
            takes = (planes.of_face[rest] < 0) & (number >= 0)
            takes &= np.einsum("nc,nc->n", smooth[rest], planes.normals[number]) >= SIMILAR
            takes &= np.abs(planes.off(level[rest], number)) <= GROWN * most[mesh.faces[rest]].mean(axis=1)
            for corner in mesh.faces[rest].T:
                takes &= np.abs(planes.off(mesh.vertices[corner], number)) <= OFF * most[corner]
            planes.of_face[rest[takes]] = number[takes]
            grown = grown or bool(takes.any())
        if not grown:
            return


def _moved(mesh: Mesh, planes: _Planes, most: Most) -> tuple[Float64[np.ndarray, "V 3"], Bool[np.ndarray, " V"]]:
    """Return the places of vertices, those of pieces on their planes where these are near, and which are there."""
    corners, numbers = mesh.faces.reshape(-1), np.repeat(planes.of_face, 3)
    number, corner = np.divmod(np.unique((numbers * len(mesh.vertices) + corners)[numbers >= 0]), len(mesh.vertices))
    near = np.abs(planes.off(mesh.vertices[corner], number)) <= OFF * most[corner]
    number, corner = number[near], corner[near]
    own = np.split(corner, np.searchsorted(number, np.arange(1, len(planes.offsets))))
    vertices = mesh.vertices.copy()
    for _ in range(TURNS):
        for chosen, normal, offset in zip(own, planes.normals, planes.offsets, strict=True):
            vertices[chosen] -= (_along(vertices[chosen], normal) - offset)[:, None] * normal
    laid = np.zeros(len(vertices), bool)
    laid[corner] = True
    ways = vertices - mesh.vertices
    laid &= np.linalg.norm(ways, axis=1) <= 2 * OFF * most
    return mesh.vertices + _faded(mesh, np.where(laid[:, None], ways, 0.0), laid), laid


def _faded(mesh: Mesh, ways: Float64[np.ndarray, "V 3"], laid: Bool[np.ndarray, " V"]) -> Float64[np.ndarray, "V 3"]:
    """Return the ways of vertices, with those around what is laid on planes: a step there would take many faces."""
    rest, times = np.flatnonzero(~laid), _times(mesh)
    for _ in range(FADING):
        sums = _at_vertices(mesh, face_means(ways, mesh.faces))
        ways[rest] = FADE * sums[rest] / times[rest]
    return ways
