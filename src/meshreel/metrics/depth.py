"""Measures of a decoded scene by the depth pictures it was made from: surface covered, invented and lost, and flicker.

A pixel shows still surface where its depth is the usual one, and a body where it is nearer. Pixels beside a step in
depth or a hole do not count: a sensor mixes both sides there. For the flicker of a body, its motion is removed piece by
piece: the points of a frame are registered to those of the next, first all together, then in blocks of half the size
each time, point to plane. Real deformation within a block remains: compare with the flicker of the input.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Bool, Float64, Int64
from scipy.ndimage import binary_closing, binary_dilation, distance_transform_edt, label, maximum_filter, minimum_filter
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from ..geometry.cameras import Camera
from ..geometry.closest_points import Surface
from ..geometry.depth import STEP, DepthFrames, DepthPicture, apart, is_carried
from ..types import Frames, Mesh, evenly
from .comparison import Row
from .render import View, Visible
from .surface_samples import angles, interpolate, welded_normals

Mask = Bool[np.ndarray, "H W"]
Depths = Float64[np.ndarray, "H W"]  # m
ASIDE = 2  # pixels around a step or a hole that do not count (guess)
NEAR = (0.03, 0.015)  # m, and share of the depth, within which surface covers a measurement
LEAST_LOST = 0.01  # m^2, smallest connected area without coverage that counts as a lost run (guess)
USUAL = 0.95  # quantile over time of a pixel's depth that is the depth of the still scene (guess)
SELDOM = 0.2  # share of all frames: a usual depth that is measured less often is that of a body as well (guess)
SPECK = 12  # pixels: smaller areas that are nearer than usual are noise (guess)
LOOKED_AT = 60  # largest number of frames from which the usual depth is taken (guess)
FOOT = 0.3  # m around a body within which flicker is not measured: a foot is hardly nearer than the floor (guess)
LIMB = 50  # pixels, fewest of a body's lower third in a frame that shows it (guess)
ENDS = (0.02, 0.98)  # quantiles of the heights of measured points at which a body begins and ends (guess)
LOWEST = 0.1  # quantile over frames of a body's lower end: the floor that it stands on (guess)
PARTS = ("all", "still", "body")
SIZES = (4.8, 0.6, 0.3, 0.15)  # m, of the blocks, coarse to fine; the first is a whole body (guess)
ROUNDS = 4  # of registration, for each size (guess)
REACH = 0.3  # of a block's size, largest distance of a point from its match during registration (guess)
FARTHEST = 0.3  # m, upper limit of this distance
MATCHED = 0.02  # m: points that end farther from the next frame's surface are left out (guess)
SAMPLES = 4000  # largest number of a body's points that are registered (guess)
DAMPING = 1e-3  # share of a block's points, prevents sliding along a plane (guess)


@dataclass(frozen=True)  # no slots: cached properties need a dict
class Judged:
    """One camera's depth picture of one frame, the decoded surface seen from there, and masks of the pixels."""

    camera: Camera
    depth: Depths  # m, measured
    view: View  # of the decoded surface
    clear: Mask  # pixels that count
    body: Mask  # measured nearer than usual

    def of(self, part: str) -> Mask:
        """Return the pixels of one of `PARTS` that count."""
        return self.clear & {"all": np.True_, "still": ~self.body, "body": self.body}[part]

    @cached_property
    def off_body(self) -> Mask:
        """Pixels of covered still surface, farther than `FOOT` from a body."""
        still = self.of("still") & self.covered
        if not self.body.any():
            return still
        return still & (distance_transform_edt(~self.body) * self.depth > FOOT * self.camera.focal[0])

    @cached_property
    def shown(self) -> Depths:
        """Decoded depth, m; infinite where nothing was decoded."""
        depth = np.full(self.depth.shape, np.inf)
        depth[self.view.covered] = self.view.points @ self.camera.extrinsic[2, :3] + self.camera.extrinsic[2, 3]
        return depth

    @cached_property
    def near(self) -> Depths:
        """Distance within which decoded surface covers a measurement, m."""
        return np.maximum(NEAR[0], NEAR[1] * self.depth)

    @cached_property
    def covered(self) -> Mask:
        """Pixels whose measurement is on decoded surface."""
        return np.abs(self.shown - self.depth) <= self.near

    @property
    def invented(self) -> Mask:
        """Pixels in which decoded surface stands where the camera saw through."""
        return self.shown < self.depth - self.near

    @property
    def cracks(self) -> Mask:
        """Pixels in which something was measured and nothing decoded, in slits between decoded surface."""
        slits = binary_closing(self.view.covered, iterations=ASIDE) & ~self.view.covered
        return slits & (self.depth > 0)

    def lost_runs(self, part: str) -> Float64[np.ndarray, " N"]:
        """Return the areas of connected pixels that are not covered, m^2, of at least `LEAST_LOST`, largest first."""
        runs, count = label(self.of(part) & ~self.covered)
        focal = self.camera.focal[0] * self.camera.focal[1]
        areas = np.bincount(runs.reshape(-1), (self.depth**2 / focal).reshape(-1), count + 1)[1:]
        return np.sort(areas[areas >= LEAST_LOST])[::-1]

    def patch(self) -> Patch:
        """Return the decoded surface that covers measurements of a body."""
        kept = (self.of("body") & self.covered)[self.view.covered]
        return Patch(self.view.points[kept], self.view.normals[kept])


