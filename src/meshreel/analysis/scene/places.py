"""State of each place of a scene over time: occupied, seen free, or unknown (free-space carving, decision 18).

In: some frames, spread over the sequence, and views of them. Out: for every cell that has surface in any of the frames,
counts of the frames in which it is occupied (surface in it or beside it) and of those in which views see past it.

Noise moves surface by a cell, and rays graze it, so a cell beside surface is never seen free. Views see through holes
in the cameras' shadows, so where cameras usually measure, one of them must have measured past a cell, too; a camera
that did so in all nine pixels around suffices. Memory does not grow with the number of frames.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Bool, Float32, Float64, Int32, Int64, UInt16
from scipy.ndimage import minimum_filter

from ...geometry import work
from ...geometry.cameras import Camera
from ...geometry.depth import DepthPicture, is_carried
from ...geometry.drawing import backs, draw
from ...geometry.threads import ahead
from ...geometry.topology import face_normals
from ...geometry.voxels import Lattice, distinct, neighbours, spread
from ...types import Frames, Mesh, evenly

Mask = Bool[np.ndarray, " P"]  # of places
Keys = Int64[np.ndarray, " P"]  # of the cells of places, sorted
_Counted = tuple[Camera, Int32[np.ndarray, "H W"]]  # a camera, and the frames in which each of its pixels has a depth
_DEEPEST = 65_535  # largest stored depth (uint16), in units of a cell / _FINENESS; 0: nothing seen
_FINENESS = 16  # units of a stored depth in a cell: a guess
_TOGETHER = 32  # frames whose pictures are in memory together, so that places are projected once for all: a guess
_FRAMES = 16  # smallest number of inspected frames, spread over the sequence; all if it has fewer (decision 18)
_RATE = 4.0  # 1/s, lowest rate of inspected frames: a body present only between two of them is not carved (decision 18)
_PAST = 2.0  # cells by which a view must see past the middle of a place (decision 18)
_VIEWS = 2  # smallest number of views that must see past it (decision 18)


def inspected(count: int, frame_rate: float) -> list[int]:
    """Return the numbers of the frames to inspect in a sequence of `count` frames."""
    return evenly(count, max(_FRAMES, math.ceil((count - 1) / frame_rate * _RATE) + 1))


@dataclass(frozen=True, slots=True)
class Observations:
    """Frames, the views of them, and the depth pictures that cameras took of each frame, if there are any."""

    frames: Sequence[Mesh] | Frames
    views: Sequence[Camera]
    pictures: Callable[[int], list[DepthPicture | None]] | None = None  # of a frame: one for each camera

    def observe(self, number: int, lattice: Lattice, seen: bool = True) -> _Observation:
        """Return the observations of a frame; unless `seen`, without the depths of the views."""
        mesh, unit = self.frames[number], lattice.size / _FINENESS
        # Only an annotation: to call the type would make a class for each frame, which stays until all garbage goes.
        depths: list[UInt16[np.ndarray, "H W"]] = []
        normals = face_normals(mesh)[0]
        for view in self.views if seen else ():
            sight = draw(mesh, view)
            depth = np.where(np.isfinite(sight.depth) & ~backs(normals, view, sight), sight.depth, 0.0)
            depths.append(np.clip(np.rint(depth / unit), 0, _DEEPEST).astype(np.uint16))
        points, faces = spread(mesh, 1.5 * lattice.size)
        keys, cell = np.unique(lattice.keys(points), return_inverse=True)
        sums = [np.bincount(cell.reshape(-1), normals[faces, axis], len(keys)) for axis in range(3)]
        measured = None if self.pictures is None else self.pictures(number)
        return _Observation(keys, np.stack(sums, axis=1).astype(np.float32), depths, measured)


@dataclass(frozen=True, slots=True)
class Stay:
    """For each place, the uninterrupted stay of surface at the end of the inspected frames; or, reversed, at the start.

    A stay begins with the first frame that has surface after the place was last seen free.
    """

    first: Int32[np.ndarray, " P"]  # index of that frame; -1 if the place is never seen free or has no surface after it
    count: Int32[np.ndarray, " P"]  # frames with surface during the stay


class Tally:
    """Counts, for each of P places, of the frames added so far in which it is occupied and in which it is seen free."""

    def __init__(self, places: int) -> None:
        self.frames = 0
        self.occupied, self.free = np.zeros(places, np.int32), np.zeros(places, np.int32)  # frames
        none = np.full(places, -1, np.int32)
        # Stays until each place was first seen free, or until the end; `first` is the last frame with surface.
        self.early = Stay(none.copy(), np.zeros(places, np.int32))
        self._after = Stay(none, np.zeros(places, np.int32))

    def add(self, occupied: Mask, free: Mask) -> None:
        early = occupied & (self.free == 0)
        self.early.first[early] = self.frames
        self.early.count[early] += 1
        self._after.first[free] = -1
        self._after.count[free] = 0
        self._after.first[occupied & (self._after.first < 0)] = self.frames
        self._after.count[occupied] += 1
        self.occupied += occupied
        self.free += free
        self.frames += 1

    @property
    def after(self) -> Stay:
        """Stays since each place was last seen free."""
        return Stay(np.where(self.free > 0, self._after.first, -1).astype(np.int32), self._after.count)

    @property
    def before(self) -> Stay:
        """Stays until each place was first seen free; frames are numbered backwards from the last one."""
        entered = (self.free > 0) & (self.early.first >= 0)
        return Stay(np.where(entered, self.frames - 1 - self.early.first, -1).astype(np.int32), self.early.count)


@dataclass(frozen=True, slots=True)
class Places:
    """Cells of a scene that have surface in any inspected frame, and the counts of observations there."""

    lattice: Lattice
    keys: Keys  # sorted
    beside: Int32[np.ndarray, "P 26"]  # numbers of the neighbouring places; a place's own number where there is none
    normals: Float64[np.ndarray, "P 3"]  # mean normal of the surface there, unit length; 0 where normals cancel
    tally: Tally
    # By number, depth cameras that stand still, and the pixels in which each has a depth in half of the frames or more;
    # none where a camera moves: a frame is a part of the scene then, and only what is measured past is seen free.
    eyes: dict[int, tuple[Camera, Bool[np.ndarray, "H W"]]] = field(default_factory=dict)
    is_part: bool = False  # whether a frame shows a part of the scene, as from a camera that moves

    @property
    def free_share(self) -> Float64[np.ndarray, " P"]:
        """Share of frames in which a place is seen free, among those in which it is occupied or seen free."""
        return self.tally.free / np.maximum(self.tally.free + self.tally.occupied, 1)

    @property
    def middles(self) -> Float64[np.ndarray, "P 3"]:
        """Middles of the cells, in the scene's unit."""
        return self.lattice.centers(self.keys)


