"""Poses of a rig's depth cameras, refined on what they measure: all at once, on the surface that stands still.

Points of one camera meet the planes that another one sees at the pixels they project to (Chen and Medioni 1992); one
least-squares problem has the motions of all cameras (Gauss-Newton), from poses that are right to some degrees and
centimetres. Of the motions that fit equally well it takes the smallest: what no surface fixes stays.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import combinations, permutations
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float64

from ...errors import InputError
from ...geometry import strict
from ...geometry.depth import depth_noise
from ...geometry.topology import linked
from ...io.write import replacing
from ...types import UP_AXES, Up
from ..rig.cameras import DepthCamera, posed
from ..rig.rig import Rig
from .still_view import StillView, still_view

POINTS = 20_000  # of a camera, about (guess)
REACH = (0.3, 0.15, 0.08, 0.05)  # m, of the distances that count, round by round (guess)
STEPS = 60  # of a round, at most (guess)
DONE = 1e-5  # m, of a step that ends a round (guess)
LONGEST = 0.1  # m, of a step (guess)
MOST_AHEAD = 10.0  # steps more, where they shrink slowly (guess)
ALIKE = math.cos(math.radians(40))  # least cosine between the normals of one surface in two cameras (guess)
OVERLAP = 0.02  # least share of a camera's points that lie on what another one sees (guess)
WEAK = 0.03  # of the mean curvature: directions below are tested (guess)
TRIAL = 0.04  # m, of the motion that tests a direction (guess)
RISE = 0.05  # share of the cost by which that must raise it: planes reach .04 (.09 with much noise), demo rooms .08
LEAST_COST = 1.5e-4  # below, a cost is that of rounding (guess)
APART = 0.01  # m: a pair that ends farther apart is reported (guess)
_UPRIGHT = 0.5  # largest cosine between up and the normals that are shown: floors would hide all (guess)
_SHOWN = 8000  # points of a camera, about (guess)

Poses = Float64[np.ndarray, "n 4 4"]  # camera to world, m
Step = Float64[np.ndarray, " m"]  # a motion of each camera, see `Scene`
Report = Callable[[str, int, int], None]  # a stage, how many of its rounds are done, and how many it has
Directions = Float64[np.ndarray, "m k"]  # k such motions


@dataclass(frozen=True, slots=True)
class PairDistance:
    """Distance between the surfaces that two cameras see."""

    cameras: tuple[str, str]  # names
    overlap: float  # share of the points of a camera that lie on what the other sees, the larger one of both
    before: float  # m, median distance with the poses that were given; NaN where they show no overlap
    after: float  # m, with the refined ones


@dataclass(frozen=True, slots=True)
class Calibration:
    """Refined cameras, and how well they agree."""

    views: tuple[StillView, ...]  # with the poses that were given
    cameras: tuple[DepthCamera, ...]
    pairs: tuple[PairDistance, ...]  # those that overlap at the end
    warnings: tuple[str, ...]


def refine(rig: Rig, report: Report = lambda *_: None) -> Calibration:
    """Refine the poses of a rig's depth cameras. Raises InputError where it has one, or one sees nothing still."""
    if len(rig.cameras) < 2:
        raise InputError(f"{rig.folder}: has one camera; poses are calibrated between two at least")
    views = tuple(still_view(camera, rig.looked_at(number)) for number, camera in enumerate(rig.cameras))
    for view in views:
        if not view.known.any():
            text = f"camera {view.camera.name} sees no surface that stands still"
            raise InputError(f"{rig.folder}: {text}; record more of the room, or leave the camera out")
    return refine_views(views, report)


def refine_views(views: Sequence[StillView], report: Report = lambda *_: None) -> Calibration:
    """Refine the poses of cameras on what they see."""
    start, scene = np.array([view.camera.view.pose.to_world for view in views]), Scene(views)
    poses = scene.solved(start, np.zeros((6 * len(views), 0)), partial(report, "refine"))
    if (unfixed := scene.unfixed(poses)).size:
        poses = scene.solved(start, unfixed, partial(report, "refine held"))
    cameras = tuple(posed(view.camera, pose) for view, pose in zip(views, poses, strict=True))
    first, last = scene.distances(start), scene.distances(poses)
    names = [view.camera.name for view in views]
    pairs = tuple(
        PairDistance((names[i], names[j]), share, first.get((i, j), (0.0, math.nan))[1], after)
        for (i, j), (share, after) in last.items()
    )
    remedy = "begin with better poses (--poses, --board), and check the cameras' own numbers"
    far = [(" and ".join(pair.cameras), 1000 * pair.after) for pair in pairs if pair.after > APART]
    unlike = (f"cameras {both} see surfaces {away:.0f} mm apart; {remedy}" for both, away in far)
    warnings = (*_strangers(names, list(last)), *_sliding(names, unfixed), *unlike)
    return Calibration(tuple(views), cameras, pairs, warnings)


