"""Who says which pixels move: one protocol for geometric change, mask images and trackers (paper, section 3.2).

In: what the views see of a frame. Out: a mask a view, True where what is seen moves.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Bool, UInt8

from ...errors import InputError
from ...geometry.cameras import PinholeCamera, unpack_cameras
from ...geometry.raycast import Seen
from ...io.mask_pictures import find_masks, read_mask

CAMERAS = "cameras.json"  # Open3D's pinhole camera JSON, beside the folders of the views


@runtime_checkable
class Masker(Protocol):
    """Says of each pixel of each view whether what it sees moves."""

    def masks(self, frame: int, seen: Sequence[Seen], views: Sequence[PinholeCamera]) -> Bool[np.ndarray, "X H W"]:
        """The masks of one frame, in the order of the views; True: dynamic."""
        ...


class ImageMasks:
    """Masks that another tool has made: `cameras.json`, and view00/frame_00000.png for each view and frame.

    Pixels are object numbers, 0 for what stands still.
    """

    def __init__(self, folder: Path, frames: int) -> None:
        """Reads every file of so many frames. Raises InputError where one is missing, damaged or of another size."""
        self.views = read_views(folder)
        self._files = find_masks(folder, len(self.views), frames)
        for view, files in zip(self.views, self._files, strict=True):
            for frame, path in enumerate(files):
                height, width = read_mask(path).shape  # all of it: damage is told now, not when half is encoded
                _check_size(path, frame, (width, height), view)
        others = len([path for path in self._files[0][0].parent.iterdir() if path.suffix.lower() == ".png"]) - frames
        text = f"{folder}: has masks of {others} more frames than the {frames} there are: the first ones are taken"
        self.remarks = (f"{text}, frame 0 for the first",) if others > 0 else ()

    def masks(self, frame: int, seen: Sequence[Seen], views: Sequence[PinholeCamera]) -> Bool[np.ndarray, "X H W"]:
        """The masks of one frame; the views must be this object's own."""
        assert len(seen) == len(views) == len(self.views), "masks belong to their own views"
        return self.objects(frame) > 0

    def objects(self, frame: int) -> UInt8[np.ndarray, "X H W"]:
        """The object that each pixel of each view sees; 0: none that moves."""
        return np.stack([read_mask(files[frame]) for files in self._files])


def read_views(folder: Path) -> tuple[PinholeCamera, ...]:
    """The views that a folder's `cameras.json` describes, all of one size. Raises InputError where it is wrong."""
    path = folder / CAMERAS
    try:
        data = path.read_bytes()
    except OSError as error:
        text = f"{path}: cannot be read ({error.strerror}); give the cameras that the masks were made for"
        raise InputError(f"{text}, as Open3D pinhole camera JSON") from None
    return one_size(unpack_cameras(data, str(path)), str(path))


def one_size(views: Sequence[PinholeCamera], name: str) -> tuple[PinholeCamera, ...]:
    """The views, checked: one at least, and pictures of one size. `name` is what an error calls them."""
    if not views:
        raise InputError(f"{name}: has 0 cameras; give one at least")
    sizes = sorted({(view.width, view.height) for view in views})
    if len(sizes) > 1:
        told = " and ".join(f"{width} x {height}" for width, height in sizes[:2])
        raise InputError(f"{name}: cameras of {told} pixels; give cameras of one size")
    return tuple(views)


def _check_size(path: Path, frame: int, size: tuple[int, int], view: PinholeCamera) -> None:
    if size != (view.width, view.height):
        text = f"{path} (frame {frame}): {size[0]} x {size[1]} pixels where its camera has {view.width} x {view.height}"
        raise InputError(f"{text}; make masks of the camera's size")
