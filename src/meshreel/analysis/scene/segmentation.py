"""Which faces of each frame move (paper, section 3.2): geometric change, or masks from elsewhere lifted by votes.

In: the frames of a scene. Out: a Segmentation, which says of each frame's faces whether they move, one frame at a time.

Differs from the paper: without masks, what moves is found in space, not in pictures, over the whole sequence
(docs/decisions/0018-places.md); and labels are cleaned on the surface.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from ...errors import InputError
from ...geometry.cameras import PinholeCamera
from ...geometry.closest_points import distances
from ...geometry.depth import DepthPicture, SeesDepth
from ...geometry.derived_sequences import Chosen, TurnedOver
from ...geometry.topology import edge_lengths, face_normals
from ...geometry.voxels import Lattice
from ...types import Mesh, MeshSequence, evenly
from .cut import CutOptions, moving_places
from .labelling import ByMasks, ByPlace, looks
from .masks import Masker
from .places import PlacesOptions, Tell, Watched, find_places, nobody
from .settle import Rest, SettleOptions, find_rest
from .views import ViewsOptions, place_views

_PROBES = 3  # frames that the views are placed by
_WIDTH = 4.75  # median distances between two frames that a cell is wide at least: noise moves no surface by two cells
_WIDEST = 4.0  # edges that a cell is wide at most
_THINNED = 7  # vertices of a frame of which one is measured


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


def segment(frames: MeshSequence, options: SegmentOptions = SegmentOptions(), tell: Tell = nobody) -> ByPlace:
    """What moves in a scene, by geometric change over the whole of it; `options` say which frames are looked at.

    A scene whose faces turn their backs to it, in which nothing can be seen to move, is turned over.
    """
    chosen = _with_surface(frames, options.places.chosen(len(frames), frames.frame_rate))
    if not chosen:
        nothing = np.zeros(0, np.int64), np.zeros(0, bool), Rest.none(0)
        return ByPlace(1.0, Lattice(np.zeros(3), 1.0), *nothing, options.island)
    found = _by_place(frames, chosen, options, tell)
    if not found.chosen.any() and _faces_away(frames[chosen[0]]):
        turned = _by_place(TurnedOver(frames), chosen, options, nobody)
        found = turned if turned.chosen.any() else found
    return found


def _by_place(frames: MeshSequence, chosen: Sequence[int], options: SegmentOptions, tell: Tell) -> ByPlace:
    cell, views = edge_length(frames, chosen), _views(frames, chosen, options)
    lattice = _lattice(frames, chosen, cell)
    pictures = _pictures_of(frames, chosen) if isinstance(frames, SeesDepth) else None
    places = find_places(Watched(Chosen(frames, chosen), views, pictures, tell), lattice, options.places)
    moving = moving_places(places, options.cut)
    rest = find_rest(places, moving, chosen, frames.frame_rate, options.settle)
    return ByPlace(cell, lattice, places.keys, moving, rest, options.island)


def _pictures_of(frames: SeesDepth, chosen: Sequence[int]) -> Callable[[int], list[DepthPicture | None]]:
    """What cameras measured in each of the chosen frames, by their number among these."""
    return lambda number: frames.pictures(chosen[number])


def _faces_away(mesh: Mesh) -> bool:
    """True where most of a surface has its front where the middle of all is not: a room's faces look into it."""
    normals, areas = face_normals(mesh)
    middles = mesh.vertices[mesh.faces].mean(axis=1)
    away = middles - (mesh.vertices.min(axis=0) + mesh.vertices.max(axis=0)) / 2
    return bool((areas * (normals * away).sum(axis=1)).sum() > 0)


def segment_by(masker: Masker, frames: MeshSequence, options: SegmentOptions = SegmentOptions()) -> ByMasks:
    """What moves by somebody's masks.

    Who must see all frames before the first mask has a method `observe`; who must see a few before that, `foresee`.
    """
    chosen = _to_see(frames)
    views = _looking(getattr(masker, "views", None), frames, chosen) or _views(frames, chosen, options)
    if foresee := getattr(masker, "foresee", None):
        foresee([looks(frames[number], views) for number in chosen[:: max(1, len(chosen) // _PROBES)]])
    if observe := getattr(masker, "observe", None):
        for number in range(len(frames)):
            observe(number, looks(frames[number], views), views)
    return ByMasks(masker, views, edge_length(frames, chosen), options.threshold, options.island)


def scene_views(frames: MeshSequence, options: SegmentOptions = SegmentOptions()) -> tuple[PinholeCamera, ...]:
    """What a scene is looked at from. Raises InputError where no frame has a surface to place views by."""
    return _views(frames, _to_see(frames), options)


def _to_see(frames: MeshSequence) -> list[int]:
    """A few frames that have a surface; all that have where that is none of the few."""
    return _with_surface(frames, evenly(len(frames), _PROBES)) or _with_surface(frames, range(len(frames)))


def _with_surface(frames: MeshSequence, numbers: Sequence[int]) -> list[int]:
    """Those of some frames that have a surface."""
    return [number for number in numbers if not frames[number].is_empty]


def _views(frames: MeshSequence, chosen: Sequence[int], options: SegmentOptions) -> tuple[PinholeCamera, ...]:
    """The cameras that are given, or placed ones that see some of the chosen frames well."""
    some = Chosen(frames, chosen[:: max(1, len(chosen) // _PROBES)])
    return _looking(options.cameras, frames, chosen) or place_views(some, options.views)


def _looking(
    views: tuple[PinholeCamera, ...] | None, frames: MeshSequence, chosen: Sequence[int]
) -> tuple[PinholeCamera, ...] | None:
    """The views that are given. Raises InputError where they see nothing of the chosen frames."""
    if views and chosen and not any((s.faces >= 0).any() for k in chosen for s in looks(frames[k], views)):
        text = f"the {len(views)} cameras that are given see no face of {len(chosen)} frames, as {chosen[0]}"
        raise InputError(f"{text}; give cameras of this scene, in its unit and axes")
    return views


def _lattice(frames: MeshSequence, chosen: Sequence[int], cell: float) -> Lattice:
    """Cells as large as the frames' edges are long, but no finer than noise lets a surface stay in its own.

    Noise by the median distance from a frame to another one: what stands still is more than half of a scene.
    """
    first = frames[chosen[0]]
    apart = distances(first.vertices[::_THINNED], frames[chosen[len(chosen) // 2]])
    return Lattice.near(first, max(cell, min(_WIDTH * float(np.median(apart)), _WIDEST * cell)))


def edge_length(frames: MeshSequence, chosen: Sequence[int]) -> float:
    """How long the edges of a scene's frames usually are, m: about a voxel of what they were fused on.

    Of the first, the middle and the last frame that are chosen. Edges without length say nothing; 1 m where there are
    no others.
    """
    edges = []
    for number in sorted({chosen[0], chosen[len(chosen) // 2], chosen[-1]} if chosen else ()):
        lengths = edge_lengths(frames[number])
        edges += [np.median(lengths[lengths > 0])] if lengths.any() else []
    return float(np.median(edges)) if edges else 1.0
