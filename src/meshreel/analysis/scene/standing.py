"""Surface that rests, told from surface that moves slowly, and the noise of what rests, place by place.

In: frames. Out: whether they are a scene, and the `Standing` of its regions. Noise is new in every frame: surface that
rests is as far from its place in the next frame as in the last one. Motion goes on: a surface that moves slowly is near
its place in the next frame, and far from it later. So noise is told from the second differences of three successive
frames, in which steady motion cancels, and surface rests where frames far apart differ hardly more than that.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from jaxtyping import Bool, Float64, Int64
from scipy.spatial import cKDTree

from ...geometry.cameras import Camera
from ...geometry.closest_points import Surface, area_samples
from ...geometry.depth import is_carried, looked_at
from ...geometry.derived_sequences import CapturedSequence
from ...geometry.threads import mapped
from ...geometry.topology import (
    border_edges,
    components,
    drop_unreferenced,
    edge_lengths,
    face_means,
    face_normals,
    vertex_normals,
)
from ...geometry.voxels import Lattice, around, contains, distinct, spread
from ...geometry.work import passed
from ...types import Frames, Mesh, evenly
from ..survey import UNLIKE, check

PROBES = 4  # frames inspected, spread over the sequence, and the frames before and after each (guess)
SHARE = 0.6  # smallest share of a frame's surface that stands still in a scene (guess)
CELLS = 200  # cells along a frame's diagonal: 4 cm in a room (guess)
BORDER = 1.0  # diagonals, least length of the borders of an open surface; holes of a captured body have less (guess)
COARSEST = 32  # smallest number of median edge lengths along the diagonal of a captured room (guess)
SAMPLES = 20_000  # vertices of a frame that are measured (guess)
REGION = 8.0  # edge lengths, or distances of samples, along a region, in which a median says something (guess)
KNOWN = 0.5  # least share of the surface of which it is known whether it rests (guess)
FEWEST = 20  # measurements in a region that is judged (guess)
RESTS = 3.0  # times the noise of its region: rooms have 1 to 1.5, 2.6 at most in nine of ten regions; motion 5 to 30
SMOOTH = 8.0  # the same over noise from which what a region does as a whole is left out, where no sensor is known
AROUND, ROUGHER = 16, 3.0  # regions around one, and times their usual noise that its own may be (guess)
TAIL = 4.0  # standard deviations, by the median, beyond which a distance is no noise (guess)
NEAREST = 8  # cells whose noise a place has (guess)
COMPARED = 64  # cells in about the direction of one, with which its noise is compared (guess)
LEAST_SPREAD = 0.02  # of logarithms of depths that tell a power (guess)
MOST_POWER = 2.0  # of the depth: the noise of disparities; that of times of flight has less (guess)
BY_DEPTH, ELSEWHERE = 0.5, 100.0  # rad, as unlike as e times the depth is, and as another camera (guess)
EXACT = 1e-6  # diagonals: the noise of frames that are equal (guess)
SAME, MOST = 2e-5, 0.9  # diagonals, within which clean surface is in one place; share of it without noise (guess)
SECOND, MEDIAN = 6**0.5, 0.6745  # deviation of a second difference, and median of an absolute value, in deviations


@dataclass(frozen=True, slots=True)
class Standing:
    """Regions of a sequence's surface: their noise, and by how much they differ from one time to another."""

    lattice: Lattice  # whose cells are the regions
    keys: Int64[np.ndarray, " R"]  # sorted
    noise: Float64[np.ndarray, " R"]  # m, standard deviation
    change: Float64[np.ndarray, " R"]  # m, the same of the surface at other times
    area: Float64[np.ndarray, " R"]  # m^2, in a frame, of surface whose noise is known
    sensed: bool  # by sensors that are known
    diagonal: float  # m, of the largest frame

    def with_pose_errors(self) -> Standing:
        """Return the regions as a camera that moves sees them: what rests is off by its pose and its side, too.

        In a scene most surface rests, so that half of all regions tell by how much, up to a cell.
        """
        usual = min(float(np.median(self.change)), self.diagonal / CELLS) if len(self.change) else 0.0
        return replace(self, noise=np.maximum(self.noise, usual))

    @property
    def same(self) -> float:
        """Distance, m, within which surface that rests is in the same place in all frames; 0 where it has noise."""
        noise, found = self.noise[self.rests], SAME * self.diagonal
        return found if not self.sensed and len(noise) and np.quantile(noise, MOST) <= EXACT * self.diagonal else 0.0

    @property
    def rests(self) -> Bool[np.ndarray, " R"]:
        return self.change <= RESTS * self.noise

    @property
    def usual_change(self) -> float:
        """Median distance, m, of surface that rests from where it is in another frame, in the median region."""
        change = self.change[self.rests] if self.rests.any() else self.change
        return 2**0.5 * MEDIAN * float(np.median(change)) if len(change) else 0.0

    def moves(self, mesh: Mesh) -> Bool[np.ndarray, " F"]:
        """Return True for each face of a mesh in a region that does not rest."""
        cells = self.lattice.keys(face_means(mesh.vertices, mesh.faces))
        at = np.minimum(np.searchsorted(self.keys, cells), max(len(self.keys) - 1, 0))
        return (self.keys[at] == cells) & ~self.rests[at] if len(self.keys) else np.zeros(len(cells), bool)


