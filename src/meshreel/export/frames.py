"""Export of a .reel file to one mesh file per frame.

In: a function that decodes a frame, and paths. Out: files, and the errors of the frames that cannot be decoded.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Literal

import numpy as np

from ..container.reader import ReelReader
from ..errors import FormatError, InputError
from ..geometry.topology import concatenate
from ..io.write import write_mesh
from ..types import GREY, Mesh, Texture

Part = Literal["all", "background", "moving"]


def write_frames(
    decode: Callable[[int], Mesh], paths: Sequence[Path], progress: Callable[[int], None] = lambda _: None
) -> list[FormatError]:
    """Write frame `i`, as `decode(i)` returns it, to `paths[i]`; return the errors of damaged frames.

    The file of a damaged frame is removed if an earlier run left one. `progress` gets the number of frames done. Raises
    InputError if a file cannot be written.
    """
    failed: list[FormatError] = []
    for number, path in enumerate(paths):
        try:
            write_mesh(decode(number), path)  # which decodes the texture
        except FormatError as error:
            failed.append(error)
            path.unlink(missing_ok=True)
        progress(number + 1)
    return failed


def joined(meshes: Sequence[Mesh]) -> Mesh:
    """Return the parts of a frame as one mesh; where some have textures, its one has all of them side by side."""
    textured = [(mesh.uv, mesh.texture) for mesh in meshes if mesh.uv is not None and mesh.texture is not None]
    if len(textured) < 2:
        return concatenate(meshes)
    pictures = [texture.pixels for _, texture in textured]
    height, width = max(len(picture) for picture in pictures), sum(picture.shape[1] for picture in pictures)
    whole, found, left = np.full((height, width, 3), GREY, np.uint8), list[Mesh](), 0
    texture = Texture.of(whole)
    for mesh in meshes:
        if mesh.uv is not None and mesh.texture is not None:
            picture = pictures.pop(0)
            rows, columns = picture.shape[:2]
            whole[:rows, left : left + columns] = picture
            scale, origin = np.array([columns / width, rows / height]), np.array([left / width, 1 - rows / height])
            mesh = replace(mesh, uv=(origin + scale * mesh.uv).astype(np.float32), texture=texture)
            left += columns
        found.append(mesh)
    return concatenate(found)


def check_part(file: Path, reader: ReelReader, part: Part) -> None:
    """Raise InputError if no frame of a file has the part."""
    if part == "background" and not reader.has_background:
        raise InputError(f"{file}: has no background, leave out --only background")
    if part == "moving" and not reader.has_moving:
        raise InputError(f"{file}: has nothing that moves, leave out --only moving")
