"""Labels of moving faces, from moving places or from masks (paper, section 3.2).

In: the number and the mesh of a frame. Out: a label for each face, and the faces that a change of the room affects.
Masks of views are lifted to faces by votes: each pixel votes on the face that it sees (eqs. 1 to 4).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from threading import Lock
from typing import Any

import numpy as np
from jaxtyping import Bool, Float64, Int32, Int64, UInt8
from scipy.spatial import cKDTree

from ...geometry.cameras import Camera
from ...geometry.closest_points import Surface
from ...geometry.drawing import Seen, draw
from ...geometry.topology import connected_faces, face_means, face_normals, part_of, unique_edges
from ...geometry.voxels import Lattice, spread
from ...types import Frames, Mesh
from .color_looks import ColorChange
from .cut import NEAR_CHANGE, NEVER, Rest
from .masks import Masker

_REMEMBERED = 600  # frames whose labels are kept, some 50 kB each: a guess, enough for seconds of a scene
_FLICKER_AREA = 0.2  # m^2: smaller separate moving surface beside an object at rest is flicker (decision 28)
_ELSEWHERE = 2.0  # cells: surface farther from the middle of every known place is at no place (decision 18)
_ONE_MASKER = Lock()  # a masker is asked by one thread at a time


@dataclass(slots=True)
class _LabelCache:
    """Labels of earlier calls, one bit per face, for the `most` frames that were added last."""

    most: float = np.inf  # frames
    _known: dict[tuple[int, int, float], UInt8[np.ndarray, " B"]] = field(default_factory=dict, repr=False)

    def of(self, frame: int, mesh: Mesh, find: Callable[[], Bool[np.ndarray, " F"]]) -> Bool[np.ndarray, " F"]:
        """Return the labels of a frame, calling `find` if they are not in the cache."""
        key = (frame, len(mesh.faces), float(mesh.vertices.sum()))
        if (packed := self._known.get(key)) is None:
            packed = np.packbits(find())
            while len(self._known) >= self.most:
                self._known.pop(next(iter(self._known)), None)  # another thread may have removed it
            self._known[key] = packed
        return np.unpackbits(packed, count=len(mesh.faces)).astype(bool)


@dataclass(frozen=True)
class ByPlace:
    """Segmentation by place: surface at a moving place moves, and so does surface far from every known place.

    With `colors`, adjacent surface that is a little nearer than the room and of another hue moves, too.
    """

    cell: float  # m
    lattice: Lattice
    keys: Int64[np.ndarray, " P"]  # of the places, sorted
    chosen: Bool[np.ndarray, " P"]
    rest: Rest  # the frames in which surface at a moving place belongs to the room nevertheless
    island: float  # m^2
    colors: ColorChange | None = field(default=None, repr=False, compare=False)
    _cache: _LabelCache = field(default_factory=lambda: _LabelCache(_REMEMBERED), init=False, repr=False, compare=False)

    @property
    def noise(self) -> float:
        """Width of the lattice's cells, m, chosen so that noise displaces no surface by two cells."""
        return self.lattice.size

    @property
    def changes(self) -> list[int]:
        """Numbers of the first frames after each change of the room, ascending."""
        return self.rest.changes

    def moving(self, frame: int, mesh: Mesh) -> Bool[np.ndarray, " F"]:
        """Return True for each face at a moving place; `frame` matters only where the room changes."""
        return self._cache.of(frame, mesh, lambda: self._moving(frame, mesh))

    def _moving(self, frame: int, mesh: Mesh) -> Bool[np.ndarray, " F"]:
        chosen = self.chosen & (frame >= self.rest.until) & (frame < self.rest.since)
        moving = self.faces_at(mesh, chosen, elsewhere=True)
        if self.colors is not None and moving.any():
            unlike = self.colors.faces(frame, mesh) & ~self.faces_at(mesh, self.chosen & ~chosen)
            moving = _reached(mesh, moving, unlike)
        return without_islands(mesh, self._without_flicker(frame, mesh, moving), self.island)

    def _without_flicker(self, frame: int, mesh: Mesh, moving: Bool[np.ndarray, " F"]) -> Bool[np.ndarray, " F"]:
        """Return the moving faces without bits of objects at rest, whose edges are measured in some frames only."""
        since, until = self._beside
        beside = (frame >= since) | (frame < until)
        if not (moving.any() and beside.any()):
            return moving
        area, label = _areas(mesh, moving)
        near = self.faces_at(mesh, beside)[moving]
        elsewhere = np.bincount(label, np.where(near, -1.0, 1.0), len(mesh.vertices)) > 0  # most faces
        kept = moving.copy()
        kept[moving] = (area >= _FLICKER_AREA) | elsewhere[label]
        return kept

    def still_at_first(self, frame: int, mesh: Mesh) -> Bool[np.ndarray, " F"]:
        """Return True for each face of a frame that belongs to the room as it is in the first frame."""
        still = self.faces_at(mesh, ~self.chosen | (self.rest.until > frame))
        return still if self.colors is None else still & ~self.moving(frame, mesh)

    def came(self, change: int, mesh: Mesh) -> Bool[np.ndarray, " F"]:
        """Return True for each face of any frame at a place that rests from `change` on: it is part of the room now."""
        return self.faces_at(mesh, self.rest.since == change)

    def gone(self, change: int, mesh: Mesh) -> Bool[np.ndarray, " F"]:
        """Return True for each face of any mesh of the room at a place that rests until `change`: it leaves then."""
        return self.faces_at(mesh, self.rest.until == change)

    def faces_at(self, mesh: Mesh, chosen: Bool[np.ndarray, " P"], elsewhere: bool = False) -> Bool[np.ndarray, " F"]:
        """Return True for each face with at least half of its surface at chosen places.

        Surface less than two cells from a known place counts as at that place. With `elsewhere`, surface at no known
        place counts as chosen.
        """
        if mesh.is_empty or not (chosen.any() or (elsewhere and len(self.keys))):
            return np.zeros(len(mesh.faces), bool)
        points, faces = spread(mesh, 1.5 * self.lattice.size)
        inside = np.bincount(faces, np.append(chosen, elsewhere)[self._place(points)], len(mesh.faces))
        return inside >= 0.5 * np.bincount(faces, minlength=len(mesh.faces))

    def _place(self, points: Float64[np.ndarray, "N 3"]) -> Int64[np.ndarray, " N"]:
        """Return the number of the place of each point, or of the nearest place; P if none is near."""
        keys = self.lattice.keys(points)
        number = np.searchsorted(self.keys, keys)
        missing = np.flatnonzero(np.append(self.keys, -1)[number] != keys)
        if len(missing):
            reach = _ELSEWHERE * self.lattice.size
            number[missing] = self._tree.query(points[missing], distance_upper_bound=reach)[1]
        return number

    @cached_property
    def _beside(self) -> tuple[Int64[np.ndarray, " P"], Int64[np.ndarray, " P"]]:
        """Frames in which the nearest resting place within `NEAR_CHANGE` of each place joins and leaves the room."""
        nearby = list[Int64[np.ndarray, " P"]]()
        for times, never in ((self.rest.since, NEVER), (self.rest.until, 0)):
            changing, middles = np.flatnonzero(times != never), self.lattice.centers(self.keys)
            nearest = np.full(len(times), len(changing))
            if len(changing):
                nearest = cKDTree(middles[changing]).query(middles, distance_upper_bound=NEAR_CHANGE)[1]
            nearby.append(np.append(times[changing], never)[nearest])
        return nearby[0], nearby[1]

    @cached_property
    def _tree(self) -> Any:
        """Search tree of the places' middles; building it takes a tenth of a second."""
        return cKDTree(self.lattice.centers(self.keys))


