"""Masks of moving pixels from image files or from a tracker, behind one protocol (paper, section 3.2).

In: the faces and depths that the views see in a frame. Out: one mask per view, True at moving surface.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Bool, UInt8

from ...errors import InputError
from ...geometry.cameras import Camera, Seen, unpack_cameras
from ...io.files import read_file
from ...io.pictures import find_masks, last_number, read_mask
from .color_looks import ColorLooks

CAMERAS = "cameras.json"  # file name: Open3D's pinhole camera JSON, beside the folders of the views


@runtime_checkable
class Masker(Protocol):
    """Base class of sources of masks, which mark the pixels of each view that see moving surface."""

    views: tuple[Camera, ...] | None = None  # cameras of the masks; None: those that the scene is segmented with
    observes: bool = False  # whether `foresee` and `observe` must be called before the first masks

    def foresee(self, moments: Sequence[Sequence[Seen]], colors: ColorLooks | None = None) -> None:
        """Receive all views of a few moments, to choose a reference view; called once, before `observe`.

        `colors` are the pictures of the views if these are colour cameras.
        """
        del moments, colors

    def observe(self, frame: int, seen: Sequence[Seen], views: Sequence[Camera]) -> None:
        """Receive the views of a frame; called for every frame in order, before the first masks."""
        del frame, seen, views

    def masks(self, frame: int, seen: Sequence[Seen], views: Sequence[Camera]) -> Bool[np.ndarray, "X H W"]:
        """Return the masks of one frame in the order of the views; True: moving."""
        ...


class ImageMasks(Masker):
    """Masks made by another tool: `cameras.json`, and view00/frame_00000.png for each view and frame.

    Pixels are object numbers; 0 means still.
    """

    views: tuple[Camera, ...]

    def __init__(self, folder: Path, frames: int) -> None:
        """Read every file of `frames` frames. Raises InputError if one is missing, damaged or of another size."""
        self.views = read_views(folder)
        self._files = find_masks(folder, len(self.views), frames)
        for view, files in zip(self.views, self._files, strict=True):
            for frame, path in enumerate(files):
                height, width = read_mask(path).shape  # reads all of it, so that damage is found before encoding starts
                if (width, height) != (view.width, view.height):
                    text = f"{width} x {height} pixels where its camera has {view.width} x {view.height}"
                    raise InputError(f"{path} (frame {frame}): {text}; make masks of the camera's size")
        surplus = len([path for path in self._files[0][0].parent.iterdir() if path.suffix.lower() == ".png"]) - frames
        text = f"{folder}: has masks for {surplus} more frames than the {frames} of the sequence: the first are used"
        self.remarks = (f"{text}, beginning with frame 0",) if surplus > 0 else ()

    def masks(self, frame: int, seen: Sequence[Seen], views: Sequence[Camera]) -> Bool[np.ndarray, "X H W"]:
        """Return the masks of one frame; `views` must be `self.views`."""
        assert len(seen) == len(views) == len(self.views), "masks belong to their own views"
        return self.objects(frame) > 0

    def objects(self, frame: int) -> UInt8[np.ndarray, "X H W"]:
        """Return the number of the moving object that each pixel of each view sees; 0: none."""
        return np.stack([read_mask(files[frame]) for files in self._files])


def read_views(folder: Path) -> tuple[Camera, ...]:
    """Read the views, all of one size, from a folder's `cameras.json`. Raises InputError if it is invalid."""
    return read_view_file(folder / CAMERAS, "the cameras of the masks, as Open3D pinhole camera JSON")


VIEW_FILES = "view_*.json"  # as TSMC's authors release the cameras of a scene


def read_view_file(path: Path, wanted: str = "Open3D pinhole camera JSON") -> tuple[Camera, ...]:
    """Read views, all of one size, from a file, or from the files `view_00.json` and so on of a folder.

    Raises InputError, which says what is `wanted`, if they are invalid.
    """
    if path.is_dir():
        files = sorted(path.glob(VIEW_FILES), key=lambda file: (last_number(file.stem) or 0, file.name))
        if not files:
            raise InputError(f"{path}: holds no {VIEW_FILES}; give {wanted}, or a folder with such files")
        return one_size([view for file in files for view in read_view_file(file, wanted)], str(path))
    try:
        data = read_file(path)
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error}); give {wanted}") from None
    return one_size(unpack_cameras(data, str(path)), str(path))


def one_size(views: Sequence[Camera], name: str) -> tuple[Camera, ...]:
    """Return the views as a tuple after checking that there is at least one and that all have one picture size.

    Raises InputError, which calls them `name`.
    """
    if not views:
        raise InputError(f"{name}: has 0 cameras; give at least one")
    sizes = sorted({(view.width, view.height) for view in views})
    if len(sizes) > 1:
        two = " and ".join(f"{width} x {height}" for width, height in sizes[:2])
        raise InputError(f"{name}: cameras of {two} pixels; give cameras of one size")
    return tuple(views)
