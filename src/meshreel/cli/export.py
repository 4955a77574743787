"""`meshreel export`: write a .reel file as one animated file that other programs play."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from ..decoder.video import open as open_video
from ..errors import FormatError, InputError
from ..export.animated_file import ExportOptions, export
from ..export.animated_usd import EXTENSIONS
from ..export.frames import Part, check_part
from ..io.sequence import SequenceOptions
from ..types import Up
from .console import Common


def command(
    file: Path,
    /,
    *,
    output: Annotated[Path | None, Parameter(name=["--output", "-o"])] = None,
    glb: Annotated[bool, Parameter(negative="")] = False,
    usd: Annotated[bool, Parameter(negative="")] = False,
    layers: int | None = None,
    frames: str = ":",
    only: Part = "all",
    up: Annotated[Up | None, Parameter(allow_leading_hyphen=True)] = None,
    texture: Annotated[bool, Parameter(negative="")] = False,
    compress: Annotated[bool, Parameter(negative="")] = False,
    common: Common = Common(),
) -> None:
    """Write a .reel file as one animated file: GLB for viewers and engines, USD for film tools.

    Parameters
    ----------
    file
        The .reel file. Nothing is written where a group of it is damaged.
    output
        The file to write: .glb, .usdc or .usd (binary), .usda (text), .usdz (package). If not given, the name of the
        .reel file with .glb or .usdc, in the current directory.
    glb
        Write GLB; implied by the extension of `output`.
    usd
        Write USD; implied by the extension of `output`. Needs the extra `usd`.
    layers
        Largest number of layers (subdivisions, or KLT components) to decode of each group beyond its first: fewer
        give coarser, valid meshes from fewer bytes.
    frames
        Frames to export, as A:B with B excluded.
    only
        Of a scene, only the background or only the moving bodies; by default whole frames.
    up
        Axis of the meshes that points up; by default the one that the .reel file names. In the written file it is +y.
    texture
        Write textures, too, which take far more space than colours of vertices: in USD one of each frame, PNG files in
        the folder NAME_textures (.usdz: inside); in GLB, which cannot change a picture in time, one for each mesh.
        Needs the extra `color`.
    compress
        Compress GLB to a quarter of its bytes or so, for viewers that know `EXT_meshopt_compression` and
        `KHR_mesh_quantization`. Needs the extra `glb`.
    """
    options = ExportOptions(layers, only, up, texture, compress)
    target = _target(file, output, glb, usd)
    wanted = SequenceOptions(frames=frames)
    with open_video(file) as video:
        if target.exists() and target.samefile(file):  # also through links and under other names
            raise InputError(f"{target}: is the recording itself, which would be lost; give another name with -o")
        check_part(file, video.reader, only)
        chosen = wanted.chosen(len(video))
        try:
            with common.stages(len(chosen)) as progress:
                count = export(video.reader, target, chosen, options, progress)
        except FormatError as error:
            raise FormatError(f"{file}: {error}; nothing is written, copy the file again") from error
    if count == 0:
        common.warn([f"{target}: no frame has a surface, so it shows nothing"])
    if texture and not video.reader.has_textures:
        common.warn([f"{file}: has no textures to export"])
    elif texture and target.suffix.lower() == ".glb":
        common.warn([f"{target}: glTF cannot change a picture in time: each mesh has the texture of its first frame"])
    elif texture and video.reader.has_background and only != "moving":
        common.warn([f"{target}: the background has its first picture in all frames: its shadows stand still"])
    size = target.stat().st_size
    row = {"output": str(target), "format": target.suffix[1:].lower(), "bytes": size}
    row |= {"frames": len(chosen), "frame_rate": video.frame_rate, "meshes": count}
    common.result(row, f"{target}: {len(chosen)} frames in {count} meshes, {size} bytes")


def _target(file: Path, output: Path | None, glb: bool, usd: bool) -> Path:
    """Return the file to write. Raises InputError if flags and name give no format, or different ones."""
    if glb and usd:
        raise InputError("--glb and --usd: give one of both")
    if output is None:
        if not (glb or usd):
            raise InputError("no format: give --glb, --usd, or a name with -o")
        return Path(file.stem + (".glb" if glb else ".usdc"))
    extensions = (".glb",) if glb else EXTENSIONS if usd else (".glb", *EXTENSIONS)
    if output.suffix.lower() not in extensions:
        text = f"{output}: the output must end in {' or '.join(extensions)}"
        raise InputError(f"{text}; a mesh file for each frame is written by meshreel decode")
    return output
