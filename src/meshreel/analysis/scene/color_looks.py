"""The pictures of colour cameras as views of a scene.

In: the colour pictures of a recording. Out: views of one size, and what they see of a frame.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import UInt8

from ...geometry.cameras import Camera
from ...geometry.color_views import ColorFrames, ColorPicture, sampled

SIDE = 640  # pixels, most along the longer side of a view, for tools that make masks (guess)


class ColorLooks:
    """The pictures of a recording's colour cameras as views of one size, without the bends of their lenses."""

    def __init__(self, colors: ColorFrames, frame: int, side: int = SIDE) -> None:
        """Take the cameras that have a picture of `frame`; the views have the shape of the first one's."""
        self._colors = colors
        taken = {number: one.camera for number, one in enumerate(colors[frame]) if one is not None}
        self._numbers = list(taken)
        width, height = next(((camera.width, camera.height) for camera in taken.values()), (1, 1))
        share = min(1.0, side / max(width, height))
        width, height = round(share * width), round(share * height)
        self.views = tuple(camera.straight.resized(width, height) for camera in taken.values())

    def at(self, frame: int, view: int) -> UInt8[np.ndarray, "H W 3"] | None:
        """Return the picture of a view; None where its camera lacks the frame."""
        found = self._colors[frame][self._numbers[view]]
        return None if found is None else _straight(found, self.views[view])


def _straight(picture: ColorPicture, view: Camera) -> UInt8[np.ndarray, "H W 3"]:
    """Return what a view from the place of a colour camera sees in its picture."""
    places = picture.camera.project(view.ahead.reshape(-1, 3))
    return np.rint(sampled(picture.pixels, places)).astype(np.uint8).reshape(view.height, view.width, 3)