@dataclass(frozen=True, slots=True)
class _Observation:
    """Observations of one frame: its occupied cells, the depths of the views, and the cameras' depth pictures."""

    cells: Int64[np.ndarray, " C"]  # sorted keys of the cells with surface
    normals: Float32[np.ndarray, "C 3"]  # sums of the normals of the surface in each
    # For each view, in units of a cell / _FINENESS; 0 where a ray hits nothing, or a face from behind.
    depths: list[UInt16[np.ndarray, "H W"]]
    measured: list[DepthPicture | None] | None  # for each camera; None without cameras


def find_places(observed: Observations, lattice: Lattice) -> Places:
    """Find the places of a scene and count observations there; frames after the first 32 are read twice.

    A mesh for each thread is in memory at a time. Takes about 1 s of CPU for a frame of 500,000 faces.
    """
    observations, cells, cameras = list[_Observation](), _Known(), dict[int, _Counted]()
    found = ahead(lambda number: observed.observe(number, lattice, number < _TOGETHER), range(len(observed.frames)))
    for number, one in enumerate(found):
        cells.add(one.cells, one.normals)
        _count_depths(cameras, one.measured)
        observations += [one] if number < _TOGETHER else []
        work.passed("observe")
    keys, normals = cells.places()
    eyes = {number: (camera, 2 * count >= len(observed.frames)) for number, (camera, count) in cameras.items()}
    is_part = observed.pictures is not None and is_carried(observed.pictures, len(observed.frames))
    places = Places(lattice, keys, neighbours(keys), normals, Tally(len(keys)), {} if is_part else eyes, is_part)
    for occupied, free in _states(observations, places, observed.views):
        places.tally.add(occupied, free)
    observations.clear()
    for occupied, free in states(observed, range(_TOGETHER, len(observed.frames)), places):
        places.tally.add(occupied, free)
        work.passed("segment")
    return places


def states(observed: Observations, numbers: range, places: Places) -> Iterator[tuple[Mask, Mask]]:
    """Yield for each frame in `numbers` two masks of places: occupied ones, and others that are seen free."""
    lattice = places.lattice
    for start in range(0, len(numbers), _TOGETHER):
        together = list(ahead(lambda number: observed.observe(number, lattice), numbers[start : start + _TOGETHER]))
        yield from _states(together, places, observed.views)


