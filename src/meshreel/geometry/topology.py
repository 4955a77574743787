"""Connectivity of triangle meshes: edges, components, welding, normals and midpoint subdivision.

Pure array functions on vertices (V x 3) and faces (F x 3), without heavy imports: the decoder uses this file.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..shapes import Bool, Float64, Int32, Int64
from ..types import Mesh


def unique_edges(faces: Int32[np.ndarray, "F 3"]) -> tuple[Int64[np.ndarray, "E 2"], Int64[np.ndarray, "F 3"]]:
    """Return the undirected edges (i < j, sorted) and, for each face, the numbers of its edges 01, 12 and 20."""
    f = faces.astype(np.int64)
    pairs = np.sort(np.stack([f[:, [0, 1]], f[:, [1, 2]], f[:, [2, 0]]], axis=1).reshape(-1, 2), axis=1)
    count = int(pairs.max()) + 1 if len(pairs) else 1
    keys, inverse = np.unique(pairs[:, 0] * count + pairs[:, 1], return_inverse=True)
    return np.stack([keys // count, keys % count], axis=1), inverse.reshape(-1, 3)


def border_mask(edges: Int64[np.ndarray, "E 2"], face_edges: Int64[np.ndarray, "F 3"]) -> Bool[np.ndarray, " E"]:
    """Return which of the `unique_edges` belong to one face only."""
    return np.bincount(face_edges.reshape(-1), minlength=len(edges)) == 1


def border_edges(mesh: Mesh) -> Int64[np.ndarray, "B 2"]:
    """Return the edges that belong to one face only; a closed mesh has none."""
    edges, face_edges = unique_edges(mesh.faces)
    return edges[border_mask(edges, face_edges)]


def edge_lengths(mesh: Mesh) -> Float64[np.ndarray, " E"]:
    """Return the length of each of the `unique_edges`, in the unit of the vertices."""
    ends = mesh.vertices[unique_edges(mesh.faces)[0]]
    return np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1)


def subdivide_midpoint(mesh: Mesh, levels: int = 1) -> Mesh:
    """Cut each triangle into four at its edge midpoints, `levels` times (paper, section 3.3.2).

    Old vertices come first, in order; new ones follow in the order of the sorted edges.
    """
    for _ in range(levels if len(mesh.faces) else 0):
        edges, face_edges = unique_edges(mesh.faces)
        e = (face_edges + len(mesh.vertices)).astype(np.int32)
        a, b, c = mesh.faces.T
        faces = np.stack(
            [
                np.stack([a, e[:, 0], e[:, 2]], axis=1),
                np.stack([e[:, 0], b, e[:, 1]], axis=1),
                np.stack([e[:, 2], e[:, 1], c], axis=1),
                np.stack([e[:, 0], e[:, 1], e[:, 2]], axis=1),
            ],
            axis=1,
        ).reshape(-1, 3)
        midpoints = (mesh.vertices[edges[:, 0]] + mesh.vertices[edges[:, 1]]) / 2
        mesh = Mesh.of(np.concatenate([mesh.vertices, midpoints]), faces)
    return mesh


def face_normals(mesh: Mesh) -> tuple[Float64[np.ndarray, "F 3"], Float64[np.ndarray, " F"]]:
    """Return unit normals and areas (squared units of the vertices) of the faces; a zero area has a zero normal."""
    axes = [np.ascontiguousarray(axis) for axis in mesh.vertices.T]  # axis by axis: half the time, the same sums
    a, b, c = (np.ascontiguousarray(corner) for corner in mesh.faces.T)
    (ux, uy, uz), (vx, vy, vz) = ([axis[to] - axis[a] for axis in axes] for to in (b, c))
    cross = (uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx)
    length = np.sqrt(cross[0] ** 2 + cross[1] ** 2 + cross[2] ** 2)
    divisor = np.where(length > 0, length, 1.0)
    return np.stack([along / divisor for along in cross], axis=1), length / 2


def blend(
    values: Float64[np.ndarray, "V 3"], corners: Int32[np.ndarray, "N 3"], weights: Float64[np.ndarray, "N 3"]
) -> Float64[np.ndarray, "N 3"]:
    """Values of vertices inside faces that are given by their three corners, by barycentric weights."""
    a, b, c = (np.ascontiguousarray(corner) for corner in corners.T)
    u, v, w = (np.ascontiguousarray(weight) for weight in weights.T)
    axes = (np.ascontiguousarray(axis) for axis in values.T)  # one by one: no N x 3 x 3 numbers in memory
    return np.stack([u * axis[a] + v * axis[b] + w * axis[c] for axis in axes], axis=1)


def vertex_normals(mesh: Mesh) -> Float64[np.ndarray, "V 3"]:
    """Return area-weighted unit normals of the vertices; zero where a vertex has no face with an area."""
    normals, areas = face_normals(mesh)
    weighted = normals * areas[:, None]
    total = np.zeros((len(mesh.vertices), 3))
    for corner in range(3):
        for axis in range(3):
            total[:, axis] += np.bincount(mesh.faces[:, corner], weighted[:, axis], len(mesh.vertices))
    length = np.linalg.norm(total, axis=1)
    return total / np.where(length > 0, length, 1.0)[:, None]


def vertex_areas(mesh: Mesh) -> Float64[np.ndarray, " V"]:
    """Return a third of the area of each vertex's faces, in squared units of the vertices."""
    thirds = np.repeat(face_normals(mesh)[1] / 3, 3)
    return np.bincount(mesh.faces.reshape(-1), thirds, len(mesh.vertices))


