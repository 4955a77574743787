"""`meshreel decode`: a .reel file becomes one mesh file per frame."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from ..container.reader import ReelReader
from ..decoder.video import open as open_video
from ..errors import FormatError, InputError
from ..io.write import frame_names, left_over, make_folder, write_mesh
from ..types import Mesh
from .console import Common

Part = Literal["all", "background", "moving"]


def command(
    file: Path,
    /,
    *,
    output: Annotated[Path, Parameter(name=["--output", "-o"])],
    format: Literal["ply", "obj", "glb"] = "ply",
    layers: int | None = None,
    only: Part = "all",
    common: Common = Common(),
) -> None:
    """Decode a .reel file into a directory of meshes.

    Parameters
    ----------
    file
        The .reel file. Frames of a damaged group are left out and the others written.
    output
        The directory to write frame_00000.ply and so on into; made if needed.
    format
        Of the mesh files.
    layers
        Use at most this many layers of a group beyond its first (subdivisions, or KLT components): a coarser, still
        valid shape.
    only
        Of a scene, what does not move or what moves; all of every frame if not given.
    """
    if layers is not None and layers < 0:
        raise InputError(f"--layers must not be negative, got {layers}")
    video = open_video(file).at(layers)
    check_part(file, video.reader, only)
    look: dict[str, Callable[[int], Mesh]]
    look = {"all": video.__getitem__, "background": video.background, "moving": video.moving}
    make_folder(output)
    names = frame_names(len(video), format)
    common.warn(left_over(output, names, f"frame_*.{format}"))
    failed: list[FormatError] = []
    with common.stages(len(video)) as progress:
        for i, name in enumerate(names):
            try:
                mesh = look[only](i)
            except FormatError as error:
                failed.append(error)
                (output / name).unlink(missing_ok=True)  # one of a run before would pass for this frame
            else:
                write_mesh(mesh, output / name)
            progress("decode", i + 1, len(video))
    if failed:
        text = f"{file}: {failed[0]}; {len(failed)} of {len(video)} frames are lost, the others are written"
        raise FormatError(f"{text}; copy the file again")
    row = {"output": str(output), "frames": len(video), "format": format, "frame_rate": video.frame_rate}
    common.result(row, f"{output}: {len(video)} {format} files")


def check_part(file: Path, reader: ReelReader, only: Part) -> None:
    """InputError where a file has no frame with the part that is asked for."""
    if only == "background" and not reader.has_background:
        raise InputError(f"{file}: has no background, leave out --only background")
    if only == "moving" and not reader.has_moving:
        raise InputError(f"{file}: has nothing that moves, leave out --only moving")
