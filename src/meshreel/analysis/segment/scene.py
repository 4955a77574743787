"""Which faces of each frame move (paper, section 3.2): geometric change, or masks from elsewhere lifted by votes.

In: the frames of a scene. Out: a Segmentation, which says of each frame's faces whether they move, one frame at a time.

Differs from the paper: without masks, what moves is found in space, not in pictures, over the whole sequence
(docs/decisions/0018-places.md); and labels are cleaned on the surface.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from jaxtyping import Bool, Float64, Int64, UInt8

from ...errors import InputError
from ...geometry.cameras import PinholeCamera
from ...geometry.connected import connected_faces
from ...geometry.depth import SeesDepth
from ...geometry.nearest import distances
from ...geometry.raycast import Rays, Seen
from ...geometry.topology import face_normals, unique_edges
from ...geometry.voxels import Lattice, spread
from ...types import Frames, Mesh, MeshSequence, evenly
from .cut import CutOptions, moving_places
from .masks import Masker
from .places import PlacesOptions, Watched, find_places
from .settle import Rest, SettleOptions, find_rest
from .views import ViewsOptions, place_views
from .votes import Votes

_PROBES = 3  # frames that the views are placed by
_WIDTH = 4.75  # median distances between two frames that a cell is wide at least: noise moves no surface by two cells
_WIDEST = 4.0  # edges that a cell is wide at most
_THINNED = 7  # vertices of a frame of which one is measured
_ELSEWHERE = 2.0  # cells from the middle of the nearest known place, from which on a surface is at none


@dataclass(frozen=True, slots=True)
class SegmentOptions:
    """How a scene is taken apart."""

    views: ViewsOptions = field(default_factory=ViewsOptions)
    places: PlacesOptions = field(default_factory=PlacesOptions)
    cut: CutOptions = field(default_factory=CutOptions)
    settle: SettleOptions = field(default_factory=SettleOptions)
    threshold: float = 0.3  # the paper's tau: a low one, and clean-up, miss less than a high one
    island: float = 0.01  # m^2: connected faces with less area take the label of what is around them
    cameras: tuple[PinholeCamera, ...] = ()  # what to look from, of one size; none: placed as `views` says

    def __post_init__(self) -> None:
        if not 0 < self.threshold <= 1 or not 0 <= self.island < np.inf:
            raise InputError(f"threshold {self.threshold:g}, island {self.island:g} m^2: give (0, 1] and from 0 on")


class Segmentation(Protocol):
    """Says which faces of a frame move."""

    def moving(self, frame: int, mesh: Mesh) -> Bool[np.ndarray, " F"]:
        """True for the faces of frame `frame`, which is `mesh`, that move."""
        ...


@dataclass(frozen=True, slots=True)
class ByPlace:
    """What is at a moving place moves, whenever it is there; and what is at none that is known: the room is known."""

    lattice: Lattice
    keys: Int64[np.ndarray, " P"]  # of the places, sorted
    chosen: Bool[np.ndarray, " P"]
    rest: Rest  # when what is there belongs to the room after all
    island: float  # m^2

    def moving(self, frame: int, mesh: Mesh) -> Bool[np.ndarray, " F"]:
        """By where the faces are; the frame's number matters where the room changes."""
        chosen = self.chosen & (frame >= self.rest.until) & (frame < self.rest.since)
        return without_islands(mesh, self.faces_at(mesh, chosen, elsewhere=True), self.island)

    def still_at_first(self, frame: int, mesh: Mesh) -> Bool[np.ndarray, " F"]:
        """The faces of frame `frame` that belong to the room as it is in the first frame."""
        return self.faces_at(mesh, ~self.chosen | (self.rest.until > frame))

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
    lattice: Lattice
    options: SegmentOptions
    _known: dict[int, UInt8[np.ndarray, " B"]] = field(default_factory=dict, repr=False)  # a bit a face, by frame

    @property
    def rest(self) -> Rest:
        """Masks know of no changes of the room."""
        return Rest.none(0)

    def still_at_first(self, frame: int, mesh: Mesh) -> Bool[np.ndarray, " F"]:
        """The faces of frame `frame` that do not move."""
        return ~self.moving(frame, mesh)

    def moving(self, frame: int, mesh: Mesh) -> Bool[np.ndarray, " F"]:
        """By the votes of the pixels; faces that no view sees take their neighbours' label. A frame is asked once."""
        if frame not in self._known:
            self._known[frame] = np.packbits(self._voted(frame, mesh))
        return np.unpackbits(self._known[frame], count=len(mesh.faces)).astype(bool)

    def _voted(self, frame: int, mesh: Mesh) -> Bool[np.ndarray, " F"]:
        if mesh.is_empty:
            return np.zeros(0, bool)
        seen = _looks(mesh, self.views)
        masks = self.masker.masks(frame, seen, self.views)
        votes = Votes.of(np.stack([s.faces for s in seen]), masks, len(mesh.faces))
        moves = votes.score >= self.options.threshold
        moves = _filled(mesh, moves, votes.seen > 0)
        return without_islands(mesh, moves, self.options.island)