def _no_change(self: ByMasks | ByRest, change: int, mesh: Mesh) -> Bool[np.ndarray, " F"]:
    """Raise ValueError: `changes` is empty, so there is no valid argument."""
    raise ValueError(f"change {change} of a mesh of {len(mesh.faces)} faces: {type(self).__name__} knows of none")


@dataclass(frozen=True, slots=True)
class ByMasks:
    """Segmentation by masks: each pixel that sees a face votes on its label (eqs. 1 to 4)."""

    masker: Masker
    views: Sequence[Camera]
    cell: float  # m
    threshold: float  # share of the pixels that see a face
    island: float  # m^2
    _cache: _LabelCache = field(default_factory=_LabelCache, init=False, repr=False, compare=False)

    @property
    def noise(self) -> float:
        """Width of a cell, m: masks contain no estimate of the noise."""
        return self.cell

    @property
    def changes(self) -> list[int]:
        """Empty list: masks do not record changes of the room."""
        return []

    def still_at_first(self, frame: int, mesh: Mesh) -> Bool[np.ndarray, " F"]:
        return ~self.moving(frame, mesh)

    came = gone = _no_change  # nor does anything leave the room

    def moving(self, frame: int, mesh: Mesh) -> Bool[np.ndarray, " F"]:
        """Return True for each face that pixels vote to be moving; a frame's masks are made once.

        Faces that no view sees take the label of their neighbours.
        """
        return self._cache.of(frame, mesh, lambda: self._voted(frame, mesh))

    def _voted(self, frame: int, mesh: Mesh) -> Bool[np.ndarray, " F"]:
        if mesh.is_empty:
            return np.zeros(0, bool)
        sights = looks(mesh, self.views)
        with _ONE_MASKER:
            masks = self.masker.masks(frame, sights, self.views)
        dynamic, seen = votes(np.stack([s.faces for s in sights]), masks, len(mesh.faces))
        moves = dynamic / np.maximum(seen, 1) >= self.threshold  # eq. 4
        return without_islands(mesh, _filled(mesh, moves, seen > 0), self.island)


