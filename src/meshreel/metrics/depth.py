"""A decoded scene judged by the depth pictures that it was made from: what it covers, invents and loses.

Depth pictures of still cameras and decoded meshes -> a row of numbers. No truth is needed, so recordings are judged as
simulated rigs are. What a camera measures at a pixel is still where it is as far as usual, and of a body where it is
nearer. Pixels beside a step in depth or a hole do not count: a sensor mixes both sides there.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Bool, Float32, Float64
from scipy.ndimage import binary_dilation, label, maximum_filter, minimum_filter

from ..geometry.cameras import PinholeCamera
from ..geometry.depth import DepthFrames, DepthPicture
from ..geometry.raycast import Rays
from ..types import Frames, Mesh, evenly

BESIDE = 2  # pixels around a step or a hole that do not count
STEP = 0.03  # of the depth between neighbours: a step (guess)
NEAR = (0.03, 0.015)  # m, and share of the depth, within which surface covers a measurement
RUN = 0.01  # m^2, of a connected area that is not covered, from which on it is a lost run
USUAL = 0.95  # quantile over time of a pixel's depth: how far it is where nobody stands (guess)
APART = (0.06, 0.02)  # m, and share of the depth, by which a body is nearer than usual (guess)
SPECK = 12  # pixels: smaller areas that are nearer than usual are noise (guess)
LOOKED_AT = 60  # frames from which the usual depth is taken, at most (guess)
LIMB = 50  # pixels of a body's lower third from which on a frame shows it (guess)
PARTS = ("all", "still", "body")


@dataclass(frozen=True, slots=True)
class Judged:
    """One camera's picture of one frame beside what was decoded; masks of its pixels."""

    camera: PinholeCamera
    depth: Float64[np.ndarray, "H W"]  # m, measured
    shown: Float32[np.ndarray, "H W"]  # m, decoded; infinite: nothing
    clear: Bool[np.ndarray, "H W"]  # those that count
    body: Bool[np.ndarray, "H W"]  # measured nearer than usual

    def of(self, part: str) -> Bool[np.ndarray, "H W"]:
        """Return the pixels of one of `PARTS` that count."""
        return self.clear & {"all": np.True_, "still": ~self.body, "body": self.body}[part]

    @property
    def near(self) -> Float64[np.ndarray, "H W"]:
        """Distance within which decoded surface covers a measurement, m."""
        return np.maximum(NEAR[0], NEAR[1] * self.depth)

    @property
    def covered(self) -> Bool[np.ndarray, "H W"]:
        """Pixels whose measurement is on decoded surface."""
        return np.abs(self.shown - self.depth) <= self.near

    @property
    def invented(self) -> Bool[np.ndarray, "H W"]:
        """Pixels in which decoded surface stands where the camera saw through."""
        return self.shown < self.depth - self.near

    def lost_runs(self, part: str) -> Float64[np.ndarray, " N"]:
        """Return the areas of connected pixels that are not covered, m^2, of at least `RUN`, largest first."""
        runs, count = label(self.of(part) & ~self.covered)
        focal = self.camera.intrinsic[0, 0] * self.camera.intrinsic[1, 1]
        areas = np.bincount(runs.reshape(-1), (self.depth**2 / focal).reshape(-1), count + 1)[1:]
        return np.sort(areas[areas >= RUN])[::-1]

    def points(self, pixels: Bool[np.ndarray, "H W"]) -> Float64[np.ndarray, "N 3"]:
        """Return the measured places of some pixels in world coordinates, m."""
        rows, columns = np.nonzero(pixels)
        homogeneous = np.stack([columns + 0.5, rows + 0.5, np.ones(len(rows))])
        local = np.linalg.inv(self.camera.intrinsic) @ homogeneous * self.depth[pixels]
        turn, shift = self.camera.extrinsic[:3, :3], self.camera.extrinsic[:3, 3:]
        return (turn.T @ (local - shift)).T