@dataclass(frozen=True, slots=True)
class _Match:
    """Points of a camera on planes of another."""

    places: Float64[np.ndarray, "N 3"]  # m, in the world
    normals: Float64[np.ndarray, "N 3"]  # of the planes, in the world
    distances: Float64[np.ndarray, " N"]  # m, along the normals
    weights: Float64[np.ndarray, " N"]  # 1/m^2, by the noise of both depths
    near: Float64[np.ndarray, " N"]  # 1 on the plane, 0 where the distances that count end


class Scene:
    """Views of all cameras, and their agreement.

    The motion of a camera is six numbers in m: a turn about the middle of all points, times their mean distance from
    there, and a shift.
    """

    def __init__(
        self, views: Sequence[StillView], count: int = POINTS, pairs: Sequence[tuple[int, int]] | None = None
    ) -> None:
        """Take about `count` points of each view, and the pairs of views that may overlap; by default all."""
        self.views, self.pairs = views, list(combinations(range(len(views)), 2)) if pairs is None else pairs
        steps = [max(1, round(math.sqrt(view.known.sum() / count))) for view in views]
        thinned = [(view.points[::k, ::k], view.normals[::k, ::k]) for view, k in zip(views, steps, strict=True)]
        chosen = [np.isfinite(points[..., 2]) for points, _ in thinned]
        self.points = [points[some] for (points, _), some in zip(thinned, chosen, strict=True)]
        self.normals = [normals[some] for (_, normals), some in zip(thinned, chosen, strict=True)]
        given = [view.camera.view.pose.to_world for view in views]
        places = np.concatenate([_placed(pose, p) for pose, p in zip(given, self.points, strict=True)])
        self.middle = np.median(places, axis=0)
        self.size = float(np.sqrt(((places - self.middle) ** 2).sum(axis=1).mean()))  # m

    def solved(self, poses: Poses, unfixed: Directions, report: Callable[[int, int], None]) -> Poses:
        """Return the poses that fit best, from poses nearby, without motion in the unfixed directions."""
        for number, reach in enumerate(REACH):
            report(number, len(REACH))
            before = None
            for _ in range(STEPS):
                matrix, gradient = self.problem(poses, reach)
                values, vectors = strict.eigen(matrix)
                held = values <= 1e-9 * max(float(values.mean()), 1.0)  # cameras together, or without an overlap
                along = np.einsum("ab,a->b", vectors, gradient) / np.where(held, np.inf, values)
                step = -np.einsum("ab,b->a", vectors, along)
                step -= np.einsum("ak,bk,b->a", unfixed, unfixed, step)
                taken = _ahead(step, before)
                taken *= min(1.0, LONGEST / max(largest_motion(taken), 1e-12))
                poses, before = self.moved(poses, taken), (step, taken)
                if largest_motion(step) < DONE:
                    break
        report(len(REACH), len(REACH))
        return poses

    def moved(self, poses: Poses, step: Step) -> Poses:
        """Return poses after a motion of each camera."""
        motions = step.reshape(-1, 6)
        turns = strict.rotations_of(np.concatenate([np.ones((len(poses), 1)), motions[:, :3] / self.size / 2], axis=1))
        moved = poses.copy()
        moved[:, :3, :3] = strict.products(turns, poses[:, :3, :3])
        moved[:, :3, 3] = np.einsum("nab,nb->na", turns, poses[:, :3, 3] - self.middle) + self.middle + motions[:, 3:]
        return moved

    def problem(self, poses: Poses, reach: float) -> tuple[Float64[np.ndarray, "m m"], Step]:
        """Return the matrix and the gradient of the least-squares problem of small motions from these poses."""
        count = len(poses)
        matrix, gradient = np.zeros((count, 6, count, 6)), np.zeros((count, 6))
        for (i, j), ways in self.overlaps(poses, reach):
            for way, sign in zip(ways, (1, -1), strict=True):
                arms = (way.places - self.middle) / self.size
                rows = np.concatenate([np.cross(arms, way.normals), way.normals], axis=1)
                weighted = rows * (way.weights * way.near**2)[:, None]  # Tukey's weights
                block = np.einsum("na,nb->ab", weighted, rows)
                slope = sign * np.einsum("na,n->a", weighted, way.distances)
                for a, b in ((i, j), (j, i)):
                    matrix[a, :, a] += block
                    matrix[a, :, b] -= block
                gradient[i] += slope
                gradient[j] -= slope
        return matrix.reshape(6 * count, 6 * count), gradient.reshape(-1)

    def overlaps(self, poses: Poses, reach: float) -> Iterator[tuple[tuple[int, int], tuple[_Match, _Match]]]:
        """Yield the pairs of cameras that see a surface together, with the points of each on the other's planes."""
        for i, j in self.pairs:
            ways = self.match(poses, i, j, reach), self.match(poses, j, i, reach)
            if self.overlap((i, j), ways) >= OVERLAP:
                yield (i, j), ways

    def overlap(self, pair: tuple[int, int], ways: tuple[_Match, _Match]) -> float:
        """Return the share of a camera's points that lie on what the other sees, the larger one of both."""
        return max(len(way.weights) / len(self.points[k]) for way, k in zip(ways, pair, strict=True))

    def match(self, poses: Poses, one: int, other: int, reach: float) -> _Match:
        """Return the points of a camera that lie on planes of another, up to a distance of `reach`."""
        view, camera = self.views[other], self.views[other].camera.view
        across = strict.products(strict.inverse(poses[other]), poses[one])
        points = _placed(across, self.points[one])
        pixels, inside = camera.pixels(points)
        seen, normals = view.points.reshape(-1, 3)[pixels], view.normals.reshape(-1, 3)[pixels]
        distances = ((points[inside] - seen) * normals).sum(axis=1)
        turned = strict.products(self.normals[one][inside], across[:3, :3].T)
        met = (np.abs(distances) < reach) & ((turned * normals).sum(axis=1) > ALIKE)  # no NaN is
        depths = self.points[one][inside, 2][met], seen[met, 2]
        return _Match(
            _placed(poses[other], points[inside][met]),
            strict.products(normals[met], poses[other][:3, :3].T),
            distances[met],
            1 / (depth_noise(depths[0]) ** 2 + depth_noise(depths[1]) ** 2),
            1 - (distances[met] / reach) ** 2,
        )

    def unfixed(self, poses: Poses) -> Directions:
        """Return directions in which surfaces stay on each other. Each is tried: noise gives planes all normals."""
        values, vectors = strict.eigen(self.problem(poses, REACH[-1])[0])
        weak = (values > 1e-9 * max(float(values.mean()), 1.0)) & (values < WEAK * values.mean())
        rest, found = max(self.cost(poses), LEAST_COST), []
        for direction in vectors.T[weak]:
            trial = direction * (TRIAL / largest_motion(direction))
            costs = [self.cost(self.moved(poses, sign * trial)) for sign in (1, -1)]
            found += [direction] if sum(costs) / 2 - self.cost(poses) < RISE * rest else []
        return np.array(found).reshape(-1, 6 * len(poses)).T

    def cost(self, poses: Poses) -> float:
        """Return how far apart surfaces lie, 0 to 1, as the mean over points with an end (Tukey)."""
        ways = [self.match(poses, i, j, REACH[-1]) for i, j in permutations(range(len(poses)), 2)]
        total = sum(float((way.weights * (1 - way.near**3)).sum()) for way in ways)
        return total / max(sum(float(way.weights.sum()) for way in ways), 1e-12)

    def distances(self, poses: Poses) -> dict[tuple[int, int], tuple[float, float]]:
        """Return the overlap and the median distance, m, of each pair of cameras that overlap."""
        return {
            pair: (self.overlap(pair, ways), float(np.median(np.abs(np.concatenate([w.distances for w in ways])))))
            for pair, ways in self.overlaps(poses, REACH[1])
        }


