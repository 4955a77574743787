"""Depth pictures without the error that a sensor makes in a frame as a whole.

A sensor drifts as it warms up, and some measure single frames as a whole some centimetres too far: what stands still
and what moves is then off alike. Such an error is told by the pixels' usual depth, where cameras stand still. One that
is smaller than what single pixels are off is left alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from jaxtyping import Float32

from ...geometry.depth import DepthPicture, apart
from .rig import Rig

FRAMES = 32  # of a recording, which tell the usual depth of each pixel (guess)
OFTEN = 0.5  # least share of these in which a pixel has a depth (guess)
WIDE = 3.0  # times `apart`: what differs from the usual depth by more is something else (guess)
AGREE = 0.5  # least share of the pixels that must agree on an error (guess)
MEDIAN = 0.6745  # of an absolute value, in standard deviations


class SteadyDepth:
    """The depth pictures of a rig, corrected frame by frame."""

    def __init__(self, rig: Rig) -> None:
        self.rig = rig
        self._usual = dict[int, Float32[np.ndarray, "H W"]]()  # units, of each camera; 0: unknown

    def __reduce__(self) -> Any:
        return SteadyDepth, (self.rig,)  # what was read is read again where it is needed

    def pictures(self, frame: int) -> list[DepthPicture | None]:
        """Return the pictures of a frame. Errors as in `Rig.depth_pictures`."""
        pictures = self.rig.depth_pictures(frame)
        for number, picture in enumerate(pictures):
            if picture is not None and (error := self._error(number, picture)):
                depth = np.rint(picture.depth / (1 + error)).astype(np.uint16)
                pictures[number] = replace(picture, depth=depth)
        return pictures

    def errors(self, frames: Sequence[int]) -> list[list[float]]:
        """Return the error of each camera in these frames, as a share of the depth; 0 where it is left alone."""
        each = zip(*(self.rig.depth_pictures(frame) for frame in frames), strict=True)
        return [[0.0 if one is None else self._error(k, one) for one in some] for k, some in enumerate(each)]

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
            frames = sorted(self.rig.files[number])
            some = sorted({frames[int(k)] for k in np.linspace(0, len(frames) - 1, FRAMES)})
            stack = np.sort(np.stack([self.rig.depth(number, frame) for frame in some]), axis=0)
            count = (stack > 0).sum(axis=0)
            middle = len(some) - count + count // 2  # those without a depth are first
            usual = np.take_along_axis(stack, np.minimum(middle, len(some) - 1)[None], axis=0)[0]
            self._usual[number] = np.where(count >= OFTEN * len(some), usual, 0).astype(np.float32)
        return self._usual[number]
