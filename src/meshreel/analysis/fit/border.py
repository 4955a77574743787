"""Rows that pull the open borders of a template to those of a frame where the two run side by side.

In: border samples of both. Out: Rows. Point-to-plane rows leave the position across a border free: without these, a
template that is too small or too large at a rim (soles cut off at the floor, sleeves, the edge of a camera's view)
stays so, and those few vertices carry most of the error: 3.5 dB on a captured dancer.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int64
from scipy.spatial import cKDTree

from ...geometry.strict import exp
from ...geometry.topology import border_mask, face_normals, unique_edges
from ...types import Mesh
from .rows import Rows, no_rows

SAMPLES = 8  # per border edge: a guess; sliding along the border is free, so a finer search gains nothing


@dataclass(frozen=True, slots=True)
class Border:
    """Points along the open borders of a mesh, each with its face, corner weights and local frame."""

    points: Float64[np.ndarray, "N 3"]
    faces: Int64[np.ndarray, " N"]
    corners: Float64[np.ndarray, "N 3"]
    normals: Float64[np.ndarray, "N 3"]  # of the face
    outward: Float64[np.ndarray, "N 3"]  # in the face's plane, away from the surface


@dataclass(frozen=True, slots=True)
class BorderSides:
    """Border half-edges of a mesh, which no second face shares: the face of each, and the corner where it starts."""

    faces: Int64[np.ndarray, " E"]
    sides: Int64[np.ndarray, " E"]


def border_sides(faces: np.ndarray) -> BorderSides:
    """Find the border half-edges of some faces."""
    edges, of_faces = unique_edges(faces)
    at, sides = np.nonzero(border_mask(edges, of_faces)[of_faces])
    return BorderSides(at, sides)


def sample_border(mesh: Mesh, edges: BorderSides) -> Border:
    """Place `SAMPLES` evenly spaced points on each border edge, in order."""
    share = np.tile((np.arange(SAMPLES) + 0.5) / SAMPLES, len(edges.faces))
    faces, sides = np.repeat(edges.faces, SAMPLES), np.repeat(edges.sides, SAMPLES)
    corners = np.zeros((len(faces), 3))
    corners[np.arange(len(faces)), sides] = 1 - share
    corners[np.arange(len(faces)), (sides + 1) % 3] = share
    ends = mesh.vertices[mesh.faces[edges.faces]]
    pick = np.arange(len(edges.faces))
    along = ends[pick, (edges.sides + 1) % 3] - ends[pick, edges.sides]
    along /= np.maximum(np.linalg.norm(along, axis=1), 1e-300)[:, None]
    normals = face_normals(Mesh(mesh.vertices, mesh.faces[edges.faces]))[0]
    outward = np.cross(along, normals)  # counter-clockwise faces lie to the left of their edges
    points = np.einsum("nk,nkd->nd", corners, ends.repeat(SAMPLES, axis=0))
    return Border(points, faces, corners, normals.repeat(SAMPLES, axis=0), outward.repeat(SAMPLES, axis=0))


def match_borders(template: Border, frame: Border, gate: float, agreement: float) -> Rows:
    """Match the border samples of a template and a frame, both ways; no rows if either has no border.

    Pairs farther apart than `gate`, or whose normals or outward directions disagree, do not count.
    """
    if len(template.points) == 0 or len(frame.points) == 0:
        return no_rows()
    ahead = cKDTree(frame.points).query(template.points)[1]
    back = cKDTree(template.points).query(frame.points)[1]
    mine = np.concatenate([np.arange(len(ahead)), back])
    other = np.concatenate([ahead, np.arange(len(back))])
    gaps = template.points[mine] - frame.points[other]
    agree = np.einsum("nd,nd->n", template.outward[mine], frame.outward[other]) > agreement
    agree &= np.einsum("nd,nd->n", template.normals[mine], frame.normals[other]) > agreement
    distance = np.linalg.norm(gaps, axis=1) / gate
    keep = agree & (distance < 1)
    weights = exp(-2 * distance[keep] ** 2) / SAMPLES  # about one row per template edge and direction
    weights *= np.where(np.arange(len(mine)) < len(ahead), 1.0, len(ahead) / len(back))[keep]
    mine, other = np.tile(mine[keep], 2), np.tile(other[keep], 2)
    half = len(mine) // 2
    directions = np.concatenate([frame.outward[other[:half]], frame.normals[other[:half]]])
    values = np.einsum("nd,nd->n", directions, frame.points[other])
    return Rows(template.faces[mine], template.corners[mine], directions, values, np.tile(weights, 2))
