"""The pictures of colour cameras as views of a scene.

In: the colour pictures of a recording. Out: views of one size, and their undistorted pictures of a frame.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import UInt8

from ...geometry.cameras import Camera
from ...geometry.color_views import ColorFrames, ColorPicture, sampled

SIDE = 640  # pixels, largest length of a view's longer side, for tools that make masks (guess)


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
        return None if picture is None else _straight(picture, self.views[view])


def _straight(picture: ColorPicture, view: Camera) -> UInt8[np.ndarray, "H W 3"]:
    """Resample a colour camera's picture to an undistorted view from the same place."""
    places = picture.camera.project(view.ahead.reshape(-1, 3))
    return np.rint(sampled(picture.pixels, places)).astype(np.uint8).reshape(view.height, view.width, 3)