def scene_standing(frames: Frames) -> Standing | None:
    """Measure what stands still in a sequence that has a background; None for others, empty ones and single frames.

    Raises InputError if one of the few inspected frames is invalid.
    """

    def checked(number: int) -> Mesh:
        passed("look")
        check(mesh := frames[number], f"frame {number}")
        return mesh if mesh.is_empty else drop_unreferenced(mesh)

    probes = evenly(len(frames), PROBES)
    numbers, meshes = list[int](), list[Mesh]()
    for number, mesh in zip(probes, mapped(checked, probes), strict=True):
        if not mesh.is_empty:
            numbers.append(number)
            meshes.append(mesh)
    sizes = [mesh.diagonal for mesh in meshes]
    if len(meshes) < 2 or sizes[0] == 0 or max(sizes) > UNLIKE * min(sizes):
        return None
    ends = meshes[0].vertices[border_edges(meshes[0])]
    is_open = np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1).sum() > BORDER * sizes[0]
    if not is_open or np.median(edge_lengths(meshes[0])) * COARSEST > sizes[0]:
        return None
    lattice = Lattice.near(meshes[0], sizes[0] / CELLS)
    cells = [distinct(lattice.keys(spread(mesh, lattice.size)[0])) for mesh in meshes]
    wide = [around(occupied) for occupied in cells]
    depth = frames.depth if isinstance(frames, CapturedSequence) else None
    is_moving = depth is not None and is_carried(depth.__getitem__, len(frames))

    def shared(occupied: Int64[np.ndarray, " C"], other: int) -> float:
        """Return the share of cells that another frame has, too, of those that its cameras look at."""
        there = contains(wide[other], occupied)
        if depth is not None and is_moving:
            there = there[looked_at(depth[numbers[other]], lattice.centers(occupied))]
        return float(there.mean()) if len(there) else 1.0

    still = [np.mean([shared(occupied, other) for other in range(len(wide))]) for occupied in cells]
    if float(np.median(still)) < SHARE:
        return None
    found, whole = standing(frames), float(np.mean([face_normals(mesh)[1].sum() for mesh in meshes]))
    rests, known = float(found.area[found.rests].sum()), float(found.area.sum())
    # What a camera that moves saw once, nobody can judge: it is a part of the scene where what it saw twice is.
    return found if rests >= SHARE * known and known >= (0 if is_moving else KNOWN) * whole else None


