"""Gap and overlap at the seam between decoded moving bodies and the decoded background.

A frame's mesh, its moving faces, and the decoded background and bodies of that frame -> a Seam; lengths are in m. The
cell is the median length of the frame's edges, so that nothing depends on scale or rotation.

- Seam: the border of the moving faces, where it comes within a cell of a still face.
- Gap, at a point of the seam: the width of the slit. From that point go to the closest point of the bodies, from there
  to the closest point of the background, and repeat both steps: the gap is the length of the last one. It is 0 where
  the parts meet or cross; where they overlap, it is the distance between the two surfaces.
- Overlap, at a point of the seam: the width over which bodies lie on the background, summed over both sides of the
  seam, at most `reach` on each. A body lies on the background where the closest point of the background is within a
  cell, not on its border, and has a normal within 45 degrees of the body's.
- Uncovered: the share of the frame's surface within `reach` of the seam that is farther than a cell from both parts.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Bool, Float64

from meshreel.errors import InputError
from meshreel.geometry.closest_points import Surface
from meshreel.geometry.topology import border_edges, edge_lengths, face_normals, part_of
from meshreel.geometry.voxels import spread
from meshreel.metrics.distance import quantile
from meshreel.types import Mesh

Row = dict[str, Any]
MM = 1000.0
_FINE = 8  # points per cell, along the seam and on the bodies (guess)
_SAME_WAY = math.cos(math.radians(45))  # least cosine between normals of surfaces that face the same way (guess)


@dataclass(frozen=True, slots=True)
class SeamOptions:
    """Cell and reach of the measurements at a seam."""

    cell: float | None = None  # m; None: the median length of the frame's edges
    reach: float = 4.0  # cells from the seam within which surface is examined

    def __post_init__(self) -> None:
        if not (0 < self.reach < math.inf and (self.cell is None or 0 < self.cell < math.inf)):
            raise InputError(f"seam: cell {self.cell}, reach {self.reach:g}: give above 0")


@dataclass(frozen=True, slots=True)
class Seam:
    """Seam of one frame, sampled at N points, each of which represents a part of its length."""

    points: Float64[np.ndarray, "N 3"]  # m
    lengths: Float64[np.ndarray, " N"]  # m
    gaps: Float64[np.ndarray, " N"]  # m; infinite where a part is empty
    overlaps: Float64[np.ndarray, " N"]  # m
    uncovered: float  # share of the surface near the seam

    def gap(self, share: float = 0.5) -> float:
        """Return the gap, m, that this share of the seam's length does not exceed."""
        return quantile(self.gaps, self.lengths, share)

    def overlap(self, share: float = 0.5) -> float:
        """Return the overlap, m, that this share of the seam's length does not exceed."""
        return quantile(self.overlaps, self.lengths, share)


def measure_seam(
    frame: Mesh, moves: Bool[np.ndarray, " F"], background: Mesh, bodies: Mesh, options: SeamOptions = SeamOptions()
) -> Seam | None:
    """Measure the seam of one frame; None if no moving surface is near a still one."""
    from scipy.spatial import cKDTree

    if moves.shape != (len(frame.faces),):
        raise InputError(f"{len(moves)} labels for {len(frame.faces)} faces: give one a face")
    if not moves.any() or moves.all():
        return None
    cell = float(np.median(edge_lengths(frame))) if options.cell is None else options.cell
    points, lengths = _border(part_of(frame, moves), cell) if cell > 0 else (np.zeros((0, 3)), np.zeros(0))
    if not len(points):  # closed
        return None
    origin = (points.min(axis=0) + points.max(axis=0)) / 2  # queries are float32
    frame, background, bodies = (Mesh(mesh.vertices - origin, mesh.faces) for mesh in (frame, background, bodies))
    points = points - origin
    near = _within(frame, points, options.reach * cell)
    still = part_of(frame, near & ~moves)
    on_seam = np.zeros(len(points), bool) if still.is_empty else _distances(still, points) <= cell
    if not on_seam.any():
        return None
    points, lengths = points[on_seam], lengths[on_seam]
    near &= _within(frame, points, options.reach * cell)
    place = _Place(cKDTree(points), cell, options.reach * cell, part_of(frame, near), moves[near])
    gaps, overlaps = _gaps(points, background, bodies), _overlaps(place, background, bodies)
    return Seam(points + origin, lengths, gaps, overlaps, _uncovered(place, background, bodies))


def seam_row(seam: Seam | None) -> Row:
    """Return the numbers of a frame by name, mm; all are None without a seam."""
    shares = {"median": 0.5, "95": 0.95}
    row: Row = {f"seam_gap_mm_{name}": seam and MM * seam.gap(share) for name, share in shares.items()}
    row |= {f"seam_overlap_mm_{name}": seam and MM * seam.overlap(share) for name, share in shares.items()}
    return row | {"seam_uncovered": seam and seam.uncovered, "seam_mm": seam and MM * float(seam.lengths.sum())}


