"""Counts of wrong triangles: those that bridge bodies which are separate in the original frame, and slivers."""

from __future__ import annotations

import numpy as np
from jaxtyping import Int64

from meshreel.geometry.closest_points import Surface
from meshreel.geometry.topology import components, drop_unreferenced, face_normals, weld
from meshreel.types import Mesh


def count_degenerate(mesh: Mesh) -> int:
    """Faces with less than a thousandth of the median area."""
    areas = face_normals(mesh)[1]
    return int((areas < 1e-3 * np.median(areas)).sum()) if len(areas) else 0


def count_bridges(original: Mesh, decoded: Mesh) -> int:
    """Faces of `decoded` that join vertices nearest to different connected components of `original`."""
    whole = drop_unreferenced(weld(original))
    if whole.is_empty or decoded.is_empty:
        return 0
    bodies = components(whole.faces, len(whole.vertices))
    if bodies.max() == 0:
        return 0
    corners = _nearest_body(whole, bodies, decoded)[decoded.faces]
    return int((corners != corners[:, :1]).any(axis=1).sum())


def _nearest_body(whole: Mesh, bodies: Int64[np.ndarray, " W"], decoded: Mesh) -> Int64[np.ndarray, " V"]:
    """For each decoded vertex, the component of the original whose surface is nearest."""
    middle = whole.vertices.mean(axis=0)  # closest points are found in float32
    surface = Surface(Mesh.of(whole.vertices - middle, whole.faces))
    return bodies[whole.faces[surface.closest(decoded.vertices - middle).faces, 0]]