def standing(frames: Frames) -> Standing:
    """Measure the regions of a sequence's surface in `PROBES` frames, and in the frames before and after each."""
    last, some = len(frames) - 1, evenly(len(frames), PROBES)
    middles = sorted({min(max(number, 1), last - 1) for number in some} if last > 2 else some)
    found = mapped(lambda number: None if (mesh := frames[number]).is_empty else _Probe.of(mesh), middles)
    probes = {number: probe for number, probe in zip(middles, found, strict=True) if probe is not None}
    asked = dict[int, list[tuple[_Probe, bool]]]()  # by frame: probes whose samples are looked for, as at another time
    for middle, probe in probes.items():
        for number in sorted({max(middle - 1, 0), min(middle + 1, last)} - {middle}):
            asked.setdefault(number, []).append((probe, False))
        for number in probes.keys() - {middle}:
            asked.setdefault(number, []).append((probe, True))
    order = sorted(asked.items())

    def offsets(number: int, those: list[tuple[_Probe, bool]]) -> list[Float64[np.ndarray, " _"]]:
        passed("look")
        surface = None if (mesh := frames[number]).is_empty else Surface(mesh)
        return [] if surface is None else [probe.offsets(surface) for probe, _ in those]

    for (_, those), own in zip(order, mapped(offsets, *zip(*order, strict=True)) if order else [], strict=True):
        for (probe, is_far), each in zip(those, own, strict=False):
            (probe.far if is_far else probe.beside).append(each)
    # Two frames tell nothing of noise; where a sensor is known, too, only what a region does on its own counts then.
    depth = frames.depth if isinstance(frames, CapturedSequence) else None
    found_regions = _regions(
        [probe for probe in probes.values() if probe.beside], len(frames) > 2 and depth is not None
    )
    return (
        found_regions.with_pose_errors()
        if depth is not None and is_carried(depth.__getitem__, len(frames))
        else found_regions
    )


@dataclass(frozen=True, slots=True)
class _Probe:
    """Samples of a frame, and how far the surface of other frames is from them, NaN where these have none there."""

    points: Float64[np.ndarray, "N 3"]
    normals: Float64[np.ndarray, "N 3"]
    pieces: Int64[np.ndarray, " N"]  # number of the connected piece that each is on
    area: float  # m^2, of a sample
    size: float  # m, of regions in which there are enough samples
    diagonal: float  # m
    beside: list[Float64[np.ndarray, " N"]]  # in the frames before and after, m, positive along the normal
    far: list[Float64[np.ndarray, " N"]]  # in frames at other times

    @staticmethod
    def of(mesh: Mesh) -> _Probe:
        mesh = drop_unreferenced(mesh)
        chosen, lengths = area_samples(mesh, SAMPLES), edge_lengths(mesh)
        usual = float(np.median(lengths[lengths > 0])) if lengths.any() else 1.0
        size, area = REGION * usual * max(1.0, len(mesh.vertices) / len(chosen)) ** 0.5, face_normals(mesh)[1].sum()
        normals, pieces = vertex_normals(mesh)[chosen], components(mesh.faces, len(mesh.vertices))[chosen]
        return _Probe(mesh.vertices[chosen], normals, pieces, area / len(chosen), size, mesh.diagonal, [], [])

    def offsets(self, surface: Surface) -> Float64[np.ndarray, " N"]:
        hits = surface.closest(self.points)
        ways = hits.points - self.points
        found = np.copysign(np.linalg.norm(ways, axis=1), (ways * self.normals).sum(axis=1))
        found[surface.past_border(hits) & (np.abs(found) > EXACT * self.diagonal)] = np.nan
        return found


def _regions(probes: list[_Probe], sensed: bool) -> Standing:
    """Return the regions of some frames; where sensors are known, noise may be what a region does as a whole."""
    if not probes:
        none = np.zeros(0)
        return Standing(Lattice(np.zeros(3), 1.0), np.zeros(0, np.int64), none, none, none, sensed, 0.0)
    points, exact = np.concatenate([probe.points for probe in probes]), EXACT * max(p.diagonal for p in probes)
    lattice = Lattice(np.round(points[0], 6), max(probe.size for probe in probes))
    keys, region = np.unique(lattice.keys(points), return_inverse=True)
    count = len(keys)
    each = np.split(region, np.cumsum([len(p.points) for p in probes])[:-1])
    # Where there is one neighbour in time only, as in a sequence of two frames, its offset counts.
    seconds = [sum(p.beside, np.zeros(len(p.points))) * (3**0.5 if len(p.beside) == 1 else 1.0) for p in probes]
    second, far = np.concatenate(seconds), np.concatenate([np.zeros(0), *(one for p in probes for one in p.far)])
    areas = np.concatenate([np.full(len(p.points), p.area) for p in probes]) / len(probes)
    area = np.bincount(region, np.where(np.isfinite(second), areas, 0), count)  # of what is known
    noise, known = _deviations(second, region, count, SECOND)
    again = np.concatenate([np.zeros(0, np.int64), *(own for p, own in zip(probes, each, strict=True) for _ in p.far)])
    change, seen = _deviations(far, again, count, 2**0.5)
    keep = np.flatnonzero(known & seen)
    if not sensed:
        # What pieces do as a whole is none, either: leaves that flutter are each as stiff as a wall.
        window = np.repeat(np.arange(len(probes)), [len(p.points) for p in probes])
        labels = np.stack([region, window, np.concatenate([p.pieces for p in probes])], axis=1)
        group = np.unique(labels, axis=0, return_inverse=True)[1].reshape(-1)
        own = second - _as_a_whole(points, second, group, int(group.max()) + 1)
        smooth, told = _deviations(own, region, count, SECOND)
        noise[told] = np.minimum(noise, smooth * SMOOTH / RESTS)[told]
        if len(keep):
            middles = lattice.centers(keys[keep])
            near = cKDTree(middles).query(middles, k=np.arange(1, min(AROUND, len(keep)) + 1))[1]
            noise[keep] = np.minimum(noise[keep], ROUGHER * np.median(noise[keep][near], axis=1))
    noise = np.maximum(noise, exact)
    return Standing(lattice, keys[keep], noise[keep], change[keep], area[keep], sensed, exact / EXACT)


