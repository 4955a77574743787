"""The pictures of colour cameras as views of a scene, and the faces whose colour tells them from the room.

In: the colour pictures of a recording. Out: undistorted views of one size; faces a little nearer than the room usually
is there and of another hue, such as feet on a floor. Shadows change the brightness and hardly the hue.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float32, UInt8
from scipy.ndimage import binary_opening, uniform_filter

from ...geometry import work
from ...geometry.color_views import ColorFrames, sampled
from ...geometry.drawing import draw
from ...geometry.threads import ahead
from ...types import Frames, Mesh

SIDE = 640  # pixels, largest length of a view's longer side, for tools that make masks (guess)
CHANGE_SIDE = 320  # pixels, largest length of a view's longer side (guess)
MOMENTS = 24  # frames from which the usual depth and hue are taken (guess)
_FAR = 0.75  # quantile of depth over these frames that is the room's (guess)
_ROOM = 3.0  # of `nearer`: within this distance of that depth a pixel shows the room (guess)
_HUE = 0.015  # least change of a colour's share of the sum of channels (measured on a real room: .01 to .03 do)
_NOISE = 4.0  # least change in standard deviations of a pixel (guess)
_DARK = 30  # added to the sum of channels: the hue of dark pixels is noise (guess)


class ColorLooks:
    """The pictures of a recording's colour cameras as views of one size, without lens distortion."""

    def __init__(self, colors: ColorFrames, frame: int, side: int = SIDE) -> None:
        """Take the cameras that have a picture of `frame`; the views have the shape of the first one's."""
        self._colors, self.frame = colors, frame
        cameras = {number: picture.camera for number, picture in enumerate(colors[frame]) if picture is not None}
        self._numbers = list(cameras)
        width, height = next(((camera.width, camera.height) for camera in cameras.values()), (1, 1))
        share = min(1.0, side / max(width, height))
        width, height = round(share * width), round(share * height)
        self.views = tuple(camera.straight.resized(width, height) for camera in cameras.values())

    def at(self, frame: int, view: int) -> UInt8[np.ndarray, "H W 3"] | None:
        """Return the picture of a view; None if its camera lacks the frame."""
        picture = self._colors[frame][self._numbers[view]]
        if picture is None:
            return None
        ahead = self.views[view].ahead
        places = picture.camera.project(ahead.reshape(-1, 3))
        return np.rint(sampled(picture.pixels, places)).astype(np.uint8).reshape(ahead.shape)


@dataclass(frozen=True, slots=True)
class ColorChange:
    """Usual depth and hue in each view of a colour camera, for comparison with single frames."""

    looks: ColorLooks
    nearer: float  # m, by which a pixel must be nearer than usual
    depth: Float32[np.ndarray, "X H W"]  # m; NaN: nothing is seen
    hue: Float32[np.ndarray, "X H W 2"]
    limit: Float32[np.ndarray, "X H W"]  # by which a hue must differ

    @staticmethod
    def of(frames: Frames, looks: ColorLooks, numbers: Sequence[int], nearer: float) -> ColorChange:
        """Find the usual depth and hue over the frames `numbers`."""

        def seen(number: int) -> tuple[list[np.ndarray], list[np.ndarray]]:
            work.passed("compare")
            mesh = frames[number]
            depths = [draw(mesh, view).depth for view in looks.views]
            return depths, [_hue(looks, number, view) for view in range(len(looks.views))]

        depths, hues = zip(*ahead(seen, numbers), strict=True)
        depth = np.array(depths, np.float32)
        far = _quantile(np.where(np.isfinite(depth), depth, np.nan), _FAR)
        room = np.where((np.abs(depth - far) < _ROOM * nearer)[..., None], np.array(hues, np.float32), np.nan)
        hue = _quantile(room, 0.5)
        noise = 1.4826 * _quantile(np.abs(room - hue).max(axis=-1), 0.5)
        return ColorChange(looks, nearer, far, hue, np.maximum(_HUE, _NOISE * noise))

    def faces(self, frame: int, mesh: Mesh) -> Bool[np.ndarray, " F"]:
        """Return the faces of a frame whose pixels mostly see another hue, nearer than usual."""
        changed, visible = np.zeros(len(mesh.faces)), np.zeros(len(mesh.faces))
        for number, view in enumerate(self.looks.views):
            sight = draw(mesh, view)
            change = np.nan_to_num(np.abs(_hue(self.looks, frame, number) - self.hue[number]).max(axis=-1))
            before = np.nan_to_num(self.depth[number] - sight.depth, neginf=0.0)
            unlike = (uniform_filter(change, 3) > self.limit[number]) & (uniform_filter(before, 3) > self.nearer)
            unlike = binary_opening(unlike, np.ones((2, 2)))
            hit = sight.faces >= 0
            changed += np.bincount(sight.faces[hit & unlike], minlength=len(changed))
            visible += np.bincount(sight.faces[hit], minlength=len(changed))
        return (changed > 0) & (2 * changed >= visible)


def _hue(looks: ColorLooks, frame: int, view: int) -> Float32[np.ndarray, "H W 2"]:
    """Return the shares of red and green in the colours that a view sees; NaN where its camera lacks the frame."""
    picture = looks.at(frame, view)
    if picture is None:
        return np.full((looks.views[view].height, looks.views[view].width, 2), np.nan, np.float32)
    values = picture.astype(np.float32)
    return values[..., :2] / (values.sum(axis=-1, keepdims=True) + _DARK)


def _quantile(stack: Float32[np.ndarray, "T ..."], share: float) -> Float32[np.ndarray, "..."]:
    """Return a quantile over the first axis without NaN; NumPy's own takes a minute for four cameras."""
    ordered, counts = np.sort(stack, axis=0), (~np.isnan(stack)).sum(axis=0)  # NaN last
    at = np.rint(share * np.maximum(counts - 1, 0)).astype(np.int64)
    return np.take_along_axis(ordered, at[None], axis=0)[0]
