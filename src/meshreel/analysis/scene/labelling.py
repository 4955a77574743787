"""What is known of which faces move, by place or by masks: one protocol for both (paper, section 3.2).

In: a frame's number and mesh. Out: a label a face; and what the room is like when it changes.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Bool, Float64, Int64, UInt8

from ...geometry.cameras import PinholeCamera
from ...geometry.connected import connected_faces
from ...geometry.raycast import Rays, Seen
from ...geometry.topology import face_normals, unique_edges
from ...geometry.voxels import Lattice, spread
from ...types import Mesh
from .masks import Masker
from .settle import Rest
from .votes import Votes

_REMEMBERED = 600  # frames whose labels by place are kept: with some 50 kB each, a scene of seconds at several rates
_ELSEWHERE = 2.0  # cells from the middle of the nearest known place, from which on a surface is at none


@runtime_checkable
class Segmentation(Protocol):
    """Says which faces of each frame of a scene move, and when the room is another from then on."""

    @property
    def cell(self) -> float:
        """How long the edges of the frames usually are, m."""
        ...

    @property
    def noise(self) -> float:
        """What is farther from a surface than some of this, m, is no noise of it; no less than a cell."""
        ...

    @property
    def changes(self) -> list[int]:
        """The frames with which the room is another, rising."""
        ...

    def moving(self, frame: int, mesh: Mesh) -> Bool[np.ndarray, " F"]:
        """True for the faces of frame `frame`, which is `mesh`, that move."""
        ...

    def still_at_first(self, frame: int, mesh: Mesh) -> Bool[np.ndarray, " F"]:
        """The faces of frame `frame` that belong to the room as it is in the first frame."""
        ...

    def came(self, change: int, mesh: Mesh) -> Bool[np.ndarray, " F"]:
        """The faces of any frame that stand where something has come to stand with a change."""
        ...

    def gone(self, change: int, mesh: Mesh) -> Bool[np.ndarray, " F"]:
        """The faces of any mesh of the room where something is no more from a change on."""
        ...


@dataclass(slots=True)
class _Answers:
    """Labels that were asked for before, a bit a face: of the last so many frames, or of all."""

    most: float = np.inf  # frames
    _known: dict[tuple[int, int, float], UInt8[np.ndarray, " B"]] = field(default_factory=dict, repr=False)

    def of(self, frame: int, mesh: Mesh, find: Callable[[], Bool[np.ndarray, " F"]]) -> Bool[np.ndarray, " F"]:
        """What `find` says of a frame, which is asked where that is not known."""
        key = (frame, len(mesh.faces), float(mesh.vertices.sum()))
        if key not in self._known:
            if len(self._known) >= self.most:
                del self._known[next(iter(self._known))]
            self._known[key] = np.packbits(find())
        return np.unpackbits(self._known[key], count=len(mesh.faces)).astype(bool)


@dataclass(frozen=True, slots=True)
class ByPlace:
    """What is at a moving place moves, whenever it is there; and what is at none that is known: the room is known."""

    cell: float  # m
    lattice: Lattice
    keys: Int64[np.ndarray, " P"]  # of the places, sorted
    chosen: Bool[np.ndarray, " P"]
    rest: Rest  # when what is there belongs to the room after all
    island: float  # m^2
    _asked: _Answers = field(default_factory=lambda: _Answers(_REMEMBERED), init=False, repr=False, compare=False)

    @property
    def noise(self) -> float:
        """The cells of the lattice are so wide that noise moves no surface by two of them, m."""
        return self.lattice.size

    @property
    def changes(self) -> list[int]:
        """The frames with which the room is another, rising."""
        return self.rest.changes

    def moving(self, frame: int, mesh: Mesh) -> Bool[np.ndarray, " F"]:
        """By where the faces are; the frame's number matters where the room changes."""
        return self._asked.of(frame, mesh, lambda: self._moving(frame, mesh))

    def _moving(self, frame: int, mesh: Mesh) -> Bool[np.ndarray, " F"]:
        chosen = self.chosen & (frame >= self.rest.until) & (frame < self.rest.since)
        return without_islands(mesh, self.faces_at(mesh, chosen, elsewhere=True), self.island)

    def still_at_first(self, frame: int, mesh: Mesh) -> Bool[np.ndarray, " F"]:
        """The faces of frame `frame` that belong to the room as it is in the first frame."""
        return self.faces_at(mesh, ~self.chosen | (self.rest.until > frame))

    def came(self, change: int, mesh: Mesh) -> Bool[np.ndarray, " F"]:
        """The faces at places that rest from a change on."""
        return self.faces_at(mesh, self.rest.since == change)

    def gone(self, change: int, mesh: Mesh) -> Bool[np.ndarray, " F"]:
        """The faces at places that rest until a change."""
        return self.faces_at(mesh, self.rest.until == change)

    def faces_at(self, mesh: Mesh, chosen: Bool[np.ndarray, " P"], elsewhere: bool = False) -> Bool[np.ndarray, " F"]:
        """The faces most of whose surface is at chosen places, or, where that is asked for, at none that is known.

        What is beside a known place counts as there.
        """
        if mesh.is_empty or not (chosen.any() or (elsewhere and len(self.keys))):
            return np.zeros(len(mesh.faces), bool)
        points, faces = spread(mesh, 1.5 * self.lattice.size)
        there = np.bincount(faces, np.append(chosen, elsewhere)[self._place(points)], len(mesh.faces))
        return there >= 0.5 * np.bincount(faces, minlength=len(mesh.faces))

    def _place(self, points: Float64[np.ndarray, "N 3"]) -> Int64[np.ndarray, " N"]:
        """The number of the place that each point is at, or of the nearest; P where none is near."""
        from scipy.spatial import cKDTree

        asked = self.lattice.keys(points)
        number = np.searchsorted(self.keys, asked)
        unknown = np.flatnonzero(np.append(self.keys, -1)[number] != asked)
        if len(unknown):
            tree, reach = cKDTree(self.lattice.centers(self.keys)), _ELSEWHERE * self.lattice.size
            number[unknown] = tree.query(points[unknown], distance_upper_bound=reach)[1]
        return number


