"""Pictures of textures and of colour cameras: any file that Pillow reads, as 8-bit sRGB.

In: a file, or the materials that an OBJ names. Out: an array H x W x 3, read on access and cached for a while.
"""

from __future__ import annotations

import io
from collections.abc import Iterator
from contextlib import contextmanager
from functools import lru_cache, partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import UInt8, UInt16

from ..errors import InputError
from ..types import Texture
from .polygons import Dropped
from .read import read_file, read_input
from .remote import Place

if TYPE_CHECKING:
    from PIL import Image

FORMATS = ("PNG", "JPEG", "WEBP", "AVIF", "BMP", "TIFF", "TGA", "GIF", "PPM")  # EPS would start another program
MOST_PIXELS = 1 << 26  # of a picture: 8192 x 8192, 200 MB in memory (guess)
DEEP = ("I;16", "I;16B", "I;16L", "I")  # modes of 16-bit grey pictures in versions of Pillow


def read_picture(place: Place) -> UInt8[np.ndarray, "H W 3"]:
    """Read a picture as sRGB, without transparency. Raises InputError if it cannot be read, or is too large."""
    return _read(place, place.stat().st_mtime_ns if isinstance(place, Path) and place.exists() else 0)


@lru_cache(maxsize=4)  # as many as a frame and its neighbours have (guess)
def _read(place: Place, changed: int) -> UInt8[np.ndarray, "H W 3"]:
    del changed
    return parse_picture(read_input(place, "check it, or encode with --color none"), str(place))


def parse_picture(data: bytes, where: str) -> UInt8[np.ndarray, "H W 3"]:
    """Return the picture in the bytes of a file. Raises as `read_picture` does; messages begin with `where`."""
    with opened(
        data, where, "give PNG or JPEG, or --color none", "write it again, or encode with --color none"
    ) as image:
        if image.mode in DEEP:
            pixels = np.repeat((np.asarray(image).astype(np.float64)[..., None] / 257).round(), 3, axis=2)
            pixels = np.clip(pixels, 0, 255).astype(np.uint8)
        else:
            pixels = np.array(image.convert("RGB"))
    pixels.flags.writeable = False
    return pixels


@contextmanager
def opened(data: bytes, where: str, wanted: str, remedy: str) -> Iterator[Image.Image]:
    """Open the picture in the bytes of a file.

    Raises InputError, also for damage found inside the block; its message begins with `where`, and ends with `wanted`
    if the bytes are no picture, or with the `remedy` for damage.
    """
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
    try:
        from PIL import Image
    except ImportError:
        raise InputError("pictures need the extra `color`: pip install 'meshreel[color]'") from None
    packed = io.BytesIO()
    Image.fromarray(pixels).save(packed, format="PNG", compress_level=1)  # a quarter of the time for a tenth more
    return packed.getvalue()


def texture_of_materials(mesh: Place, files: tuple[str, ...], used: tuple[str, ...]) -> tuple[Texture | None, Dropped]:
    """Return the texture shared by all faces of an OBJ, and the kinds of dropped material data."""
    picture_of, dropped = dict[str, str | None](), set[str]()
    for name in files:
        try:
            text = read_file(_beside(mesh, name)).decode("utf-8-sig", "replace")  # some editors begin with a mark
        except (OSError, ValueError):  # of a name with a null
            dropped.add(f"materials ({name} cannot be read)")
            continue
        dropped |= _parse_materials(text, picture_of)
    pictures = {picture_of.get(name) for name in used} if used else {*picture_of.values()}
    if len(pictures) > 1:
        return None, frozenset(dropped | {"several materials"})
    if not pictures or (picture := pictures.pop()) is None:
        return None, frozenset(dropped)
    place = _beside(mesh, picture)
    if isinstance(place, Path) and not _exists(place):
        return None, frozenset(dropped | {f"a texture ({picture} is not there)"})
    return Texture(partial(read_picture, place)), frozenset(dropped)  # read when its pixels are asked for


def _exists(place: Path) -> bool:
    try:
        return place.exists()
    except (OSError, ValueError):  # of a name too long, or with a null
        return False


def _beside(mesh: Place, name: str) -> Place:
    """Return the path of a file that a mesh names, relative to the mesh."""
    name = name.replace("\\", "/")
    return (mesh.parent if isinstance(mesh, Path) else type(mesh)(str(mesh).rsplit("/", 1)[0])) / name


def _parse_materials(text: str, picture_of: dict[str, str | None]) -> Dropped:
    """Add to `picture_of` the picture of each material in a text, None for one without; return what is dropped."""
    name, dropped = "", set[str]()
    for words in (line.split(maxsplit=1) for line in text.splitlines()):
        keyword, rest = words[0].lower() if words else "", words[1].strip() if len(words) > 1 else ""
        if keyword == "newmtl":
            name = rest
            picture_of[name] = None
        elif keyword == "map_kd" and rest:
            picture_of[name] = rest.split()[-1] if rest.startswith("-") else rest  # behind options
        elif keyword == "map_d":
            dropped.add("transparency")
        elif keyword in ("norm", "bump", "map_bump", "map_kn"):
            dropped.add("normal maps")
    return frozenset(dropped)
