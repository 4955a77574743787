"""Decimation of meshes by quadric error metrics (paper, section 3.3.2; needs the extra `encode`).

Closed meshes are decimated by fast-simplification, open ones by the core, which holds borders in place.
"""

from __future__ import annotations

import threading

import numpy as np

from .. import _core
from ..errors import InputError
from ..types import Mesh
from . import work
from .topology import border_edges, clean

# Size of the bounding box's diagonal for fast-simplification, which stops at absolute errors: at 10, AGGRESSION 4
# reaches the target and loses nothing; at 1 and at 1000 it may not (guess).
CLOSED_DIAGONAL = 10.0
AGGRESSION = 4.0  # of fast-simplification; see CLOSED_DIAGONAL (guess)
BOUNDARY_WEIGHT = 10.0  # of planes on open borders relative to planes of faces (guess)
ROUGHLY = 5  # times the wanted vertices, left by a first, quick pass: errors are those of one pass (decision 14)
ROUNDS = 3  # corrections of the number of faces: a collapse takes one face at a border and two elsewhere (guess)
_ONE_AT_A_TIME = threading.Lock()  # fast-simplification keeps its mesh in static variables


def decimate(mesh: Mesh, vertices: int, border: float = BOUNDARY_WEIGHT) -> Mesh:
    """Decimate a mesh to about `vertices` vertices, within 2 % where possible, and clean it.

    A mesh that has no more vertices is only cleaned. `border` weighs the planes that stand on open borders against
    those of the faces.
    """
    if vertices < 4:
        raise InputError(f"vertices is {vertices}: give at least 4, the corners of the smallest solid")
    mesh = clean(mesh)
    if len(mesh.vertices) <= vertices or mesh.diagonal == 0:
        return mesh
    work.count("decimations")
    if is_open := len(border_edges(mesh)) > 0:
        mesh = _roughly(mesh, ROUGHLY * vertices)
    faces = max(len(mesh.faces) - 2 * (len(mesh.vertices) - vertices), 4)
    for _ in range(ROUNDS):
        small = clean(_collapse_open(mesh, faces, border) if is_open else _collapse_closed(mesh, faces))
        excess = len(small.vertices) - vertices
        if abs(excess) <= 0.02 * vertices:
            break
        faces = min(max(faces - round(1.7 * excess), 4), len(mesh.faces))
    return small


def decimate_faces(mesh: Mesh, faces: int) -> Mesh:
    """Decimate a mesh to `faces` faces or a few less in one pass, and clean it.

    A mesh that has no more faces is only cleaned. Cheaper than `decimate`, which may take several passes: seconds for a
    scene of half a million faces.
    """
    if faces < 4:
        raise InputError(f"faces is {faces}: give at least 4, those of the smallest solid")
    mesh = clean(mesh)
    if len(mesh.faces) <= faces or mesh.diagonal == 0:
        return mesh
    work.count("decimations")
    if len(border_edges(mesh)):
        return clean(_collapse_open(_roughly(mesh, ROUGHLY * faces // 2), faces, BOUNDARY_WEIGHT))
    return clean(_collapse_closed(mesh, faces))


def _roughly(mesh: Mesh, vertices: int) -> Mesh:
    """Decimate a much finer mesh to about `vertices` vertices, regardless of its borders, in a tenth of the time."""
    if len(mesh.vertices) < 2 * vertices:
        return mesh
    rough = clean(_collapse_closed(mesh, 2 * vertices))
    return rough if len(rough.vertices) >= vertices // 2 else mesh  # many bits may be lost in one pass


def _collapse_closed(mesh: Mesh, faces: int) -> Mesh:
    import fast_simplification

    if faces >= len(mesh.faces):  # which it refuses
        return mesh
    scale, middle = CLOSED_DIAGONAL / mesh.diagonal, mesh.vertices.mean(axis=0)
    points = ((mesh.vertices - middle) * scale).astype(np.float32)
    with _ONE_AT_A_TIME:
        small, triangles = fast_simplification.simplify(points, mesh.faces, target_count=faces, agg=AGGRESSION)
    return Mesh.of(small.astype(np.float64) / scale + middle, triangles)


def _collapse_open(mesh: Mesh, faces: int, border: float) -> Mesh:
    middle = mesh.vertices.mean(axis=0)
    vertices, triangles = _core.decimate(mesh.vertices - middle, mesh.faces, faces, border)
    return Mesh(vertices + middle, triangles)
