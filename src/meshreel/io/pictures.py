"""Pictures: of textures and of colour cameras, as 8-bit sRGB, from any file that Pillow reads; of depth; and masks.

Depth is 16-bit grayscale PNG, in the unit of the camera; 0 means no measurement. Masks are 8-bit PNG of object numbers,
0 for still surface (gray or palette indices, as by DAVIS and most mask tools), one folder for each view.
"""

from __future__ import annotations

import io
import re
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import UInt8, UInt16

from ..errors import InputError, needed
from .files import Place, read_input

if TYPE_CHECKING:
    from PIL import Image

FORMATS = ("PNG", "JPEG", "WEBP", "AVIF", "BMP", "TIFF", "TGA", "GIF", "PPM", "DDS")  # EPS would start another program
MOST_PIXELS = 1 << 26  # of a picture: 8192 x 8192, 200 MB in memory (guess)
DEEP = ("I;16", "I;16B", "I;16L", "I")  # modes of 16-bit grey pictures in versions of Pillow
_AGAIN = "record the frame again, or delete the file"
_MODES = ("L", "P", "1")  # of Pillow: gray, palette, black and white
_LIKE = "name folders view00, view01 ... and files frame_00000.png ..."


def last_number(name: str) -> int | None:
    """Return the last whole number in a name; None if it has no number."""
    numbers = re.findall(r"\d+", name)
    return int(numbers[-1][-18:]) if numbers else None


def read_picture(place: Place) -> UInt8[np.ndarray, "H W 3"]:
    """Read a picture as sRGB, without transparency. Raises InputError if it cannot be read, or is too large."""
    return _read(place, place.stat().st_mtime_ns if isinstance(place, Path) and place.exists() else 0)


@lru_cache(maxsize=4)  # as many as a frame and its neighbours have (guess)
def _read(place: Place, _changed: int) -> UInt8[np.ndarray, "H W 3"]:
    return parse_picture(read_input(place, "check it, or encode with --color none"), str(place))


def parse_picture(data: bytes, where: str) -> UInt8[np.ndarray, "H W 3"]:
    """Return the picture in the bytes of a file. Raises as `read_picture` does; messages begin with `where`."""
    wanted, remedy = "give PNG or JPEG, or --color none", "write it again, or encode with --color none"
    with opened(data, where, wanted, remedy) as image:
        if image.mode in DEEP:
            pixels = np.repeat((np.asarray(image).astype(np.float64)[..., None] / 257).round(), 3, axis=2)
            pixels = np.clip(pixels, 0, 255).astype(np.uint8)
        else:
            pixels = np.array(image.convert("RGB"))
    pixels.flags.writeable = False
    return pixels


@contextmanager
def opened(data: bytes, where: str, wanted: str, remedy: str) -> Iterator[Image.Image]:
    """Open a picture. Raises InputError, also of damage in the block: `where`, and `wanted`, or `remedy` for damage."""
    from PIL import Image, UnidentifiedImageError

    try:
        Image.init()
        with Image.open(io.BytesIO(data), formats=[name for name in FORMATS if name in Image.OPEN]) as image:
            if image.width * image.height > MOST_PIXELS:
                raise Image.DecompressionBombError
            yield image
    except InputError:
        raise
    except Image.DecompressionBombError:
        raise InputError(f"{where}: has more than 8192 x 8192 pixels; make it smaller") from None
    except UnidentifiedImageError:
        raise InputError(f"{where}: is no picture; {wanted}") from None
    except Exception as error:  # Pillow raises SyntaxError for a damaged chunk, RuntimeError for a damaged AVIF ...
        reason = getattr(error, "strerror", None) or error
        raise InputError(f"{where}: cannot be read ({reason}); {remedy}") from None


def pack_picture(pixels: UInt8[np.ndarray, "H W *C"] | UInt16[np.ndarray, "H W"]) -> bytes:
    """Return the bytes of a PNG file, grey or in colour. Raises InputError if Pillow is missing."""
    with needed("pictures need the extra `color`: pip install 'meshreel[color]'"):
        from PIL import Image
    packed = io.BytesIO()
    Image.fromarray(pixels).save(packed, format="PNG", compress_level=1)  # a quarter of the time for a tenth more
    return packed.getvalue()


def read_depth(path: Path) -> UInt16[np.ndarray, "H W"]:
    """Read a 16-bit grayscale PNG. Raises InputError if it cannot be read or has fewer bits."""
    return parse_depth(read_input(path), str(path))


def parse_depth(data: bytes, where: str) -> UInt16[np.ndarray, "H W"]:
    """Return the depths in the bytes of a file. Raises as `read_depth` does; messages begin with `where`."""
    wanted = "store depth as 16-bit grayscale PNG"
    with opened(data, where, wanted, _AGAIN) as image:
        if image.mode not in DEEP:
            kind = "8 bits a pixel" if image.mode in ("L", "P", "1") else f"mode {image.mode}"
            raise InputError(f"{where}: a depth picture of {kind}; {wanted}")
        return np.array(image, dtype=np.uint16)


def is_deep(data: bytes) -> bool:
    """Return True if the bytes of a file are a grey picture of 16 bits."""
    with suppress(InputError), opened(data, "", "", "") as image:
        return image.mode in DEEP
    return False


def read_mask(path: Path) -> UInt8[np.ndarray, "H W"]:
    """Read object numbers from an 8-bit gray or palette PNG. Raises InputError for other or unreadable files."""
    wanted, remedy = "store object numbers as 8-bit gray PNG", "make the mask again"
    with opened(read_input(path, remedy), str(path), wanted, remedy) as image:
        if image.mode not in _MODES:
            raise InputError(f"{path}: a mask of mode {image.mode}; {wanted}")
        return np.array(image).astype(np.uint8)


def is_mask(path: Path) -> bool:
    """Return True if the header of a file is that of a mask, False for color pictures and other files."""
    with suppress(InputError), opened(read_input(path), "", "", "") as image:
        return image.mode in _MODES
    return False


def find_masks(folder: Path, views: int, frames: int) -> list[list[Path]]:
    """Return the masks by view and frame, the last numbers in names. Raises InputError for none, or two of one."""
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
