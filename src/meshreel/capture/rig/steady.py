"""Depth pictures without the error that a sensor makes in a frame as a whole.

Some sensors measure frames as a whole some centimetres too far: what stands still and what moves is then off by about
one share of its depth. Such an error is told by the pixels' usual depth, where cameras stand still. A camera's errors
are taken out if they are new in every frame, as noise is; what goes on from a frame to the next may be a body that
moves and fills the picture. One that is smaller than what single pixels are off is left alone, and so are all of a
camera of whose frames that are looked at none has one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float32

from ...geometry.depth import DepthPicture, apart
from ...types import evenly
from .rig import Rig

FRAMES = 32  # of a recording, which tell the usual depth of each pixel (guess)
OFTEN = 0.5  # least share of these in which a pixel has a depth (guess)
WIDE = 3.0  # times `apart`: what differs from the usual depth by more is something else (guess)
AGREE = 0.5  # least share of the pixels that must agree on an error (guess)
PROBES = 16  # frames, each with its neighbours, in which errors are tested for being independent (guess)
JUMPS = 4.0  # times the mean square that noise has by second differences: motion has 5 and more, noise 1 (guess)
MEDIAN = 0.6745  # of an absolute value, in standard deviations


class SteadyDepth:
    """The depth pictures of a rig, corrected frame by frame."""

    def __init__(self, rig: Rig, jumps: dict[int, bool] | None = None) -> None:
        """Take a rig, and of each camera, by number, whether its errors are new in every frame, where it is known."""
        self.rig = rig
        self._usual = dict[int, Float32[np.ndarray, "H W"]]()  # units, of each camera; 0: unknown
        self._jumps = dict(jumps or {})

    def __reduce__(self) -> Any:
        return SteadyDepth, (self.rig, self._jumps)  # usual depths are read again where a camera has errors

    def pictures(self, frame: int) -> list[DepthPicture | None]:
        """Return the pictures of a frame. Errors as in `Rig.depth_pictures`."""
        pictures = self.rig.depth_pictures(frame)
        for number, picture in enumerate(pictures):
            if error := self._wrong(number, picture):
                assert picture is not None
                depth = np.clip(np.rint(picture.depth / (1 + error)), 0, np.iinfo(np.uint16).max)
                pictures[number] = replace(picture, depth=depth.astype(np.uint16))
        return pictures

    def errors(self, frames: Sequence[int]) -> list[list[float]]:
        """Return the error of each camera in these frames, as a share of the depth; 0 where it is left alone."""
        each = zip(*(self.rig.depth_pictures(frame) for frame in frames), strict=True)
        return [[self._wrong(k, one) for one in some] for k, some in enumerate(each)]

    @property
    def files(self) -> list[Path]:
        """The pictures that tell the usual depths of cameras whose errors are taken out."""
        wrong = [number for number, jumps in self._jumps.items() if jumps]
        return [self.rig.files[number][frame] for number in wrong for frame in self._usual_frames(number)]

    def _usual_frames(self, number: int) -> list[int]:
        frames = sorted(self.rig.files[number])
        return [frames[k] for k in evenly(len(frames), FRAMES)]

    def _wrong(self, number: int, picture: DepthPicture | None) -> float:
        """Return the error to take out of a camera's picture."""
        return self._error(number, picture) if picture is not None and self._are_jumps(number) else 0.0

    def _are_jumps(self, number: int) -> bool:
        """Return whether the errors of a camera are new in every frame: motion nearly cancels in second differences."""
        if number not in self._jumps and self.rig.cameras[number].path:
            self._jumps[number] = False  # a pixel of a camera that moves has no usual depth
        if number not in self._jumps:
            frames = sorted(self.rig.files[number])
            middles = evenly(len(frames) - 2, PROBES) if len(frames) > 2 else []
            probed, camera = sorted({m + k for m in middles for k in range(3)}), self.rig.cameras[number]
            found = {k: self._error(number, camera.picture(self.rig.depth(number, frames[k]))) for k in probed}
            e = np.array([[found[m + k] for k in range(3)] for m in middles]).reshape(-1, 3)
            second = ((e[:, 0] - 2 * e[:, 1] + e[:, 2]) ** 2).mean() / 6 if len(e) else 0.0
            self._jumps[number] = bool(second > 0 and (e**2).mean() <= JUMPS * second)
        return self._jumps[number]

    def _error(self, number: int, picture: DepthPicture) -> float:
        usual = self._usual_depth(number)
        known = (usual > 0) & (picture.depth > 0)
        before, now = usual[known].astype(np.float64), picture.depth[known].astype(np.float64)
        near = np.abs(now - before) * picture.unit <= WIDE * apart(before * picture.unit)
        if near.sum() < max(AGREE * known.sum(), 1):
            return 0.0
        shares = (now / before - 1)[near]
        error = float(np.median(shares))
        spread = float(np.median(np.abs(shares - error))) / MEDIAN
        return error if abs(error) > spread and abs(error) * float(np.median(before)) >= 1 else 0.0

    def _usual_depth(self, number: int) -> Float32[np.ndarray, "H W"]:
        """Return the median depth of each pixel of a camera, in its units; 0 where it seldom has one."""
        if number not in self._usual:
            some = self._usual_frames(number)
            stack = np.sort(np.stack([self.rig.depth(number, frame) for frame in some]), axis=0)
            count = (stack > 0).sum(axis=0)
            middle = len(some) - count + count // 2  # those without a depth are first
            usual = np.take_along_axis(stack, np.minimum(middle, len(some) - 1)[None], axis=0)[0]
            self._usual[number] = np.where(count >= OFTEN * len(some), usual, 0).astype(np.float32)
        return self._usual[number]
