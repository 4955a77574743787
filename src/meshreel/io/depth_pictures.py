"""Depth pictures: 16-bit grayscale PNG, the usual recording of depth cameras; 0 means no measurement.

In -> out: a file <-> an array H x W of integers in the depth unit of the camera.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from jaxtyping import UInt16

from ..errors import InputError
from .pictures import DEEP, opened
from .read import read_input
from .write import write_picture

_AGAIN = "record the frame again, or delete the file"


def read_depth(path: Path) -> UInt16[np.ndarray, "H W"]:
    """Read a 16-bit grayscale PNG. Raises InputError if it cannot be read or has fewer bits."""
    return parse_depth(read_input(path, _AGAIN), str(path))


def parse_depth(data: bytes, where: str) -> UInt16[np.ndarray, "H W"]:
    """Return the depths in the bytes of a file. Raises as `read_depth` does; messages begin with `where`."""
    wanted = "store depth as 16-bit grayscale PNG"
    with opened(data, where, wanted, _AGAIN) as image:
        if image.mode not in DEEP:
            kind = "8 bits a pixel" if image.mode in ("L", "P", "1") else f"mode {image.mode}"
            raise InputError(f"{where}: a depth picture of {kind}; {wanted}")
        return np.array(image, dtype=np.uint16)


def write_depth(depth: UInt16[np.ndarray, "H W"], path: Path) -> None:
    write_picture(depth, path)
