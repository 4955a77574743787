"""What happens at each place of a scene over time: occupied, seen free, or not known (free-space carving).

In: some frames of a scene, spread over the sequence, and views of them. Out: for every cell that any of the frames has
surface in, in how many frames there is surface in or beside it, in how many views see past it, and how long it stayed.

A cell beside surface counts as occupied, whatever is seen: noise moves a surface from cell to cell, and rays graze it.
Views stand where no camera did, and look through the holes that shadows leave in a surface. So where cameras usually
measure something, a cell is seen free only if one of them, too, measured something past it; and it is, whatever views
see, if a camera did so in the pixels around, too: what comes close to a camera is often in no other view.
Memory does not grow with the number of frames: what happens in a frame is counted, and forgotten.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Bool, Float32, Float64, Int32, Int64, UInt16

from ...errors import InputError
from ...geometry.cameras import PinholeCamera
from ...geometry.depth import DepthPicture
from ...geometry.raycast import Rays
from ...geometry.topology import face_normals
from ...geometry.voxels import Lattice, distinct, neighbours, spread
from ...types import Frames, Mesh, evenly

_DEEPEST = 65_535  # of a stored depth; 0: nothing seen
_FINENESS = 16  # units of a stored depth in a cell
_TOGETHER = 32  # frames whose pictures are in memory together: what each view sees of the places is worked out once


@dataclass(frozen=True, slots=True)
class PlacesOptions:
    """How finely a scene is looked at, and what counts as seen free."""

    frames: int = 16  # looked at, at least, spread over the sequence, or all where it has fewer
    rate: float = 4.0  # 1/s, looked at, at least: who is there only between frames that are looked at is not carved
    past: float = 2.0  # cells that a view must see past a cell's middle
    views: int = 2  # that must see past it

    def __post_init__(self) -> None:
        if self.frames < 2 or not 0 <= self.rate < math.inf or not self.past > 0 or self.views < 1:
            text = f"{self.frames} frames, {self.rate:g} a second, past {self.past:g}, {self.views} views"
            raise InputError(f"{text}: give >= 2, from 0 on, > 0, >= 1")

    def chosen(self, count: int, frame_rate: float) -> list[int]:
        """The frames to look at of a sequence of `count`."""
        return evenly(count, max(self.frames, math.ceil((count - 1) / frame_rate * self.rate) + 1))


Tell = Callable[[float], None]  # the share of the work that is done


def nobody(share: float) -> None:
    """Hears how far the work is, and does nothing."""
    del share


@dataclass(frozen=True, slots=True)
class Watched:
    """Frames, the views that look at them, and what depth cameras measured in each of them, where that is known."""

    frames: Sequence[Mesh] | Frames
    views: Sequence[PinholeCamera]
    pictures: Callable[[int], list[DepthPicture | None]] | None = None  # of a frame, a camera each
    tell: Tell = nobody  # who hears how far `find_places` is

    def look(self, number: int, lattice: Lattice) -> _Look:
        """What is known of one frame."""
        points, _ = spread(mesh := self.frames[number], 1.5 * lattice.size)
        return self.seen(number, mesh, distinct(lattice.keys(points)), lattice)

    def seen(self, number: int, mesh: Mesh, cells: Int64[np.ndarray, " C"], lattice: Lattice) -> _Look:
        """As `look`, of a frame that has been read and whose cells are known."""
        rays = Rays(mesh)
        depths = [_stored(rays, view, lattice.size / _FINENESS) for view in self.views]
        return _Look(cells, depths, None if self.pictures is None else self.pictures(number))


@dataclass(frozen=True, slots=True)
class Stay:
    """The time from which on there is surface at each place without it being seen free any more, by frames looked at.

    Or, in reverse, until which.
    """

    first: Int32[np.ndarray, " P"]  # that has surface; -1 where the place is never seen free, or has no surface then
    count: Int32[np.ndarray, " P"]  # frames that have surface in that time


class Tally:
    """What has happened at each of P places in the frames so far."""

    def __init__(self, places: int) -> None:
        self.frames = 0
        self.occupied, self.free = np.zeros(places, np.int32), np.zeros(places, np.int32)  # frames
        none = np.full(places, -1, np.int32)
        self._after, self._before = (
            Stay(none, np.zeros(places, np.int32)),
            Stay(none.copy(), np.zeros(places, np.int32)),
        )

    def add(self, occupied: Bool[np.ndarray, " P"], free: Bool[np.ndarray, " P"]) -> None:
        """Counts the next frame."""
        early = occupied & (self.free == 0)
        self._before.first[early] = self.frames
        self._before.count[early] += 1
        self._after.first[free] = -1
        self._after.count[free] = 0
        self._after.first[occupied & (self._after.first < 0)] = self.frames
        self._after.count[occupied] += 1
        self.occupied += occupied
        self.free += free
        self.frames += 1

    @property
    def after(self) -> Stay:
        """Since each place was seen free for the last time."""
        seen = self.free > 0
        return Stay(np.where(seen, self._after.first, -1).astype(np.int32), self._after.count)

    @property
    def before(self) -> Stay:
        """Until each place was seen free for the first time; frames count from the last one, backwards."""
        known = (self.free > 0) & (self._before.first >= 0)
        return Stay(np.where(known, self.frames - 1 - self._before.first, -1).astype(np.int32), self._before.count)


@dataclass(frozen=True, slots=True)
class Eye:
    """A depth camera that stands still."""

    camera: PinholeCamera
    sees: Bool[np.ndarray, "H W"]  # where it measures something in half of the frames at least


@dataclass(frozen=True, slots=True)
class Places:
    """Cells of a scene, and what happened there in the frames that were looked at."""

    lattice: Lattice
    keys: Int64[np.ndarray, " P"]  # sorted
    beside: Int32[np.ndarray, "P 26"]  # numbers of the cells around each; its own for none
    normals: Float64[np.ndarray, "P 3"]  # mean of what was there, of unit length; 0 where they cancel
    tally: Tally
    eyes: dict[int, Eye] = field(default_factory=dict)  # by the number of the camera

    @property
    def free_share(self) -> Float64[np.ndarray, " P"]:
        """The share of the frames that know a place in which it is seen free."""
        return self.tally.free / np.maximum(self.tally.free + self.tally.occupied, 1)

    @property
    def middles(self) -> Float64[np.ndarray, "P 3"]:
        """The middles of the cells."""
        return self.lattice.centers(self.keys)


@dataclass(frozen=True, slots=True)
class _Look:
    """What is known of one frame."""

    cells: Int64[np.ndarray, " C"]  # keys of those that it has surface in, sorted
    depths: list[UInt16[np.ndarray, "H W"]]  # of each view, in units
    measured: list[DepthPicture | None] | None  # by each camera; None where nothing is known of cameras


def find_places(watched: Watched, lattice: Lattice, options: PlacesOptions = PlacesOptions()) -> Places:
    """The places of a scene; one frame in memory at a time. What comes after the first 32 frames is read twice.

    About 1 s of CPU for a frame of 500,000 faces.
    """
    passes = len(watched.frames) + max(0, len(watched.frames) - _TOGETHER)
    first, known, cameras = list[_Look](), _Known(), _Cameras()
    for number in range(len(watched.frames)):
        own, normals = _cells(mesh := watched.frames[number], lattice)
        known.add(own, normals)
        if number < _TOGETHER:
            first.append(watched.seen(number, mesh, own, lattice))
            cameras.add(first[-1].measured)
        elif watched.pictures is not None:
            cameras.add(watched.pictures(number))
        watched.tell((number + 1) / passes)
    keys, normals = known.places()
    places = Places(lattice, keys, neighbours(keys), normals, Tally(len(keys)), cameras.eyes())
    for occupied, free in _seen(first, places, watched.views, options):
        places.tally.add(occupied, free)
    first.clear()
    for occupied, free in look(watched, range(_TOGETHER, len(watched.frames)), places, options):
        places.tally.add(occupied, free)
        watched.tell((len(watched.frames) - _TOGETHER + places.tally.frames) / passes)
    return places


def look(
    watched: Watched, numbers: range, places: Places, options: PlacesOptions = PlacesOptions()
) -> Iterator[tuple[Bool[np.ndarray, " P"], Bool[np.ndarray, " P"]]]:
    """Where each of some frames has surface in or beside a place, and where not, and views see past it."""
    for start in range(0, len(numbers), _TOGETHER):
        together = (watched.look(number, places.lattice) for number in numbers[start : start + _TOGETHER])
        yield from _seen(list(together), places, watched.views, options)


def _seen(
    looks: Sequence[_Look], places: Places, views: Sequence[PinholeCamera], options: PlacesOptions
) -> Iterator[tuple[Bool[np.ndarray, " P"], Bool[np.ndarray, " P"]]]:
    """As `look`, of frames whose pictures are in memory."""
    seen = np.zeros((len(looks), len(places.keys)), np.uint8)
    middles, size = places.middles, places.lattice.size
    for number, view in enumerate(views):
        pixels, inside, depth = _projected(view, middles)
        limit = (depth + options.past * size) / (size / _FINENESS)
        for row, one in zip(seen, looks, strict=True):
            row[inside[one.depths[number].reshape(-1)[pixels] > limit]] += 1
    sensed = _sensed(looks, places, options.past * size)
    for row, one, (doubtful, clear) in zip(seen, looks, sensed, strict=True):
        occupied = _near(places.keys, places.beside, one.cells)
        yield occupied, ((row >= options.views) & ~doubtful | clear) & ~occupied


def _sensed(
    looks: Sequence[_Look], places: Places, reach: float
) -> Iterator[tuple[Bool[np.ndarray, " P"], Bool[np.ndarray, " P"]]]:
    """Where each frame's cameras should have measured something past a place, m, and did not; where some surely did."""
    middles = places.middles
    at = {number: _projected(eye.camera, middles) for number, eye in places.eyes.items()}
    for one in looks:
        expected, past, clear = np.zeros((3, len(middles)), bool)
        for number, eye in places.eyes.items():
            pixels, inside, depth = at[number]
            expected[inside[eye.sees.reshape(-1)[pixels]]] = True
            if one.measured and (picture := one.measured[number]) is not None:
                found = picture.depth.reshape(-1)[pixels] * picture.unit
                expected[inside[found > 0]] = True
                past[inside[found > depth + reach]] = True
                least = _least_around(picture.depth).reshape(-1)[pixels] * picture.unit
                clear[inside[least > depth + reach]] = True
        yield expected & ~past, clear