def segment(frames: MeshSequence, options: SegmentOptions = SegmentOptions()) -> ByPlace:
    """What moves in a scene, by geometric change over the whole of it; `options` say which frames are looked at.

    A scene whose faces turn their backs to it, in which nothing can be seen to move, is turned over.
    """
    chosen = _with_surface(frames, options.places.chosen(len(frames), frames.frame_rate))
    if not chosen:
        return ByPlace(_lattice(frames, chosen), np.zeros(0, np.int64), np.zeros(0, bool), Rest.none(0), options.island)
    found = _by_place(frames, chosen, options)
    if not found.chosen.any() and _faces_away(frames[chosen[0]]):
        turned = _by_place(_TurnedOver(frames), chosen, options)
        found = turned if turned.chosen.any() else found
    return found


def _by_place(frames: MeshSequence, chosen: Sequence[int], options: SegmentOptions) -> ByPlace:
    lattice, views = _noisy_lattice(frames, chosen), _views(frames, chosen, options)
    places = find_places(_watched(frames, chosen, views), lattice, options.places)
    moving = moving_places(places, options.cut)
    rest = find_rest(places, moving, chosen, frames.frame_rate, options.settle)
    return ByPlace(lattice, places.keys, moving, rest, options.island)


def _watched(frames: MeshSequence, chosen: Sequence[int], views: Sequence[PinholeCamera]) -> Watched:
    if not isinstance(frames, SeesDepth):
        return Watched(_Some(frames, chosen), views)
    pictures = frames.pictures
    return Watched(_Some(frames, chosen), views, lambda number: pictures(chosen[number]))


def _faces_away(mesh: Mesh) -> bool:
    """True where most of a surface has its front where the middle of all is not: a room's faces look into it."""
    normals, areas = face_normals(mesh)
    middles = mesh.vertices[mesh.faces].mean(axis=1)
    away = middles - (mesh.vertices.min(axis=0) + mesh.vertices.max(axis=0)) / 2
    return bool((areas * (normals * away).sum(axis=1)).sum() > 0)