def _deviations(
    values: Float64[np.ndarray, " N"], region: Int64[np.ndarray, " N"], count: int, times: float
) -> tuple[Float64[np.ndarray, " R"], Bool[np.ndarray, " R"]]:
    """Return the deviation of each region's values, by the median, over `times`, and which regions have enough."""
    known = np.isfinite(values)
    found, size = np.zeros(count), np.bincount(region[known], minlength=count)
    order = np.lexsort((np.abs(values[known]), region[known]))
    ends = np.cumsum(size)
    enough = size >= FEWEST
    found[enough] = np.abs(values[known])[order][(ends - size + size // 2)[enough]]
    return found / (MEDIAN * times), enough


def _as_a_whole(
    points: Float64[np.ndarray, "N 3"], values: Float64[np.ndarray, " N"], group: Int64[np.ndarray, " N"], count: int
) -> Float64[np.ndarray, " N"]:
    """Return the values of the linear function of place that fits those of each group best, damped a little.

    In a group of fewer than `FEWEST` this is their mean; NaN for one alone.
    """
    known = np.isfinite(values)
    sizes = np.bincount(group[known], minlength=count)
    weight = np.maximum(sizes, 1)

    def mean(some: Iterable[float] | Float64[np.ndarray, " N"]) -> Float64[np.ndarray, " G"]:
        return np.bincount(group[known], np.asarray(some)[known], count) / weight

    offset = points - np.stack([mean(points[:, axis]) for axis in range(3)], axis=1)[group]
    rest = values - mean(values)[group]
    moments = np.array([[mean(offset[:, i] * offset[:, j]) for j in range(3)] for i in range(3)]).transpose(2, 0, 1)
    damped = moments + (1e-3 * np.trace(moments, axis1=1, axis2=2) + 1e-30)[:, None, None] * np.eye(3)
    right = np.stack([mean(offset[:, i] * np.where(known, rest, 0)) for i in range(3)], axis=1)
    slopes = np.linalg.solve(damped, right[..., None])[..., 0] * (sizes >= FEWEST)[:, None]
    return np.where(sizes > 1, mean(values), np.nan)[group] + (offset * slopes[group]).sum(axis=1)


@dataclass(frozen=True)  # no slots: cached properties need a dict
class LocalNoise:
    """Distances of surface from the truth, by place: measured where surface rests, elsewhere as at places most alike.

    What a frame is off as a whole is no noise of a shape: a sensor may measure everything 2 cm too far in one frame and
    too near in the next, and each to a millimetre.
    """

    places: Float64[np.ndarray, "C 3"]  # m
    rms: Float64[np.ndarray, " C"]  # m, of a shape, without its tails
    off: Float64[np.ndarray, " C"]  # m, deviation from the place, with what a frame is off as a whole
    cameras: tuple[Camera, ...] = ()  # depth cameras that stand still; without them, near places are alike

    @staticmethod
    def of(
        places: list[Float64[np.ndarray, "_ 3"]],
        gaps: list[Float64[np.ndarray, " _"]],
        fine: float,
        wide: float,
        cameras: tuple[Camera, ...] = (),
    ) -> LocalNoise:
        """Measure cells of size `fine` (m), from the signed distances of frames from where their surface rests.

        A frame is off as a whole in cells of size `wide` (m). Far beyond the usual distance, surface is another.
        """
        points, gap = np.concatenate([np.zeros((0, 3)), *places]), np.concatenate([np.zeros(0), *gaps])
        if not len(points):
            return LocalNoise(points, gap, gap)
        frame = np.repeat(np.arange(len(places)), [len(some) for some in places])
        around = np.unique(Lattice(np.round(points[0], 6), wide).keys(points), return_inverse=True)[1]
        group = around * len(places) + frame
        shape = gap - np.nan_to_num(_as_a_whole(points, gap, group, int(group.max()) + 1))
        lattice = Lattice(np.round(points[0], 6), fine)
        keys, cell = np.unique(lattice.keys(points), return_inverse=True)
        if (np.bincount(cell) < FEWEST).all():  # too few anywhere: all places are one
            keys, cell = keys[len(keys) // 2][None], np.zeros_like(cell)
        off, enough = _deviations(gap, cell, len(keys), 1.0)
        enough |= len(keys) == 1
        deviation, _ = _deviations(shape, cell, len(keys), 1.0)
        usual = np.abs(shape) <= TAIL * deviation[cell]
        squares = np.bincount(cell[usual], shape[usual] ** 2, len(keys))
        rms = np.sqrt(squares / np.maximum(np.bincount(cell[usual], minlength=len(keys)), 1))
        return LocalNoise(lattice.centers(keys)[enough], rms[enough], off[enough], cameras)

    @property
    def mean(self) -> float:
        """RMS over all places, m."""
        return float(np.sqrt((self.rms**2).mean())) if len(self.rms) else 0.0

    def at(self, points: Float64[np.ndarray, "N 3"]) -> Float64[np.ndarray, "2 N"]:
        """Return `rms` and `off` at points, m: the medians of the places most like each.

        What moves is nearer to a camera than what it hides: noise is taken to its depth by the power that places show.
        """
        if not len(self.rms):
            return np.zeros((2, len(points)))
        known, asked = self._known, self._conditions(points)
        near = self._tree.query(asked, k=np.arange(1, min(NEAREST, len(self.rms)) + 1))[1]
        times = np.ones(near.shape)
        if self.cameras:
            times = np.exp(self._power * (asked[:, 3, None] - known[near, 3]) / BY_DEPTH)
        return np.stack([np.median(some[near] * times, axis=1) for some in (self.rms, self.off)])

    @cached_property
    def _known(self) -> Float64[np.ndarray, "C D"]:
        """The conditions of all places."""
        return self._conditions(self.places)

    @cached_property
    def _tree(self) -> Any:
        """Search tree of the conditions of all places."""
        return cKDTree(self._known)

    @cached_property
    def _power(self) -> float:
        """The power of the depth with which noise grows, by places in nearly the same direction."""
        known = np.flatnonzero(self.rms > 0)
        if len(known) < 2:
            return 0.0
        ways, depths = np.delete(self._known[known], 3, axis=1), self._known[known, 3] / BY_DEPTH
        near = cKDTree(ways).query(ways, k=np.arange(1, min(COMPARED, len(known)) + 1))[1]
        farther = depths[near] - depths[:, None]
        noisier = np.log(self.rms[known])[near] - np.log(self.rms[known])[:, None]
        square = float((farther**2).sum())
        enough = square > LEAST_SPREAD**2 * farther.size
        return float(np.clip((farther * noisier).sum() / square, 0.0, MOST_POWER)) if enough else 0.0

    def _conditions(self, points: Float64[np.ndarray, "N 3"]) -> Float64[np.ndarray, "N D"]:
        """Return on what the noise of a place depends: where in a picture it is, and at which depth."""
        if not self.cameras:
            return points
        own = np.stack([camera.local(points) for camera in self.cameras])
        ranges = np.maximum(np.linalg.norm(own, axis=2), 1e-9)
        nearest, each = ranges.argmin(axis=0), np.arange(len(points))
        ranges, own = ranges[nearest, each], own[nearest, each]
        depths = np.log(np.maximum(own[:, 2], 1e-9))
        return np.column_stack([own / ranges[:, None], BY_DEPTH * depths, ELSEWHERE * nearest])