def _least_around(depth: np.ndarray) -> np.ndarray:
    """The least of each pixel and those around it; 0 where one of them measured nothing."""
    from scipy.ndimage import minimum_filter

    return np.asarray(minimum_filter(depth, 3))


class _Cameras:
    """The cameras of the frames so far, and in how many frames each of their pixels measures something."""

    def __init__(self) -> None:
        self._frames = 0
        self._counts: dict[int, tuple[PinholeCamera, Int32[np.ndarray, "H W"]]] = {}

    def add(self, pictures: Sequence[DepthPicture | None] | None) -> None:
        """Takes in a frame."""
        self._frames += 1
        for number, picture in enumerate(pictures or ()):
            if picture is not None:
                none = np.zeros(picture.depth.shape, np.int32)
                self._counts.setdefault(number, (picture.camera, none))[1][picture.depth > 0] += 1

    def eyes(self) -> dict[int, Eye]:
        """Those that are known, by number."""
        return {number: Eye(camera, 2 * count >= self._frames) for number, (camera, count) in self._counts.items()}


class _Known:
    """The cells that any of the frames so far has surface in, and the sums of its normals there."""

    def __init__(self) -> None:
        self._keys, self._sums = np.zeros(0, np.int64), np.zeros((0, 3), np.float32)
        self._new = list[tuple[Int64[np.ndarray, " C"], Float32[np.ndarray, "C 3"]]]()

    def add(self, cells: Int64[np.ndarray, " C"], normals: Float32[np.ndarray, "C 3"]) -> None:
        """Takes in a frame."""
        self._new.append((cells, normals))
        if len(self._new) == _TOGETHER:  # sorting all keys anew for each frame would take longer
            self._take()

    def places(self) -> tuple[Int64[np.ndarray, " P"], Float64[np.ndarray, "P 3"]]:
        """The keys of the cells, sorted, and the mean normals there, of unit length; 0 where they cancel."""
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