def weld(mesh: Mesh) -> Mesh:
    """Merge vertices at exactly equal positions and drop the faces that collapse.

    UV seams duplicate positions; codecs and normals need them to be one vertex.
    """
    if len(mesh.vertices) == 0:
        return mesh
    _, first, inverse = np.unique(mesh.vertices, axis=0, return_index=True, return_inverse=True)
    order = np.argsort(first)  # keep the order of first appearance
    rank = np.empty_like(order)
    rank[order] = np.arange(len(order))
    faces = rank[inverse.reshape(-1)][mesh.faces]
    return Mesh.of(mesh.vertices[first[order]], faces[~_collapsed(faces)])


def clean(mesh: Mesh) -> Mesh:
    """Remove collapsed, zero-area and repeated faces, then vertices that no face uses."""
    faces = mesh.faces[~_collapsed(mesh.faces)]
    faces = faces[face_normals(Mesh.of(mesh.vertices, faces))[1] > 0]
    _, first = np.unique(np.sort(faces, axis=1), axis=0, return_index=True)
    return drop_unreferenced(Mesh.of(mesh.vertices, faces[np.sort(first)]))


def drop_unreferenced(mesh: Mesh) -> Mesh:
    """Remove vertices that no face uses; the others keep their order."""
    used = np.zeros(len(mesh.vertices), dtype=bool)
    used[mesh.faces.reshape(-1)] = True
    return Mesh.of(mesh.vertices[used], (np.cumsum(used) - 1)[mesh.faces])


def part_of(mesh: Mesh, chosen: Bool[np.ndarray, " F"]) -> Mesh:
    """Return the mesh of the chosen faces and the vertices that they use."""
    return drop_unreferenced(Mesh(mesh.vertices, mesh.faces[chosen]))


def with_neighbours(faces: Int32[np.ndarray, "F 3"], chosen: Bool[np.ndarray, " F"]) -> Bool[np.ndarray, " F"]:
    """Return the chosen faces and all faces that share a vertex with one of them."""
    touched = np.zeros(int(faces.max(initial=-1)) + 1, bool)
    touched[faces[chosen]] = True
    return touched[faces].any(axis=1)


def concatenate(meshes: Sequence[Mesh]) -> Mesh:
    """Join meshes into one, vertices and faces in order; if only one has vertices, it is returned itself."""
    meshes = [mesh for mesh in meshes if len(mesh.vertices)] or list(meshes[:1])
    if len(meshes) <= 1:
        return meshes[0] if meshes else Mesh.empty()
    vertices = np.empty((sum(len(mesh.vertices) for mesh in meshes), 3))
    faces = np.empty((sum(len(mesh.faces) for mesh in meshes), 3), np.int32)
    v = f = 0
    for mesh in meshes:
        vertices[v : v + len(mesh.vertices)] = mesh.vertices
        np.add(mesh.faces, np.int32(v), out=faces[f : f + len(mesh.faces)])
        v, f = v + len(mesh.vertices), f + len(mesh.faces)
    return Mesh(vertices, faces)


def components(faces: Int32[np.ndarray, "F 3"], count: int) -> Int64[np.ndarray, " V"]:
    """Label each of `count` vertices with its connected component; components are numbered by their first vertex."""
    labels = np.arange(count)
    f = faces.astype(np.int64)
    while True:  # label propagation with pointer jumping: O(log V) rounds
        low = labels[f].min(axis=1) if len(f) else np.zeros(0, np.int64)
        new = labels.copy()
        for corner in range(3):
            np.minimum.at(new, f[:, corner], low)
            np.minimum.at(new, labels[f[:, corner]], low)
        new = new[new]
        if np.array_equal(new, labels):
            return np.unique(labels, return_inverse=True)[1].reshape(-1)
        labels = new


def _collapsed(faces: Int32[np.ndarray, "F 3"] | Int64[np.ndarray, "F 3"]) -> Bool[np.ndarray, " F"]:
    a, b, c = faces.T
    return (a == b) | (b == c) | (c == a)
