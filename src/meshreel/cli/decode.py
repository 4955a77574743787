"""`meshreel decode`: a .reel file becomes one mesh file per frame."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from ..decoder import open as open_video
from ..errors import InputError
from ..io.write import write_mesh
from .console import Common


def command(
    file: Path,
    *,
    output: Annotated[Path, Parameter(name=["--output", "-o"])],
    format: Literal["ply", "obj", "glb"] = "ply",
    components: int | None = None,
    common: Common = Common(),
) -> None:
    """Decode a .reel file into a directory of meshes.

    Parameters
    ----------
    file
        The .reel file.
    output
        The directory to write frame_00000.ply and so on into; made if needed.
    format
        Of the mesh files.
    components
        Use at most this many KLT components per group: a coarser, still valid shape.
    """
    if components is not None and components < 0:
        raise InputError(f"--components must not be negative, got {components}")
    video = open_video(file).at(components)
    output.mkdir(parents=True, exist_ok=True)
    digits = max(5, len(str(len(video))))
    with common.stages(len(video)) as progress:
        for i, mesh in enumerate(video):
            write_mesh(mesh, output / f"frame_{i:0{digits}}.{format}")
            progress("decode", i + 1, len(video))
    row = {"output": str(output), "frames": len(video), "format": format}
    common.result(row, f"{output}: {len(video)} {format} files")