@dataclass(frozen=True, slots=True)
class _Place:
    """Seam of a frame, and the frame's surface around it."""

    tree: Any  # of the points of the seam
    cell: float  # m
    reach: float  # m
    frame: Mesh
    moves: Bool[np.ndarray, " F"]


def _border(part: Mesh, cell: float) -> tuple[Float64[np.ndarray, "N 3"], Float64[np.ndarray, " N"]]:
    """Return points along the border edges of a mesh, and the length that each represents."""
    a, b = part.vertices[border_edges(part)].transpose(1, 0, 2)
    lengths = np.linalg.norm(b - a, axis=1)
    counts = np.maximum(np.ceil(lengths * _FINE / cell), 1).astype(int)
    which = np.repeat(np.arange(len(counts)), counts)
    along = (np.arange(len(which)) - np.repeat(np.cumsum(counts) - counts, counts) + 0.5) / counts[which]
    return a[which] + along[:, None] * (b - a)[which], (lengths / counts)[which]


def _within(mesh: Mesh, points: Float64[np.ndarray, "N 3"], reach: float) -> Bool[np.ndarray, " F"]:
    """Return the faces within `reach` of one of the points, and some a little farther away."""
    from scipy.spatial import cKDTree

    corners = mesh.vertices[mesh.faces]
    middles = corners.mean(axis=1)
    sizes = np.linalg.norm(corners - middles[:, None], axis=2).max(axis=1, initial=0.0)
    room = reach + sizes[:, None]
    found = ((middles >= points.min(axis=0) - room) & (middles <= points.max(axis=0) + room)).all(axis=1)
    found[found] = cKDTree(points).query(middles[found])[0] <= room[found, 0]
    return found


def _distances(mesh: Mesh, points: Float64[np.ndarray, "N 3"]) -> Float64[np.ndarray, " N"]:
    if mesh.is_empty:
        return np.full(len(points), np.inf)
    return np.linalg.norm(Surface(mesh).closest(points).points - points, axis=1)


def _gaps(points: Float64[np.ndarray, "N 3"], background: Mesh, bodies: Mesh) -> Float64[np.ndarray, " N"]:
    if background.is_empty or bodies.is_empty:
        return np.full(len(points), np.inf)
    still, moving, own = Surface(background), Surface(bodies), points
    for _ in range(2):
        own = moving.closest(points).points
        points = still.closest(own).points
    return np.linalg.norm(points - own, axis=1)


def _overlaps(place: _Place, background: Mesh, bodies: Mesh) -> Float64[np.ndarray, " N"]:
    """Return the width of the overlap at each point of the seam, summed over both sides."""
    widths = np.zeros((2, len(place.tree.data)))
    bodies = part_of(bodies, _within(bodies, place.tree.data, place.reach))
    if not (bodies.is_empty or background.is_empty):
        points, faces = spread(bodies, place.cell / _FINE)
        still = Surface(background)
        hits = still.closest(points)
        doubled = np.linalg.norm(hits.points - points, axis=1) <= place.cell
        doubled &= (face_normals(bodies)[0][faces] * still.normals[hits.faces]).sum(axis=1) >= _SAME_WAY
        doubled &= ~still.past_border(hits)
        away, at = place.tree.query(points[doubled])
        of_bodies = place.moves[Surface(place.frame).closest(points[doubled]).faces]
        inside = away <= place.reach
        np.maximum.at(widths, (of_bodies[inside].astype(int), at[inside]), away[inside])
    return _largest_around(place, widths).sum(axis=0)


def _largest_around(place: _Place, values: Float64[np.ndarray, "2 N"]) -> Float64[np.ndarray, "2 N"]:
    """Return the largest value within a cell, since some points of a jagged seam are nearest to no sample."""
    a, b = place.tree.query_pairs(place.cell, output_type="ndarray").T
    largest = values.copy()
    for side, own in zip(largest, values, strict=True):
        np.maximum.at(side, a, own[b])
        np.maximum.at(side, b, own[a])
    return largest


def _uncovered(place: _Place, background: Mesh, bodies: Mesh) -> float:
    points, faces = spread(place.frame, place.cell / 2)
    areas = (face_normals(place.frame)[1] / np.bincount(faces, minlength=len(place.frame.faces)))[faces]
    inside = place.tree.query(points)[0] <= place.reach
    points, areas = points[inside], areas[inside]
    far = np.minimum(_distances(background, points), _distances(bodies, points)) > place.cell
    return float(np.average(far, weights=areas)) if areas.sum() > 0 else 0.0