def _strangers(names: Sequence[str], pairs: Sequence[tuple[int, int]]) -> Iterator[str]:
    """Yield a warning where cameras do not hang together by pairs that overlap."""
    group = linked(np.array(pairs, np.int64).reshape(-1, 2), len(names))
    parts = [[names[k] for k in np.flatnonzero(group == one).tolist()] for one in range(group.max() + 1)]
    if len(parts) > 1:
        shown = " | ".join(", ".join(part) for part in parts)
        yield f"no surface is seen from both sides of a bar: {shown}; poses across a bar are as they were given"


def _sliding(names: Sequence[str], unfixed: Directions) -> Iterator[str]:
    """Yield a warning about cameras that surfaces do not fix."""
    if unfixed.size:
        motions = unfixed.reshape(len(names), 6, -1)
        sizes = np.sqrt(((motions - motions.mean(axis=0)) ** 2).sum(axis=(1, 2)))
        shown = ", ".join(name for name, size in zip(names, sizes, strict=True) if size >= sizes.max() / 2)
        text = f"what others see too does not fix {shown}: it is one plane, or so"
        yield f"{text}; along it the poses are as they were given: put boxes where several cameras see them"


def _ahead(step: Step, before: tuple[Step, Step] | None) -> Step:
    """Return a step that goes on where steps shrink slowly (Anderson 1965); `before`: the last, solved and taken."""
    if before is None:
        return step
    last, taken = before
    change = step - last
    share = float((step * change).sum() / max(float((change**2).sum()), 1e-30))
    return step - min(max(share, -MOST_AHEAD), 0.5) * (taken + change)


