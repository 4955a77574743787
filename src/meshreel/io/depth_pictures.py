"""Depth pictures: 16-bit grayscale PNG, the usual recording of depth cameras; 0 means no measurement.

In -> out: a file <-> an array H x W of integers in the depth unit of the camera.
"""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
from jaxtyping import UInt16

from ..errors import InputError
from .read import read_file
from .write import write_picture

_DEEP = ("I;16", "I;16B", "I;16L", "I")  # modes in which versions of Pillow return 16 bits per pixel
_AGAIN = "record the frame again, or delete the file"


def read_depth(path: Path) -> UInt16[np.ndarray, "H W"]:
    """Read a 16-bit grayscale PNG. Raises InputError if it cannot be read or has fewer bits."""
    try:
        return parse_depth(read_file(path), str(path))
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error}); {_AGAIN}") from None


def parse_depth(data: bytes, where: str) -> UInt16[np.ndarray, "H W"]:
    """Return the depths in the bytes of a file; errors as `read_depth`, which begin with `where`."""
    from PIL import Image, UnidentifiedImageError

    try:
        with Image.open(io.BytesIO(data)) as image:
            if image.mode not in _DEEP:
                kind = "8 bits a pixel" if image.mode in ("L", "P", "1") else f"mode {image.mode}"
                raise InputError(f"{where}: a depth picture of {kind}; store depth as 16-bit grayscale PNG")
            return np.array(image, dtype=np.uint16)
    except UnidentifiedImageError:
        raise InputError(f"{where}: is no picture; store depth as 16-bit grayscale PNG") from None
    except (OSError, SyntaxError, ValueError, Image.DecompressionBombError) as error:  # SyntaxError: a damaged chunk
        raise InputError(f"{where}: cannot be read ({getattr(error, 'strerror', None) or error}); {_AGAIN}") from None


def write_depth(depth: UInt16[np.ndarray, "H W"], path: Path) -> None:
    """Write depths as a 16-bit grayscale PNG."""
    write_picture(depth, path)
