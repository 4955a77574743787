"""NumPy's formulas of connectivity, which the core's loops replace: the plain statement of what they compute."""

import numpy as np

from meshreel.types import Mesh


def unique_edges(faces):
    pairs = np.sort(np.stack([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]], axis=1).reshape(-1, 2), axis=1)
    edges, inverse = np.unique(pairs, axis=0, return_inverse=True)
    return edges, inverse.reshape(-1, 3)


def face_normals(mesh):
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    x, y, z = np.cross(b - a, c - a).T
    length = np.sqrt(x**2 + y**2 + z**2)
    return np.stack([x, y, z], axis=1) / np.where(length > 0, length, 1.0)[:, None], length / 2


def vertex_normals(mesh):
    normals, areas = face_normals(mesh)
    weighted, total = normals * areas[:, None], np.zeros((len(mesh.vertices), 3))
    for corner in range(3):
        for axis in range(3):
            total[:, axis] += np.bincount(mesh.faces[:, corner], weighted[:, axis], len(mesh.vertices))
    length = np.sqrt(total[:, 0] ** 2 + total[:, 1] ** 2 + total[:, 2] ** 2)
    return total / np.where(length > 0, length, 1.0)[:, None]


def blend(values, corners, weights):
    a, b, c = (values[corners[:, k]] for k in range(3))
    u, v, w = (weights[:, k, None] for k in range(3))
    return u * a + v * b + w * c


def face_means(values, faces):
    a, b, c = (values[faces[:, k]] for k in range(3))
    return (a + b + c) / 3


def weld(mesh):
    _, first, inverse = np.unique(mesh.vertices, axis=0, return_index=True, return_inverse=True)
    order = np.argsort(first)  # keep the order of first appearance
    rank = np.empty_like(order)
    rank[order] = np.arange(len(order))
    faces = rank[inverse.reshape(-1)][mesh.faces]
    return Mesh.of(mesh.vertices[first[order]], faces[~_collapsed(faces)])


def clean(mesh):
    faces = mesh.faces[~_collapsed(mesh.faces)]
    faces = faces[face_normals(Mesh.of(mesh.vertices, faces))[1] > 0]
    _, first = np.unique(np.sort(faces, axis=1), axis=0, return_index=True)
    return drop_unreferenced(Mesh.of(mesh.vertices, faces[np.sort(first)]))


def drop_unreferenced(mesh):
    used = np.zeros(len(mesh.vertices), dtype=bool)
    used[mesh.faces.reshape(-1)] = True
    return Mesh.of(mesh.vertices[used], (np.cumsum(used) - 1)[mesh.faces])


def _collapsed(faces):
    a, b, c = faces.T
    return (a == b) | (b == c) | (c == a)