@dataclass(frozen=True)
class ByRest:
    """Segmentation of frames without noise: what is not where surface is in all frames moves."""

    room: Mesh  # m, the surface that is in the same place in all frames
    cell: float  # m
    noise: float  # m, within which places are the same
    changes: tuple[int, ...] = ()  # what comes to rest is not in all frames

    def moving(self, frame: int, mesh: Mesh) -> Bool[np.ndarray, " F"]:
        """Return True for each face with a corner or a middle that the room does not have."""
        del frame
        return is_off(mesh, self._surface, self.noise)

    def still_at_first(self, frame: int, mesh: Mesh) -> Bool[np.ndarray, " F"]:
        return ~self.moving(frame, mesh)

    came = gone = _no_change

    @cached_property
    def _surface(self) -> Surface:
        return Surface(self.room)


Segmentation = ByPlace | ByMasks | ByRest  # labels of a scene's frames


def in_all_frames(frames: Frames, same: float) -> Mesh:
    """Return the faces of the first frame with surface that all others have within `same` (m) of the same place."""
    room = Mesh.empty()
    for number in range(len(frames)):
        mesh = frames[number]
        if room.is_empty or mesh.is_empty:
            room = room if mesh.is_empty else mesh
            continue
        room = part_of(room, ~is_off(room, Surface(mesh), same))
        if room.is_empty:
            break
    return room


def is_off(mesh: Mesh, surface: Surface, same: float) -> Bool[np.ndarray, " F"]:
    """Return True for each face with a corner or a middle that is farther than `same` from a surface."""
    off = (surface.distances(mesh.vertices) > same)[mesh.faces].any(axis=1)
    off[~off] = surface.distances(face_means(mesh.vertices, mesh.faces[~off])) > same
    return off


def looks(mesh: Mesh, views: Sequence[Camera]) -> list[Seen]:
    """Render a mesh in each view."""
    return [draw(mesh, view) for view in views]


def without_islands(mesh: Mesh, chosen: Bool[np.ndarray, " F"], least: float) -> Bool[np.ndarray, " F"]:
    """Give connected faces of one label with an area below `least` (m^2) the other label, moving faces first.

    A connected component of the mesh that is labelled still as a whole keeps its label: no moving face touches it.
    """
    moving = chosen.copy()
    moving[chosen] = _areas(mesh, chosen)[0] >= least
    if not moving.any():
        return moving
    touched = np.zeros(len(mesh.vertices), bool)
    touched[mesh.faces[moving].reshape(-1)] = True
    rests = ~moving
    area, label = _areas(mesh, rests)
    beside = np.zeros(len(mesh.vertices), bool)  # whether a piece touches a moving face
    beside[label[touched[mesh.faces[rests]].any(axis=1)]] = True
    moving[rests] = (area < least) & beside[label]
    return moving


def _reached(mesh: Mesh, moving: Bool[np.ndarray, " F"], more: Bool[np.ndarray, " F"]) -> Bool[np.ndarray, " F"]:
    """Return the moving faces and those of `more` that are connected with one."""
    either = moving | more
    label = connected_faces(mesh.faces[either], len(mesh.vertices))
    reached = np.bincount(label, moving[either], len(mesh.vertices)) > 0
    either[either] = reached[label]
    return either


def _areas(mesh: Mesh, chosen: Bool[np.ndarray, " F"]) -> tuple[Float64[np.ndarray, " C"], Int64[np.ndarray, " C"]]:
    """Return for each chosen face the area of its connected component of chosen faces, and its label (0 to V - 1)."""
    part = Mesh(mesh.vertices, mesh.faces[chosen])
    label = connected_faces(part.faces, len(part.vertices))
    return np.bincount(label, face_normals(part)[1], len(part.vertices))[label].astype(np.float64), label


def _filled(mesh: Mesh, moves: Bool[np.ndarray, " F"], labelled: Bool[np.ndarray, " F"]) -> Bool[np.ndarray, " F"]:
    """Carry labels from the faces that are seen to neighbours that are not, ring by ring, by majority."""
    edges, face_edges = unique_edges(mesh.faces)
    moves, labelled = moves & labelled, labelled.copy()
    while True:
        weight = np.bincount(face_edges[labelled].reshape(-1), minlength=len(edges))
        votes = np.bincount(face_edges[labelled & moves].reshape(-1), minlength=len(edges))
        reached = ~labelled & (weight[face_edges].sum(axis=1) > 0)
        if not reached.any():
            return moves
        moves[reached] = 2 * votes[face_edges[reached]].sum(axis=1) > weight[face_edges[reached]].sum(axis=1)
        labelled |= reached


def votes(
    ids: Int32[np.ndarray, "X H W"], masks: Bool[np.ndarray, "X H W"], faces: int
) -> tuple[Int64[np.ndarray, " F"], Int64[np.ndarray, " F"]]:
    """Return how many pixels of all views see each of `faces` faces as moving (V), and how many see it at all (U).

    `ids`: the face that each pixel sees, -1: none; `masks`: moving pixels.
    """
    hit = ids >= 0
    return np.bincount(ids[hit & masks], minlength=faces), np.bincount(ids[hit], minlength=faces)  # eqs. 2 and 3
