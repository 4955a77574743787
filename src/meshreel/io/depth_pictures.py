"""Depth pictures: 16-bit grayscale PNG, as depth cameras are recorded; 0 is no measurement.

In -> out: a file <-> heights x widths of integers in the camera's depth unit.
"""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
from jaxtyping import UInt16

from ..errors import InputError
from .write import replacing

_DEEP = ("I;16", "I;16B", "I;16L", "I")  # modes in which versions of Pillow give 16 bits a pixel


def read_depth(path: Path) -> UInt16[np.ndarray, "H W"]:
    """The depths of a 16-bit grayscale PNG. Raises InputError where it cannot be read or has fewer bits."""
    from PIL import Image, UnidentifiedImageError

    try:
        with Image.open(path) as image:
            if image.mode not in _DEEP:
                told = "8 bits a pixel" if image.mode in ("L", "P", "1") else f"mode {image.mode}"
                raise InputError(f"{path}: a depth picture of {told}; store depth as 16-bit grayscale PNG")
            return np.array(image, dtype=np.uint16)
    except UnidentifiedImageError:
        raise InputError(f"{path}: is no picture; store depth as 16-bit grayscale PNG") from None
    except (OSError, SyntaxError, ValueError, Image.DecompressionBombError) as error:  # SyntaxError: a damaged chunk
        reason = getattr(error, "strerror", None) or error
        raise InputError(f"{path}: cannot be read ({reason}); record the frame again, or delete the file") from None


def write_depth(depth: UInt16[np.ndarray, "H W"], path: Path) -> None:
    """The depths as a 16-bit grayscale PNG."""
    from PIL import Image

    packed = io.BytesIO()
    Image.fromarray(depth).save(packed, format="PNG")
    with replacing(path) as file:
        file.write(packed.getvalue())


def picture_size(path: Path) -> tuple[int, int]:
    """Width and height of any picture, pixels. Raises InputError where it cannot be read."""
    from PIL import Image

    try:
        with Image.open(path) as image:
            return image.size
    except (OSError, SyntaxError, ValueError, Image.DecompressionBombError) as error:
        raise InputError(f"{path}: cannot be read ({error}); delete it, or give a picture") from None