class DepthJudge:
    """The depth pictures of a recording, prepared to judge decoded frames."""

    def __init__(self, frames: DepthFrames, count: int, up: Sequence[float]) -> None:
        """Read at most `LOOKED_AT` of `count` frames for the usual depth; `up` is the direction that points up."""
        self._frames, self._up = frames, np.asarray(up, np.float64)
        samples = [frames[number] for number in evenly(count, LOOKED_AT)]
        # A pixel of a camera that moves has no usual depth, no body, and in the next frame another place.
        self.is_moving = is_carried(frames.__getitem__, count)
        self._usual = dict[int, np.ndarray]()
        for camera, pictures in enumerate(zip(*samples, strict=True)):
            depths = [picture.depth * picture.unit for picture in pictures if picture is not None]
            if depths and not self.is_moving:
                self._usual[camera] = _usual(np.stack(depths))
        heights = [self._heights(pictures) for pictures in samples]
        lows = [np.quantile(each, ENDS[0]) for each in heights if len(each) >= LIMB]
        self._floor = float(np.quantile(lows, LOWEST)) if lows else 0.0

    def of(self, frame: int, decoded: Mesh) -> dict[int, Judged]:
        """Return a frame's depth pictures by camera, compared with the decoded mesh; cameras without one are absent."""
        visible, judged = Visible(decoded), dict[int, Judged]()
        for number, picture in enumerate(self._frames[frame]):
            if picture is not None:
                camera = picture.camera
                view = visible.look(camera)
                depth, clear = picture.depth * picture.unit, clear_pixels(picture)
                judged[number] = Judged(camera, depth, view, clear, self._body(number, depth))
        return judged

    def limb(self, judged: Iterable[Judged]) -> tuple[int, int]:
        """Count a frame's pixels that show the lower third of the body, and the covered ones among them."""
        views = [(each, each.of("body")) for each in judged]
        by_view = [_points(each.camera, each.depth, body) @ self._up for each, body in views]
        heights = np.concatenate([*by_view, np.zeros(0)])
        if not len(heights):
            return 0, 0
        third = self._floor + (np.quantile(heights, ENDS[1]) - self._floor) / 3
        covered = np.concatenate([each.covered[body] for each, body in views])
        return int((heights < third).sum()), int(covered[heights < third].sum())

    def _body(self, camera: int, depth: Depths) -> Mask:
        nearer = (depth > 0) & (depth < self._usual.get(camera, 0.0) - apart(depth))
        areas = label(nearer)[0]
        return nearer & (np.bincount(areas.reshape(-1)) >= SPECK)[areas]

    def _heights(self, pictures: Sequence[DepthPicture | None]) -> Float64[np.ndarray, " N"]:
        """Return the heights of a body's measured points in a frame, m."""
        heights = [np.zeros(0)]
        for number, picture in enumerate(pictures):
            if picture is not None:
                depth = picture.depth * picture.unit
                body = self._body(number, depth) & clear_pixels(picture)
                heights.append(_points(picture.camera, depth, body) @ self._up)
        return np.concatenate(heights)