def _states(frames: Sequence[_Observation], places: Places, views: Sequence[Camera]) -> Iterator[tuple[Mask, Mask]]:
    """Yield the states of the places in frames whose observations are in memory; see `states`."""
    seen_past = np.zeros((len(frames), len(places.keys)), np.uint8)
    middles, size = places.middles, places.lattice.size
    for number, view in enumerate(views):
        pixels, inside, depth = view.seen(middles)
        limit = (depth + _PAST * size) / (size / _FINENESS)
        for counts, frame in zip(seen_past, frames, strict=True):
            counts[inside[frame.depths[number].reshape(-1)[pixels] > limit]] += 1
    sensed = _sensed(frames, places, _PAST * size)
    for counts, frame, (doubtful, clear) in zip(seen_past, frames, sensed, strict=True):
        own = np.zeros(len(places.keys), bool)
        own[np.searchsorted(places.keys, frame.cells)] = True
        occupied = own.copy()
        occupied[places.beside[own].reshape(-1)] = True  # surface in the place or in a neighbouring one
        yield occupied, ((counts >= _VIEWS) & ~doubtful | clear) & ~occupied


def _sensed(frames: Sequence[_Observation], places: Places, reach: float) -> Iterator[tuple[Mask, Mask]]:
    """Yield masks of the doubtful and of the clear places in each frame, by the depths that cameras measured.

    Doubtful: a camera that usually measures there measured nothing more than `reach` (m) past the place. Clear: a
    camera measured more than that in all nine pixels around the place.
    """
    middles = places.middles
    at = {number: camera.seen(middles) for number, (camera, _) in places.eyes.items()}
    for frame in frames:
        expected, past, clear = np.zeros((3, len(middles)), bool)
        expected |= places.is_part
        for number, (_, sees) in places.eyes.items():
            pixels, inside, _ = at[number]
            expected[inside[sees.reshape(-1)[pixels]]] = True
        for number, picture in enumerate(frame.measured or ()):
            if picture is not None:
                pixels, inside, depth = at[number] if number in at else picture.camera.seen(middles)
                depths = picture.depth.reshape(-1)[pixels] * picture.unit
                expected[inside[depths > 0]] = True
                past[inside[depths > depth + reach]] = True
                around = minimum_filter(picture.depth, 3)  # 0 where one of the nine pixels measured nothing
                least = around.reshape(-1)[pixels] * picture.unit
                clear[inside[least > depth + reach]] = True
        yield expected & ~past, clear


def _count_depths(cameras: dict[int, _Counted], pictures: Sequence[DepthPicture | None] | None) -> None:
    """Add the pictures of a frame to the counts of their cameras."""
    for number, picture in enumerate(pictures or ()):
        if picture is not None:
            none = np.zeros(picture.depth.shape, np.int32)
            cameras.setdefault(number, (picture.camera, none))[1][picture.depth > 0] += 1


class _Known:
    """Cells with surface in any of the frames added so far, and the sums of the normals there."""

    def __init__(self) -> None:
        self._keys, self._sums = np.zeros(0, np.int64), np.zeros((0, 3), np.float32)
        self._new = list[tuple[Int64[np.ndarray, " C"], Float32[np.ndarray, "C 3"]]]()

    def add(self, cells: Int64[np.ndarray, " C"], normals: Float32[np.ndarray, "C 3"]) -> None:
        """Add the cells in which a frame has surface, and the sums of its normals there."""
        self._new.append((cells, normals))
        if len(self._new) == _TOGETHER:  # merging after every frame would sort all keys each time
            self._take()

    def places(self) -> tuple[Keys, Float64[np.ndarray, "P 3"]]:
        """Return the sorted keys of the cells, and the mean normals there, of unit length; 0 where they cancel."""
        self._take()
        length = np.linalg.norm(self._sums, axis=1, keepdims=True)
        return self._keys, (self._sums / np.where(length > 0, length, 1)).astype(np.float64)

    def _take(self) -> None:
        before = (self._keys, self._sums)
        self._keys = distinct(np.concatenate([self._keys, *(cells for cells, _ in self._new)]))
        self._sums = np.zeros((len(self._keys), 3), np.float32)
        for cells, normals in (before, *self._new):
            self._sums[np.searchsorted(self._keys, cells)] += normals
        self._new.clear()
