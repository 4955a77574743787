"""A person whose arms, crossed before the chest, open: one surface, with own faces in each frame; and the truth.

`arms_body` is the truth of a frame: `implicit.field` of it is the signed distance of places from the surface; its
capsules are the same in all frames, so that `carried` tells where a place of the surface is in another one.
"""

import numpy as np
from jaxtyping import Float64
from scipy.spatial.transform import Rotation

from meshreel.capture.simulated.figure import Pose, figure
from meshreel.capture.simulated.implicit import Body, capsule, polygonize
from meshreel.capture.simulated.procedural import grid_of_frame
from meshreel.geometry.closest_points import Surface
from meshreel.geometry.topology import face_normals
from meshreel.types import Mesh

FRAMES, OPENING = 36, (3, 30)  # of the whole, and those between which the arms open
TOUCH = 0.01  # m, of `polygonize`: there is one body only
CROSSED, OPENED = ((-0.09, 1.20, 0.215), (0.10, 1.17, 0.15)), ((0.5, 1.12, 0.2), (-0.5, 1.12, 0.2))  # m: both wrists
UNMATCHED = 0.01  # m from the truth
Points = Float64[np.ndarray, "_ 3"]


def arms(number: int, spacing: float = 0.014) -> Mesh:
    """The mesh of a frame: 13k vertices, fewer where the spacing of the grid, m, is wider."""
    return polygonize((arms_body(number, spacing),), TOUCH, grid_of_frame(number, spacing, 0))


def arms_body(number: int, spacing: float = 0.014) -> Body:
    """The capsules of a frame. Forearms touch each other and the chest up to frame 14 or so."""
    share = np.clip((number - OPENING[0]) / (OPENING[1] - OPENING[0]), 0, 1)
    share = share * share * (3 - 2 * share)
    around = 4 * share * (1 - share) * np.array([0.0, -0.03, 0.14])  # each other
    left, right = (1 - share) * np.array(CROSSED) + share * np.array(OPENED) + around
    return figure(Pose(np.zeros(3), 0.0, wrists=(left, right), reach=(1.0, 1.0)), 0.7 * spacing)


def carried(points: Points, before: Body, after: Body) -> Points:
    """Where places are in another frame: each moves with the capsule whose surface is nearest."""
    nearest, moved = np.full(len(points), np.inf), points.copy()
    for here, there in zip(before, after, strict=True):
        for row, radii in enumerate(here.radii):
            start, end = here.starts[row], here.ends[row]
            gap = capsule(points, start, end, radii)
            turn = Rotation.align_vectors(there.ends[row] - there.starts[row], end - start)[0]
            nearer = gap < nearest
            nearest[nearer], moved[nearer] = gap[nearer], there.starts[row] + turn.apply(points[nearer] - start)
    return moved


def stray_share(truth: Mesh, mesh: Mesh) -> float:
    """The share of a mesh's faces that are flipped, against the closest face of the truth, or unmatched there."""
    surface, middles = Surface(truth), mesh.vertices[mesh.faces].mean(axis=1)
    hits = surface.closest(middles)
    flipped = (face_normals(mesh)[0] * surface.normals[hits.faces]).sum(axis=1) < 0
    return float((flipped | (np.linalg.norm(hits.points - middles, axis=1) > UNMATCHED)).mean())