class DepthJudge:
    """The depth pictures of a recording, prepared to judge decoded frames."""

    def __init__(self, frames: DepthFrames, count: int, up: Sequence[float]) -> None:
        """Prepare the pictures of `count` frames, of which some are read; `up` is the direction that points up."""
        self._frames, self._up = frames, np.asarray(up, np.float64)
        stacks: dict[int, list[np.ndarray]] = {}
        for number in evenly(count, LOOKED_AT):
            for camera, picture in enumerate(frames[number]):
                if picture is not None:
                    stacks.setdefault(camera, []).append(picture.depth * picture.unit)
        self._usual = {camera: _usual(np.stack(stack)) for camera, stack in stacks.items()}
        self._floor = np.inf

    def of(self, number: int, decoded: Mesh) -> Iterator[Judged]:
        """Yield what each camera measured in a frame beside the decoded mesh."""
        rays = Rays(decoded)
        for camera, picture in enumerate(self._frames[number]):
            if picture is not None:
                depth = picture.depth * picture.unit
                nearer = depth < self._usual[camera] - np.maximum(APART[0], APART[1] * depth)
                shown, body = rays.look(picture.camera).depth, _large((depth > 0) & nearer, SPECK)
                yield Judged(picture.camera, depth, shown, clear_pixels(picture), body)


def _large(pixels: Bool[np.ndarray, "H W"], least: int) -> Bool[np.ndarray, "H W"]:
    """Return the connected areas of at least so many pixels."""
    areas = label(pixels)[0]
    return pixels & (np.bincount(areas.reshape(-1)) >= least)[areas]


def _usual(stack: Float64[np.ndarray, "T H W"]) -> Float64[np.ndarray, "H W"]:
    """Return how far each pixel is where nobody stands before it, m; 0 where nothing was measured."""
    ordered = np.sort(np.where(stack > 0, stack, -1.0), axis=0)
    none = (stack <= 0).sum(axis=0)
    at = none + np.floor(USUAL * (len(stack) - 1 - none)).astype(np.int64)
    return np.maximum(np.take_along_axis(ordered, np.minimum(at, len(stack) - 1)[None], 0)[0], 0)


def clear_pixels(picture: DepthPicture) -> Bool[np.ndarray, "H W"]:
    """Return the pixels of a depth picture that have a measurement, with no step in depth and no hole beside them."""
    depth = picture.depth.astype(np.float64)
    most, least = maximum_filter(depth, 3), minimum_filter(depth, 3)
    return ~binary_dilation((least <= 0) | (most - least > STEP * depth), iterations=BESIDE - 1)


def judge(judged: DepthJudge, decoded: Frames, numbers: Iterable[int]) -> dict[str, Any]:
    """Judge some decoded frames; return shares over all their pixels by part, and a row for each frame.

    `still_flicker_m` is the RMS change of decoded depth between a frame and the next one where both measured what
    stands still. `limbs_lost` counts frames which show the lower third of a body, and whose decoded mesh has not half
    of it.
    """
    rows, before = list[dict[str, Any]](), dict[int, Judged]()
    for number in numbers:
        now = dict(enumerate(judged.of(number, decoded[number])))
        rows.append({"frame": number, **_row(list(now.values()), judged.low(now.values())), **_flicker(before, now)})
        before = now
    sums = {name: sum(row[name] for row in rows) for name in rows[0] if name != "frame" and "largest" not in name}
    found: dict[str, Any] = {"frames_judged": len(rows)}
    for part in PARTS:
        pixels = max(sums[f"{part}_pixels"], 1)
        found[f"{part}_covered"] = sums[f"{part}_covered_pixels"] / pixels
        found[f"{part}_invented"] = sums[f"{part}_invented_pixels"] / pixels
        found[f"{part}_lost_runs"] = sums[f"{part}_lost_runs"] / max(len(rows), 1)
    found["limbs_shown"], found["limbs_lost"] = sums["limb_shown"], sums["limb_lost"]
    found["still_flicker_m"] = float(np.sqrt(sums["changed_m2"] / max(sums["compared_pixels"], 1)))
    return found | {"per_frame": rows}
