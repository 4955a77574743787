"""Measures of a decoded scene by the depth pictures it was made from: surface covered, invented and lost, and flicker.

Depth pictures of still cameras and decoded meshes -> a row of numbers. No truth is needed, so recordings are judged as
simulated rigs are. A pixel shows still surface where its depth is the usual one, and a body where it is nearer. Pixels
beside a step in depth or a hole do not count: a sensor mixes both sides there.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Bool, Float64
from scipy.ndimage import binary_closing, binary_dilation, distance_transform_edt, label, maximum_filter, minimum_filter

from ..geometry.cameras import Camera
from ..geometry.depth import STEP, DepthFrames, DepthPicture, apart
from ..types import Frames, Mesh, evenly
from .comparison import Row
from .flicker import Patch, angles_after_motion
from .render import Crop, Pixels, View, Visible

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


@dataclass(frozen=True)  # no slots: cached properties need a dict
class Judged:
    """One camera's depth picture of one frame, the decoded surface seen from there, and masks of the pixels."""

    camera: Camera
    depth: Float64[np.ndarray, "H W"]  # m, measured
    view: View  # of the decoded surface
    clear: Bool[np.ndarray, "H W"]  # pixels that count
    body: Bool[np.ndarray, "H W"]  # measured nearer than usual

    def of(self, part: str) -> Bool[np.ndarray, "H W"]:
        """Return the pixels of one of `PARTS` that count."""
        return self.clear & {"all": np.True_, "still": ~self.body, "body": self.body}[part]

    @cached_property
    def off_body(self) -> Bool[np.ndarray, "H W"]:
        """Pixels of covered still surface, farther than `FOOT` from a body."""
        still = self.of("still") & self.covered
        if not self.body.any():
            return still
        return still & (distance_transform_edt(~self.body) * self.depth > FOOT * self.camera.focal[0])

    @cached_property
    def shown(self) -> Float64[np.ndarray, "H W"]:
        """Decoded depth, m; infinite where nothing was decoded."""
        depth = np.full(self.depth.shape, np.inf)
        depth[self.view.covered] = self.view.points @ self.camera.extrinsic[2, :3] + self.camera.extrinsic[2, 3]
        return depth

    @cached_property
    def near(self) -> Float64[np.ndarray, "H W"]:
        """Distance within which decoded surface covers a measurement, m."""
        return np.maximum(NEAR[0], NEAR[1] * self.depth)

    @cached_property
    def covered(self) -> Bool[np.ndarray, "H W"]:
        """Pixels whose measurement is on decoded surface."""
        return np.abs(self.shown - self.depth) <= self.near

    @property
    def invented(self) -> Bool[np.ndarray, "H W"]:
        """Pixels in which decoded surface stands where the camera saw through."""
        return self.shown < self.depth - self.near

    @property
    def cracks(self) -> Bool[np.ndarray, "H W"]:
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
        self._usual = dict[int, np.ndarray]()
        for camera, pictures in enumerate(zip(*samples, strict=True)):
            depths = [picture.depth * picture.unit for picture in pictures if picture is not None]
            if depths:
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
                view = visible.look(Pixels(camera, Crop(0, camera.height, 0, camera.width)))
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

    def _body(self, camera: int, depth: Float64[np.ndarray, "H W"]) -> Bool[np.ndarray, "H W"]:
        nearer = depth < self._usual.get(camera, 0.0) - apart(depth)
        return _large((depth > 0) & nearer, SPECK)

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
    without decoded surface; few pixels, but conspicuous. `limbs_shown` counts the frames that show the lower third of a
    body, `limbs_lost` those of them whose decoded mesh covers less than half of it. Between successive frames:
    `still_flicker_m` is the RMS change of decoded depth at pixels that measured still surface in both, and
    `body_flicker_deg` that of normals on bodies, with their motion removed. `refreshes` are the frames in which another
    background begins: its change does not count. Shares of nothing are None.
    """
    rows, before = list[Row](), dict[int, Judged]()
    for number in numbers:
        now = judged.of(number, decoded[number])
        follows = bool(rows) and rows[-1]["frame"] == number - 1
        row = _counts(list(now.values())) | _changes(before if follows else {}, now, number in refreshes)
        limb, kept = judged.limb(now.values())
        row |= {"limbs_shown": limb >= LIMB, "limbs_lost": limb >= LIMB and 2 * kept < limb}
        rows.append({"frame": number} | row)
        before = now
    sums = {name: sum(row[name] for row in rows) for name in (rows[0] if rows else ())}
    sums |= {name: max(row[name] for row in rows) for name in sums if name.endswith("largest_lost_m2")}
    rates = _rates(sums, len(rows)) if rows else {}
    return {"frames_judged": len(rows)} | rates | {"per_frame": [{"frame": r["frame"]} | _rates(r, 1) for r in rows]}


def clear_pixels(picture: DepthPicture) -> Bool[np.ndarray, "H W"]:
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
        angles = angles_after_motion(first, second, pairs[0][1].view.mesh)
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


def _points(
    camera: Camera, depth: Float64[np.ndarray, "H W"], pixels: Bool[np.ndarray, "H W"]
) -> Float64[np.ndarray, "N 3"]:
    """Return the measured places of some pixels in world coordinates, m."""
    rows, columns = np.nonzero(pixels)
    homogeneous = np.stack([columns + 0.5, rows + 0.5, np.ones(len(rows))])
    local = np.linalg.inv(camera.intrinsic) @ homogeneous * depth[pixels]
    return (camera.extrinsic[:3, :3].T @ (local - camera.extrinsic[:3, 3:])).T


def _large(pixels: Bool[np.ndarray, "H W"], least: int) -> Bool[np.ndarray, "H W"]:
    """Return the connected areas of at least so many pixels."""
    areas = label(pixels)[0]
    return pixels & (np.bincount(areas.reshape(-1)) >= least)[areas]


def _usual(stack: Float64[np.ndarray, "T H W"]) -> Float64[np.ndarray, "H W"]:
    """Return each pixel's depth of the still scene, m; 0 where nothing was measured.

    Infinite where only moving surface was measured: the scene behind it is too far or too dark.
    """
    ordered = np.sort(np.where(stack > 0, stack, -1.0), axis=0)
    missing = (stack <= 0).sum(axis=0)
    last = len(stack) - 1

    def at(share: float) -> Float64[np.ndarray, "H W"]:
        rank = missing + np.floor(share * (last - missing)).astype(np.int64)
        return np.maximum(np.take_along_axis(ordered, np.clip(rank, 0, last)[None], 0)[0], 0)

    usual, near = at(USUAL), at(1 - USUAL)
    far = apart(usual)
    seldom = (np.abs(stack - usual) <= far).mean(axis=0) < SELDOM
    return np.where(seldom & (usual - near > far), np.inf, usual)