@dataclass(frozen=True, slots=True)
class ByMasks:
    """What most pixels that see it call moving (eqs. 1 to 4)."""

    masker: Masker
    views: Sequence[PinholeCamera]
    cell: float  # m
    threshold: float  # share of the pixels that see a face
    island: float  # m^2
    _asked: _Answers = field(default_factory=_Answers, init=False, repr=False, compare=False)

    @property
    def noise(self) -> float:
        """Masks know of no noise: a cell, m."""
        return self.cell

    @property
    def changes(self) -> list[int]:
        """Masks know of no changes of the room."""
        return []

    def still_at_first(self, frame: int, mesh: Mesh) -> Bool[np.ndarray, " F"]:
        """The faces of frame `frame` that do not move."""
        return ~self.moving(frame, mesh)

    def came(self, change: int, mesh: Mesh) -> Bool[np.ndarray, " F"]:
        """There is no change to ask for."""
        raise ValueError(f"change {change} of a mesh of {len(mesh.faces)} faces: masks know of no changes")

    def gone(self, change: int, mesh: Mesh) -> Bool[np.ndarray, " F"]:
        """There is no change to ask for."""
        raise ValueError(f"change {change} of a mesh of {len(mesh.faces)} faces: masks know of no changes")

    def moving(self, frame: int, mesh: Mesh) -> Bool[np.ndarray, " F"]:
        """By the votes of the pixels; faces that no view sees take their neighbours' label. A frame is asked once."""
        return self._asked.of(frame, mesh, lambda: self._voted(frame, mesh))

    def _voted(self, frame: int, mesh: Mesh) -> Bool[np.ndarray, " F"]:
        if mesh.is_empty:
            return np.zeros(0, bool)
        seen = looks(mesh, self.views)
        masks = self.masker.masks(frame, seen, self.views)
        votes = Votes.of(np.stack([s.faces for s in seen]), masks, len(mesh.faces))
        moves = votes.score >= self.threshold
        moves = _filled(mesh, moves, votes.seen > 0)
        return without_islands(mesh, moves, self.island)


def looks(mesh: Mesh, views: Sequence[PinholeCamera]) -> list[Seen]:
    """What each view sees of a mesh."""
    rays = Rays(mesh)
    return [rays.look(view) for view in views]


def without_islands(mesh: Mesh, chosen: Bool[np.ndarray, " F"], least: float) -> Bool[np.ndarray, " F"]:
    """The labels with connected faces of one label and less area given the other; the moving ones first.

    A connected piece of the mesh that has one label keeps it if it rests: there is nothing around it.
    """
    moving = chosen.copy()
    moving[chosen] = _areas(mesh, chosen)[0] >= least
    if not moving.any():
        return moving
    touched = np.zeros(len(mesh.vertices), bool)
    touched[mesh.faces[moving].reshape(-1)] = True
    rests = ~moving
    area, label = _areas(mesh, rests)
    beside = np.zeros(len(mesh.vertices), bool)  # whether a piece has something that moves around it
    beside[label[touched[mesh.faces[rests]].any(axis=1)]] = True
    moving[rests] = (area < least) & beside[label]
    return moving


def _areas(mesh: Mesh, chosen: Bool[np.ndarray, " F"]) -> tuple[Float64[np.ndarray, " C"], Int64[np.ndarray, " C"]]:
    """The area of the connected chosen faces that each chosen face belongs to, and their label, less than V."""
    some = Mesh(mesh.vertices, mesh.faces[chosen])
    label = connected_faces(some.faces, len(some.vertices))
    return np.bincount(label, face_normals(some)[1], len(some.vertices))[label].astype(np.float64), label


def _filled(mesh: Mesh, moves: Bool[np.ndarray, " F"], known: Bool[np.ndarray, " F"]) -> Bool[np.ndarray, " F"]:
    """Labels carried from faces that are seen to their neighbours that are not, ring by ring."""
    edges, face_edges = unique_edges(mesh.faces)
    moves, known = moves & known, known.copy()
    while True:
        weight = np.bincount(face_edges[known].reshape(-1), minlength=len(edges))
        votes = np.bincount(face_edges[known & moves].reshape(-1), minlength=len(edges))
        reached = ~known & (weight[face_edges].sum(axis=1) > 0)
        if not reached.any():
            return moves
        moves[reached] = 2 * votes[face_edges[reached]].sum(axis=1) > weight[face_edges[reached]].sum(axis=1)
        known |= reached