def _cells(mesh: Mesh, lattice: Lattice) -> tuple[Int64[np.ndarray, " C"], Float32[np.ndarray, "C 3"]]:
    """The cells that a mesh has surface in, sorted, and the sum of its normals there."""
    points, faces = spread(mesh, 1.5 * lattice.size)
    keys, cell = np.unique(lattice.keys(points), return_inverse=True)
    normals = face_normals(mesh)[0][faces]
    sums = [np.bincount(cell.reshape(-1), normals[:, axis], len(keys)) for axis in range(3)]
    return keys, np.stack(sums, axis=1).astype(np.float32)


def _stored(rays: Rays, view: PinholeCamera, unit: float) -> UInt16[np.ndarray, "H W"]:
    """Depth in units; 0 where nothing is met, or the back of something: what is there is not known."""
    seen = rays.look(view)
    depth = np.where(np.isfinite(seen.depth) & ~rays.backs(view, seen), seen.depth, 0.0)
    return np.clip(np.rint(depth / unit), 0, _DEEPEST).astype(np.uint16)


def _near(
    keys: Int64[np.ndarray, " P"], beside: Int32[np.ndarray, "P 26"], own: Int64[np.ndarray, " C"]
) -> Bool[np.ndarray, " P"]:
    """The cells in or beside which a frame has surface."""
    there = np.zeros(len(keys), bool)
    there[np.searchsorted(keys, own)] = True
    near = there.copy()
    near[beside[there].reshape(-1)] = True
    return near


def _projected(
    view: PinholeCamera, points: Float64[np.ndarray, "P 3"]
) -> tuple[Int64[np.ndarray, " N"], Int64[np.ndarray, " N"], Float64[np.ndarray, " N"]]:
    """Pixels that the points in the picture fall on, the numbers of these points, and their depths, m."""
    local = points @ view.extrinsic[:3, :3].T + view.extrinsic[:3, 3]
    with np.errstate(invalid="ignore"):
        columns, rows = np.floor(view.project(local)).T
    inside = np.flatnonzero((columns >= 0) & (columns < view.width) & (rows >= 0) & (rows < view.height))
    pixels = rows[inside].astype(np.int64) * view.width + columns[inside].astype(np.int64)
    return pixels, inside, local[inside, 2]