def largest_motion(step: Step) -> float:
    """Return the largest motion of a camera, m."""
    return float(np.sqrt((step.reshape(-1, 6) ** 2).sum(axis=1).max()))


def _placed(pose: Float64[np.ndarray, "4 4"], points: Float64[np.ndarray, "N 3"]) -> Float64[np.ndarray, "N 3"]:
    return strict.products(points, pose[:3, :3].T) + pose[:3, 3]


def write_calibration_sheet(calibration: Calibration, up: Up, path: Path) -> None:
    """Write a PNG: the distance of each pair of cameras, and what each sees from above, before and after."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(15, 11), dpi=100, layout="constrained")
    axes = figure.subplots(2, 2, width_ratios=(2, 3))
    before = [view.camera.view.pose.to_world for view in calibration.views]
    after = [camera.view.pose.to_world for camera in calibration.cameras]
    worst = max([1.0, *(1000 * pair.after for pair in calibration.pairs)])
    for row, (when, poses) in zip(axes, (("before", before), ("after", after)), strict=True):
        _draw_distances(row[0], calibration, when, 10 * worst)
        _draw_plan(row[1], calibration, poses, np.abs(UP_AXES[up]))
        row[1].set_title(f"walls from above, m, {when}")
    axes[0, 1].legend(markerscale=12, loc="upper left", bbox_to_anchor=(1, 1))
    with replacing(path) as file:
        figure.savefig(file, format="png")


def _draw_distances(axis: Any, calibration: Calibration, when: str, limit: float) -> None:
    names = [camera.name for camera in calibration.cameras]
    table = np.full((len(names), len(names)), np.nan)
    for pair in calibration.pairs:
        i, j = (names.index(name) for name in pair.cameras)
        table[i, j] = table[j, i] = 1000 * getattr(pair, when)
    axis.imshow(table, cmap="viridis_r", vmin=0, vmax=limit)
    for i, j in np.argwhere(np.isfinite(table)):
        axis.text(j, i, f"{table[i, j]:.1f}", ha="center", va="center", color="w" if table[i, j] > limit / 2 else "k")
    axis.set(xticks=range(len(names)), yticks=range(len(names)), xticklabels=names, yticklabels=names)
    axis.set_title(f"median distance of surfaces, mm, {when}")


def _draw_plan(axis: Any, calibration: Calibration, poses: list[np.ndarray], up: Float64[np.ndarray, " 3"]) -> None:
    """Draw what stands upright, from above, a colour for each camera."""
    across = np.flatnonzero(up == 0)
    for view, pose in zip(calibration.views, poses, strict=True):
        points, normals = view.points[view.known] @ pose[:3, :3].T + pose[:3, 3], view.normals[view.known]
        places = points[np.abs(normals @ (up @ pose[:3, :3])) < _UPRIGHT][:, across]
        places = places[:: max(1, len(places) // _SHOWN)]
        axis.plot(*places.T, ".", markersize=1, label=view.camera.name)
    axis.set_aspect("equal")
