"""Separate the moving faces of a scene from the still ones (paper, section 3.2), by geometric change or by masks.

In: the frames of a scene. Out: a Segmentation, which labels the faces of one frame at a time.

Differs from the paper: without masks, moving surface is found in space rather than in pictures, over the whole
sequence (docs/decisions/0018-places.md); and labels are cleaned on the surface.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from jaxtyping import Bool, Float64, Int64

from ...errors import InputError
from ...geometry.cameras import Camera
from ...geometry.closest_points import Surface
from ...geometry.depth import is_carried
from ...geometry.derived_sequences import CapturedSequence, DerivedSequence, captured, picked, turned_over
from ...geometry.topology import edge_lengths, face_means, face_normals
from ...geometry.voxels import Lattice
from ...types import MeshSequence, evenly
from .color_looks import CHANGE_SIDE, MOMENTS, SIDE, ColorChange, ColorLooks
from .cut import Rest, find_rest, moving_places
from .labelling import ByMasks, ByPlace, ByRest, in_all_frames, looks
from .masks import Masker
from .places import Observations, find_places, inspected
from .standing import Standing, standing
from .views import place_views

_PROBES = 3  # frames used to place the views: a guess
_WIDTH = 4.75  # smallest width of a cell, in median distances between two frames: decision 18
_WIDEST = 4.0  # largest width of a cell, in edge lengths: decision 18
_LOOKS = 5  # frames that are compared to decide if surface stands still: a guess
_THRESHOLD = 0.3  # the paper's tau: a low one followed by clean-up misses less than a high one (guess)
_MOVED = 0.1  # share of what rests, in parts that do not: .03 of a door, .3 of a standing person (decision 28)
_ISLAND = 0.01  # m^2: connected faces with less area take the label of the faces around them (guess)
Cameras = tuple[Camera, ...]


def segment(frames: MeshSequence, cameras: Cameras = (), stands: Standing | None = None) -> ByPlace | ByRest:
    """Segment a scene by geometric change over the whole sequence, whose `standing` is measured if it is not given.

    It is looked at by the given cameras, which are of one size, or by placed ones. If nothing moves and the faces turn
    their backs to the inside of the scene, it is segmented again with all faces reversed. Frames without noise are
    compared instead.
    """
    frames = captured(frames)
    chosen = _with_surface(frames, inspected(len(frames), frames.frame_rate))
    if not chosen:
        nothing = np.zeros(0, np.int64), np.zeros(0, bool), Rest.none(0)
        return ByPlace(1.0, Lattice(np.zeros(3), 1.0), *nothing, _ISLAND)
    stands = stands or standing(frames)
    if stands.same and not (room := in_all_frames(frames, stands.same)).is_empty:
        return ByRest(room, edge_length(frames, chosen), stands.same)
    change = stands.usual_change
    places = _by_place(frames, chosen, cameras, change)
    if places.chosen.any():
        return places
    first = frames[chosen[0]]
    normals, areas = face_normals(first)
    away = face_means(first.vertices, first.faces) - first.middle
    if (areas * (normals * away).sum(axis=1)).sum() > 0:  # a room's faces look inwards
        reversed_places = _by_place(DerivedSequence(frames, turned_over), chosen, cameras, change)
        places = reversed_places if reversed_places.chosen.any() else places
    return places


def _by_place(frames: CapturedSequence, chosen: Sequence[int], cameras: Cameras, noise: float) -> ByPlace:
    """Segment a scene in which surface at rest is `noise` (m) from where it is in another frame."""
    cell, views = edge_length(frames, chosen), _views(frames, chosen, cameras)
    lattice = Lattice.near(frames[chosen[0]], max(cell, min(_WIDTH * noise, _WIDEST * cell)))
    frames_seen = picked(frames, chosen)
    pictures = None if frames_seen.depth is None else frames_seen.depth.__getitem__
    places = find_places(Observations(frames_seen, views, pictures), lattice)
    moving = moving_places(places)

    @lru_cache(maxsize=1)  # successive queries about places beside a change concern the same frames
    def looked_at(numbers: tuple[int, ...]) -> tuple[list[Surface], list[Int64[np.ndarray, " V"]]]:
        surfaces = [Surface(frames[numbers[k]]) for k in evenly(len(numbers), _LOOKS)]
        return surfaces, [lattice.keys(surface.mesh.vertices) for surface in surfaces]

    def holds(groups: Sequence[Int64[np.ndarray, " C"]], numbers: list[int], times: float, part: float) -> list[bool]:
        surfaces, keys = looked_at(tuple(numbers))
        masks_of_groups = ([np.isin(each, places.keys[group]) for each in keys] for group in groups)
        return [_stands(surfaces, masks, 2 * cell, times * noise, part) for masks in masks_of_groups]

    rest = find_rest(places, moving, chosen, frames.frame_rate, holds)
    looks = _color_looks(frames, chosen, CHANGE_SIDE) if moving.any() else None
    usual = [chosen[number] for number in evenly(len(chosen), MOMENTS)]
    colors = None if looks is None else ColorChange.of(frames, looks, usual, cell)
    return ByPlace(cell, lattice, places.keys, moving, rest, _ISLAND, colors)


def segment_by(masker: Masker, frames: MeshSequence, cameras: Cameras = ()) -> ByMasks:
    """Segment a scene by the masks of `masker`; if it `observes`, it receives every frame before the first mask."""
    chosen = _to_see(frames)
    colors = None if masker.views or cameras else _color_looks(frames, chosen)
    given = masker.views if colors is None else colors.views
    views = _looking(given, frames, chosen) or _views(frames, chosen, cameras)
    if masker.observes:
        few = chosen[:: max(1, len(chosen) // _PROBES)]
        masker.foresee([looks(frames[number], views) for number in few], colors)
        for number in range(len(frames)):
            masker.observe(number, looks(frames[number], views), views)
    return ByMasks(masker, views, edge_length(frames, chosen), _THRESHOLD, _ISLAND)


def scene_views(frames: MeshSequence, cameras: Cameras = ()) -> Cameras:
    """Return the views of a scene: given cameras, or placed ones. Raises InputError if no frame has a surface."""
    return _views(frames, _to_see(frames), cameras)


def mask_views(frames: MeshSequence, cameras: Cameras = ()) -> tuple[Cameras, ColorLooks | None]:
    """Return views for masks: given cameras, or colour cameras with their pictures, or placed views."""
    chosen = _to_see(frames)
    colors = None if cameras else _color_looks(frames, chosen)
    return _views(frames, chosen, cameras) if colors is None else colors.views, colors


def _color_looks(frames: MeshSequence, chosen: Sequence[int], side: int = SIDE) -> ColorLooks | None:
    """Return the pictures of the colour cameras; None if there are none."""
    colors = captured(frames).colors
    if colors is None or not chosen or is_carried(colors.__getitem__, len(frames)):  # a view is at one place
        return None
    looks = ColorLooks(colors, chosen[0], side)
    return looks if looks.views else None


def _to_see(frames: MeshSequence) -> list[int]:
    """Return the numbers of a few frames that have a surface; of all such frames if none of the few has one."""
    return _with_surface(frames, evenly(len(frames), _PROBES)) or _with_surface(frames, range(len(frames)))


def _with_surface(frames: MeshSequence, numbers: Sequence[int]) -> list[int]:
    """Return the `numbers` of frames with a surface."""
    return [number for number in numbers if not frames[number].is_empty]


def _views(frames: MeshSequence, chosen: Sequence[int], cameras: Cameras) -> Cameras:
    """Return the given cameras, or views placed for a few of the chosen frames."""
    few = picked(frames, chosen[:: max(1, len(chosen) // _PROBES)])
    return _looking(cameras, frames, chosen) or place_views(few, few.up)


def _looking(views: Cameras | None, frames: MeshSequence, chosen: Sequence[int]) -> Cameras | None:
    """Return `views` unchanged. Raises InputError if they see no face of any chosen frame."""
    if views and chosen and not any((s.faces >= 0).any() for k in chosen for s in looks(frames[k], views)):
        text = f"the {len(views)} given cameras see no face in any of {len(chosen)} frames (the first is {chosen[0]})"
        raise InputError(f"{text}; give cameras of this scene, in its unit and axes")
    return views


def _stands(
    probes: Sequence[Surface], masks: Sequence[Bool[np.ndarray, " _"]], reach: float, limit: float, part: float
) -> bool:
    """Return whether chosen surface is in the same place, up to `limit` (m), in all frames that show it.

    The surface is that of the frame with most of it. A frame shows it if it has surface within `reach` (m) of at least
    half of it: people in front hide things at times. All parts of size `part` (m) stay, but for a few: the median of a
    person who stands there and waves is that of a trunk.
    """
    counts = [np.count_nonzero(chosen) for chosen in masks]
    most = int(np.argmax(counts))
    points, visible = probes[most].mesh.vertices[masks[most]], 1
    for number, probe in enumerate(probes):
        if number == most or counts[most] == 0:
            continue
        gaps = probe.distances(points)
        near = gaps <= reach
        if near.sum() >= len(gaps) / 2:
            visible += 1
            if (_usual(points[near], gaps[near], part) > limit).mean() > _MOVED:
                return False
    return visible >= len(probes) / 2


def _usual(
    points: Float64[np.ndarray, "N 3"], gaps: Float64[np.ndarray, " N"], size: float
) -> Float64[np.ndarray, " N"]:
    """Return for each point the median distance of its part, a cube of size `size`."""
    part = np.unique(np.floor(points / size), axis=0, return_inverse=True)[1].reshape(-1)
    sizes = np.bincount(part)
    return gaps[np.lexsort((gaps, part))][np.cumsum(sizes) - sizes + sizes // 2][part]


def edge_length(frames: MeshSequence, chosen: Sequence[int]) -> float:
    """Return the median edge length of a scene's frames, m: about one voxel of the grid on which they were fused.

    Only the first, the middle and the last chosen frame are read. Edges of length zero are ignored; 1 m if there are
    no others.
    """
    edges = []
    for number in sorted({chosen[0], chosen[len(chosen) // 2], chosen[-1]} if chosen else ()):
        lengths = edge_lengths(frames[number])
        edges += [np.median(lengths[lengths > 0])] if lengths.any() else []
    return float(np.median(edges)) if edges else 1.0