def segment_by(masker: Masker, frames: Frames, options: SegmentOptions = SegmentOptions()) -> ByMasks:
    """What moves by somebody's masks.

    Who must see all frames before the first mask has a method `observe`; who must see a few before that, `foresee`.
    """
    chosen = _to_see(frames)
    views = _looking(getattr(masker, "views", None), frames, chosen) or _views(frames, chosen, options)
    if foresee := getattr(masker, "foresee", None):
        foresee([_looks(frames[number], views) for number in chosen[:: max(1, len(chosen) // _PROBES)]])
    if observe := getattr(masker, "observe", None):
        for number in range(len(frames)):
            observe(number, _looks(frames[number], views), views)
    return ByMasks(masker, views, _lattice(frames, chosen), options)


def scene_views(frames: Frames, options: SegmentOptions = SegmentOptions()) -> tuple[PinholeCamera, ...]:
    """What a scene is looked at from. Raises InputError where no frame has a surface to place views by."""
    return _views(frames, _to_see(frames), options)


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


def _looks(mesh: Mesh, views: Sequence[PinholeCamera]) -> list[Seen]:
    rays = Rays(mesh)
    return [rays.look(view) for view in views]


def _to_see(frames: Frames) -> list[int]:
    """A few frames that have a surface; all that have where that is none of the few."""
    return _with_surface(frames, evenly(len(frames), _PROBES)) or _with_surface(frames, range(len(frames)))


def _with_surface(frames: Frames, numbers: Sequence[int]) -> list[int]:
    """Those of some frames that have a surface."""
    return [number for number in numbers if not frames[number].is_empty]


def _views(frames: Frames, chosen: Sequence[int], options: SegmentOptions) -> tuple[PinholeCamera, ...]:
    """The cameras that are given, or placed ones that see some of the chosen frames well."""
    some = _Some(frames, chosen[:: max(1, len(chosen) // _PROBES)])
    return _looking(options.cameras, frames, chosen) or place_views(some, options.views)


def _looking(
    views: tuple[PinholeCamera, ...] | None, frames: Frames, chosen: Sequence[int]
) -> tuple[PinholeCamera, ...] | None:
    """The views that are given. Raises InputError where they see nothing of the chosen frames."""
    if views and chosen and not any((s.faces >= 0).any() for k in chosen for s in _looks(frames[k], views)):
        text = f"the {len(views)} cameras that are given see no face of {len(chosen)} frames, as {chosen[0]}"
        raise InputError(f"{text}; give cameras of this scene, in its unit and axes")
    return views


def _noisy_lattice(frames: Frames, chosen: Sequence[int]) -> Lattice:
    """As `_lattice`, but no finer than noise lets a surface stay in its cell.

    Noise by the median distance from a frame to another one: what stands still is more than half of a scene.
    """
    lattice = _lattice(frames, chosen)
    if not chosen:
        return lattice
    apart = distances(frames[chosen[0]].vertices[::_THINNED], frames[chosen[len(chosen) // 2]])
    noise = min(_WIDTH * float(np.median(apart)), _WIDEST * lattice.size)
    return Lattice(lattice.origin, max(lattice.size, noise))


def _lattice(frames: Frames, chosen: Sequence[int]) -> Lattice:
    """Cells as large as the frames' edges are long."""
    size = edge_length(frames, chosen)
    return Lattice.near(frames[chosen[0]], size) if chosen else Lattice(np.zeros(3), size)


def edge_length(frames: Frames, chosen: Sequence[int] | None = None) -> float:
    """How long the edges of a scene's frames usually are, m: about a voxel of what they were fused on.

    Of the first, the middle and the last frame that are chosen, or that have surface. Edges without length say nothing;
    1 m where there are no others.
    """
    chosen = _to_see(frames) if chosen is None else chosen
    if not chosen:
        return 1.0
    edges = []
    for number in (chosen[0], chosen[len(chosen) // 2], chosen[-1]):
        mesh = frames[number]
        pairs = mesh.vertices[unique_edges(mesh.faces)[0]]
        lengths = np.linalg.norm(pairs[:, 1] - pairs[:, 0], axis=1)
        edges += [np.median(lengths[lengths > 0])] if lengths.any() else []
    return float(np.median(edges)) if edges else 1.0


class _Some(Frames):
    """Some frames of a sequence, read when they are asked for."""

    def __init__(self, frames: Frames, numbers: Sequence[int]) -> None:
        self._frames, self._numbers = frames, list(numbers)

    def __len__(self) -> int:
        return len(self._numbers)

    def __getitem__(self, index: int) -> Mesh:
        return self._frames[self._numbers[index]]


class _TurnedOver(MeshSequence):
    """The same frames with the fronts of all faces where their backs were."""

    def __init__(self, frames: MeshSequence) -> None:
        self._frames = frames

    @property
    def frame_rate(self) -> float:
        return self._frames.frame_rate

    def __len__(self) -> int:
        return len(self._frames)

    def __getitem__(self, index: int) -> Mesh:
        mesh = self._frames[index]
        return Mesh(mesh.vertices, np.ascontiguousarray(mesh.faces[:, ::-1]))
