"""Export of a .reel file to one mesh file per frame.

In: a function that decodes a frame, and paths. Out: files, and the errors of the frames that cannot be decoded.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Literal

from ..container.reader import ReelReader
from ..errors import FormatError, InputError
from ..io.write import write_mesh

Part = Literal["all", "background", "moving"]


def write_frames(
    decode: Callable[[int], Any],
    paths: Sequence[Path],
    progress: Callable[[int], None] = lambda _: None,
    write: Callable[[Any, Path], None] = write_mesh,
) -> list[FormatError]:
    """Decode each frame `i` and `write` it to `paths[i]`; return the errors of damaged frames.

    The file of a damaged frame is removed if an earlier run left one. `progress` gets the number of frames done. Raises
    InputError if a file cannot be written.
    """
    failed: list[FormatError] = []
    for number, path in enumerate(paths):
        try:
            write(decode(number), path)  # writing decodes the texture
        except FormatError as error:
            failed.append(error)
            path.unlink(missing_ok=True)
        progress(number + 1)
    return failed


def check_part(file: Path, reader: ReelReader, part: Part) -> None:
    if part == "background" and not reader.has_background:
        raise InputError(f"{file}: has no background, leave out --only background")
    if part == "moving" and not reader.has_moving:
        raise InputError(f"{file}: has nothing that moves, leave out --only moving")