def judge(judged: DepthJudge, decoded: Frames, numbers: Iterable[int], refreshes: Collection[int] = ()) -> Row:
    """Judge decoded frames; return numbers over all of them, and under `per_frame` those of each.

    By part: the shares of pixels `covered` and `invented`, the number of `lost_runs` a frame and the area of the
    largest. `cracks` is the share of all measured pixels, those beside steps included, in slits of up to four pixels
    without decoded surface; few pixels, but conspicuous. `body_covered_worst` is that of the frame whose body is
    covered least. `limbs_shown` counts the frames that show the lower third of a body, `limbs_lost` those of them whose
    decoded mesh covers less than half of it. Between successive frames: `still_flicker_m` is the RMS change of decoded
    depth at pixels that measured still surface in both, and `body_flicker_deg` that of normals on bodies, with their
    motion removed. `refreshes` are the frames in which another background begins: its change does not count. Shares of
    nothing are None, as is flicker where a camera moves.
    """
    rows, before = list[Row](), dict[int, Judged]()
    for number in numbers:
        now = judged.of(number, decoded[number])
        follows = bool(rows) and rows[-1]["frame"] == number - 1 and not judged.is_moving
        row = _counts(list(now.values())) | _changes(before if follows else {}, now, number in refreshes)
        limb, kept = judged.limb(now.values())
        row |= {"limbs_shown": limb >= LIMB, "limbs_lost": limb >= LIMB and 2 * kept < limb}
        rows.append({"frame": number} | row)
        before = now
    sums = {name: sum(row[name] for row in rows) for name in (rows[0] if rows else ())}
    sums |= {name: max(row[name] for row in rows) for name in sums if name.endswith("largest_lost_m2")}
    rates, each = _rates(sums, len(rows)) if rows else {}, [{"frame": row["frame"]} | _rates(row, 1) for row in rows]
    if shown := [row for row in each if row["body_covered"] is not None]:
        least = min(shown, key=lambda row: row["body_covered"])
        rates |= {"body_covered_worst": least["body_covered"], "body_least_covered_frame": least["frame"]}
    return {"frames_judged": len(rows)} | rates | {"per_frame": each}


def clear_pixels(picture: DepthPicture) -> Mask:
    """Return the pixels of a depth picture that have a measurement, with no step in depth and no hole beside them."""
    depth = picture.depth.astype(np.float64)
    most, least = maximum_filter(depth, 3), minimum_filter(depth, 3)
    return ~binary_dilation((least <= 0) | (most - least > STEP * depth), iterations=ASIDE - 1)


def _counts(views: Sequence[Judged]) -> Row:
    """Return counts of a frame's pixels by part, and the number and largest area of its lost runs."""
    row: Row = {}
    for part in PARTS:
        masks = [(each.of(part), each.covered, each.invented) for each in views]
        runs = np.concatenate([*(each.lost_runs(part) for each in views), np.zeros(0)])
        row |= {
            f"{part}_pixels": sum(int(pixels.sum()) for pixels, *_ in masks),
            f"{part}_covered": sum(int((pixels & covered).sum()) for pixels, covered, _ in masks),
            f"{part}_invented": sum(int((pixels & invented).sum()) for pixels, _, invented in masks),
            f"{part}_lost_runs": len(runs),
            f"{part}_largest_lost_m2": float(runs.max(initial=0.0)),
        }
    row["measured"] = sum(int((each.depth > 0).sum()) for each in views)
    return row | {"cracks": sum(int(each.cracks.sum()) for each in views)}


def _changes(before: Mapping[int, Judged], now: Mapping[int, Judged], refreshed: bool) -> Row:
    """Return sums of squared changes from one frame to the next, and the numbers of summands."""
    pairs = [(before[camera], now[camera]) for camera in sorted(before.keys() & now.keys())]
    moved = [np.zeros(0)]
    for a, b in [] if refreshed else pairs:
        both = a.off_body & b.off_body
        moved.append(a.shown[both] - b.shown[both])
    steps, angles = np.concatenate(moved), np.zeros(0)
    if pairs:
        first, second = (Patch.join(each.patch() for each in views) for views in zip(*pairs, strict=True))
        angles = angles_after_motion(first, second, pairs[0][1].view.places.mesh)
    sums = {"still_changes": len(steps), "still_squares_m2": float(steps @ steps)}
    return sums | {"body_changes": len(angles), "body_squares_deg2": float(angles @ angles)}


def _rates(sums: Row, frames: int) -> Row:
    """Return shares and means from sums over this number of frames."""
    row: Row = {}
    for part in PARTS:
        for name in (f"{part}_covered", f"{part}_invented"):
            row[name] = _share(sums[name], sums[f"{part}_pixels"])
        row[f"{part}_lost_runs"] = sums[f"{part}_lost_runs"] / frames
        row[f"{part}_largest_lost_m2"] = sums[f"{part}_largest_lost_m2"]
    row["cracks"] = _share(sums["cracks"], sums["measured"])
    row |= {name: int(sums[name]) for name in ("limbs_shown", "limbs_lost")}
    for name, squares in (("still_flicker_m", "still_squares_m2"), ("body_flicker_deg", "body_squares_deg2")):
        square = _share(sums[squares], sums[f"{name.split('_')[0]}_changes"])
        row[name] = None if square is None else float(np.sqrt(square))
    return row


