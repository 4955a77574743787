"""Connected components of the faces of a mesh, and the mesh without small ones."""

from __future__ import annotations

import numpy as np
from jaxtyping import Int32, Int64

from ..types import Mesh
from .topology import components, face_normals, part_of


def connected_faces(faces: Int32[np.ndarray, "F 3"], count: int) -> Int64[np.ndarray, " F"]:
    """Label each face with its connected component; labels of vertices without faces do not occur."""
    return components(faces, count)[faces[:, 0]]


def without_fragments(mesh: Mesh, least: float) -> Mesh:
    """Remove connected components whose area is below `least`, m^2."""
    if mesh.is_empty:
        return mesh
    labels = connected_faces(mesh.faces, len(mesh.vertices))
    areas = np.bincount(labels, face_normals(mesh)[1])
    return part_of(mesh, areas[labels] >= least)
