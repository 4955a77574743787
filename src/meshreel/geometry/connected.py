"""Connected pieces of large meshes by SciPy (`encode`): what topology.components gives, a tenth of the time."""

from __future__ import annotations

import numpy as np
from jaxtyping import Int32, Int64

from ..types import Mesh
from .topology import face_normals, part_of


def connected(faces: Int32[np.ndarray, "F 3"], count: int) -> Int64[np.ndarray, " V"]:
    """A label 0, 1, ... for each of `count` vertices: the connected component, in order of its first vertex."""
    from scipy.sparse import csr_array
    from scipy.sparse.csgraph import connected_components

    if count == 0:
        return np.zeros(0, np.int64)
    ends = np.concatenate([faces[:, 1], faces[:, 2]])
    graph = csr_array((np.ones(len(ends), bool), (np.tile(faces[:, 0], 2), ends)), shape=(count, count))
    return connected_components(graph, directed=False)[1].astype(np.int64)


def connected_faces(faces: Int32[np.ndarray, "F 3"], count: int) -> Int64[np.ndarray, " F"]:
    """The label of each face's component of `count` vertices; not all labels are of a face."""
    return connected(faces, count)[faces[:, 0]]


def without_fragments(mesh: Mesh, least: float) -> Mesh:
    """The mesh without connected pieces of less area, m^2."""
    if mesh.is_empty:
        return mesh
    labels = connected_faces(mesh.faces, len(mesh.vertices))
    areas = np.bincount(labels, face_normals(mesh)[1])
    return part_of(mesh, areas[labels] >= least)