def _share(part: float, whole: float) -> float | None:
    return part / whole if whole else None


def _points(camera: Camera, depth: Depths, pixels: Mask) -> Float64[np.ndarray, "N 3"]:
    """Return the measured places of some pixels in world coordinates, m."""
    local = camera.ahead[pixels] * depth[pixels][:, None]
    return (local - camera.extrinsic[:3, 3]) @ camera.extrinsic[:3, :3]


def _usual(stack: Float64[np.ndarray, "T H W"]) -> Depths:
    """Return each pixel's depth of the still scene, m; 0 without measurements, infinite where only bodies were seen."""
    ordered = np.sort(np.where(stack > 0, stack, -1.0), axis=0)
    missing = (stack <= 0).sum(axis=0)
    last = len(stack) - 1

    def at(share: float) -> Depths:
        rank = missing + np.floor(share * (last - missing)).astype(np.int64)
        return np.maximum(np.take_along_axis(ordered, np.clip(rank, 0, last)[None], 0)[0], 0)

    usual, near = at(USUAL), at(1 - USUAL)
    far = apart(usual)
    seldom = (np.abs(stack - usual) <= far).mean(axis=0) < SELDOM
    return np.where(seldom & (usual - near > far), np.inf, usual)


@dataclass(frozen=True, slots=True)
class Patch:
    """Points of a surface with their unit normals."""

    points: Float64[np.ndarray, "N 3"]  # m
    normals: Float64[np.ndarray, "N 3"]

    @staticmethod
    def join(patches: Iterable[Patch]) -> Patch:
        points, normals = zip(*((each.points, each.normals) for each in patches), strict=True)
        return Patch(np.concatenate(points), np.concatenate(normals))

    def at(self, which: Bool[np.ndarray, " N"] | Int64[np.ndarray, " M"]) -> Patch:
        return Patch(self.points[which], self.normals[which])


def angles_after_motion(before: Patch, after: Patch, surface: Mesh) -> Float64[np.ndarray, " M"]:
    """Return the angles between points' normals and the next frame's at their moved positions, degrees.

    `surface` is the next frame's whole surface, `after` the body's points on it: points without one of these within
    `MATCHED` are left out.
    """
    if not (len(before.points) and len(after.points)):
        return np.zeros(0)
    tree = cKDTree(after.points)
    count = len(before.points)
    moved = before.at(np.unique(np.linspace(0, count - 1, min(count, SAMPLES)).astype(np.int64)))
    first = moved.points
    for size in SIZES:
        blocks = np.unique(np.floor(first / size).astype(np.int64), axis=0, return_inverse=True)[1].reshape(-1)
        for _ in range(ROUNDS):
            away, at = tree.query(moved.points, distance_upper_bound=min(REACH * size, FARTHEST))
            near = np.isfinite(away)
            moved = _laid(moved, after.at(np.where(near, at, 0)), near, blocks, size)
    moved = moved.at(tree.query(moved.points)[0] <= MATCHED)
    hits = Surface(surface).closest(moved.points)
    return angles(moved.normals, interpolate(welded_normals(surface), surface.faces[hits.faces], hits.barycentric))


def _laid(
    moved: Patch, onto: Patch, near: Bool[np.ndarray, " N"], blocks: Int64[np.ndarray, " N"], size: float
) -> Patch:
    """Move each block rigidly by one linear step that brings its points near a match into the match's plane."""
    count = blocks.max() + 1
    sizes = np.maximum(np.bincount(blocks, minlength=count), 1)
    middles = np.stack([np.bincount(blocks, axis, count) for axis in moved.points.T], axis=1) / sizes[:, None]
    local = (moved.points - middles[blocks]) / size
    rows = np.concatenate([np.cross(local, onto.normals), onto.normals], axis=1) * near[:, None]
    off = np.einsum("nd,nd->n", onto.points - moved.points, onto.normals)
    squares = np.zeros((count, 6, 6))
    sums = np.zeros((count, 6))
    np.add.at(squares, blocks, rows[:, :, None] * rows[:, None, :])
    np.add.at(sums, blocks, rows * off[:, None])
    squares += (DAMPING * sizes)[:, None, None] * np.eye(6)
    steps = np.linalg.solve(squares, sums[..., None])[..., 0]
    turns = Rotation.from_rotvec(steps[:, :3] / size).as_matrix()[blocks]
    points = np.einsum("nij,nj->ni", turns, moved.points - middles[blocks]) + middles[blocks] + steps[blocks, 3:]
    return Patch(points, np.einsum("nij,nj->ni", turns, moved.normals))
