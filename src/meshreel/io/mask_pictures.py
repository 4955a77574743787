"""Mask pictures: 8-bit PNG of object numbers, one folder for each view.

In -> out: a file <-> object numbers, 0 for still surface (stored as gray or palette indices, as by DAVIS and most mask
tools); a folder -> its files by view and by frame.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import numpy as np
from jaxtyping import UInt8

from ..errors import InputError
from .file_names import last_number
from .pictures import opened
from .read import read_input

_MODES = ("L", "P", "1")  # of Pillow: gray, palette, black and white
_LIKE = "name folders view00, view01 ... and files frame_00000.png ..."


def read_mask(path: Path) -> UInt8[np.ndarray, "H W"]:
    """Read object numbers from an 8-bit gray or palette PNG. Raises InputError for other or unreadable files."""
    wanted, remedy = "store object numbers as 8-bit gray PNG", "make the mask again"
    with opened(read_input(path, remedy), str(path), wanted, remedy) as image:
        if image.mode not in _MODES:
            raise InputError(f"{path}: a mask of mode {image.mode}; {wanted}")
        return np.array(image).astype(np.uint8)


def is_mask(path: Path) -> bool:
    """Return True if the header of a file is that of a mask, False for color pictures and other files."""
    try:
        with opened(read_input(path), "", "", "") as image:
            return image.mode in _MODES
    except InputError:
        return False


def find_masks(folder: Path, views: int, frames: int) -> list[list[Path]]:
    """Return the files of the masks by view and frame, whose numbers are the last numbers in their names.

    Raises InputError if a view or a frame has no mask, or two.
    """
    places = _numbered(folder, (path for path in _listed(folder) if path.is_dir()), "view")
    masks = []
    for view in range(views):
        if view not in places:
            raise InputError(f"{folder}: has no folder of view {view} of {views}; {_LIKE}")
        pictures = (path for path in _listed(places[view]) if path.suffix.lower() == ".png")
        files = _numbered(places[view], pictures, "frame")
        lost = [frame for frame in range(frames) if frame not in files]
        if lost:
            text = f"{places[view]}: has no mask of frame {lost[0]} ({len(lost)} of {frames} are missing)"
            raise InputError(f"{text}; {_LIKE}; where nothing moves, give a black one")
        masks.append([files[frame] for frame in range(frames)])
    return masks


def _listed(folder: Path) -> list[Path]:
    try:
        return sorted(path for path in folder.iterdir() if not path.name.startswith("."))
    except OSError as error:
        raise InputError(f"{folder}: masks cannot be read ({error.strerror}); check the path and its rights") from None


def _numbered(folder: Path, paths: Iterable[Path], what: str) -> dict[int, Path]:
    numbered: dict[int, Path] = {}
    for path in paths:
        number = last_number(path.stem if path.suffix.lower() == ".png" else path.name)
        if number is None:
            continue
        if number in numbered:
            text = f"{numbered[number].name} and {path.name} are both {what} {number}"
            raise InputError(f"{folder}: {text}; keep one of them")
        numbered[number] = path
    return numbered
