"""`meshreel decode`: decode a .reel file into one mesh file per frame."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated, Any, Literal

from cyclopts import Parameter

from ..container.reader import ReelReader
from ..decoder.tracks import moving_of_frame
from ..decoder.video import Video
from ..decoder.video import open as open_video
from ..errors import FormatError, InputError
from ..export.frames import Part, check_part, write_frames
from ..export.splats import check_splats, write_splats
from ..geometry.topology import concatenate
from ..io.write import check_apart, frame_names, left_over, make_folder, replacing, write_mesh
from ..types import Mesh, Texture
from .console import Common


def command(
    file: Path,
    /,
    *,
    output: Annotated[Path, Parameter(name=["--output", "-o"])],
    format: Literal["ply", "obj", "glb", "npz", "spz"] = "ply",
    layers: int | None = None,
    only: Part = "all",
    splats: Annotated[bool, Parameter(negative="")] = False,
    audio: Annotated[bool, Parameter(negative="")] = False,
    common: Common = Common(),
) -> None:
    """Decode a .reel file into a directory of meshes.

    Parameters
    ----------
    file
        The .reel file. Frames of a damaged group are skipped; the others are written. Where colours alone are damaged,
        the surface is written without them.
    output
        The directory for frame_00000.ply and so on; created if needed.
    format
        Format of the mesh files. All keep colours of vertices; OBJ (with .mtl and .png), GLB and npz keep textures.
        Of splats, ply or spz.
    layers
        Largest number of layers (subdivisions, or KLT components) to decode of each group beyond its first: fewer
        give coarser, valid meshes from fewer bytes.
    only
        Of a scene, only the background, once for each change of it, or only the moving bodies; by default whole frames.
    splats
        Write the splats of each frame in place of meshes: PLY or SPZ files for viewers of 3D Gaussian splatting.
    audio
        Write the audio file instead, as it was given, to the file that --output names.
    """
    if layers is not None and layers < 0:
        raise InputError(f"--layers must not be negative, got {layers}")
    video = open_video(file).at(layers)
    if audio:
        _write_audio(file, video, output, common)
        return
    check_part(file, video.reader, only)
    if splats:
        _write_splats(file, video, output, format, common)
        return
    if format == "spz":
        raise InputError("--format spz: has splats and no meshes; add --splats, or give ply, obj, glb or npz")
    every: dict[Part, Callable[[Video, int], list[Mesh]]] = {
        "all": lambda of, frame: [*of.parts(frame).values()],
        "background": lambda of, frame: [of.background(frame)],
        "moving": lambda of, frame: moving_of_frame(of.tracks, frame),
    }
    parts = every[only]
    lost = _not_kept(video.reader, format)
    pictured = video.background if video.reader.has_textures and not lost else lambda _: None
    written = _changes(video.reader, pictured) if only == "background" else range(len(video))
    common.warn(lost)
    bare, pale = video.at(layers, colors=False), list[FormatError]()

    def decode(frame: int) -> Mesh:
        try:
            mesh = concatenate(parts(video, frame))
            if mesh.texture is None or lost:
                return replace(mesh, uv=None, texture=None)
            return replace(mesh, texture=Texture.of(mesh.texture.pixels))
        except FormatError as error:
            mesh = concatenate(parts(bare, frame))  # raises if the surface is damaged
            pale.append(error)
            return mesh

    every_name = frame_names(len(video), format)
    names = [every_name[frame] for frame in written]
    _write(file, output, names, (lambda at: decode(written[at]), write_mesh), common)
    if pale:
        text = f"{file}: {pale[0]}; {len(pale)} of {len(names)} frames are written without their colours"
        raise FormatError(f"{text}; copy the file again")
    row = {"output": str(output), "frames": len(video), "format": format, "frame_rate": video.frame_rate}
    row |= {"files": len(names)}
    once = ", the background once for each change of it, as the first frame that shows it"
    common.result(row, f"{output}: {len(names)} {format} files{once if only == 'background' else ''}")


def _changes(reader: ReelReader, pictured: Callable[[int], Mesh | None]) -> Sequence[int]:
    """Return the frames at which the background or its picture, an object of `pictured`, changes."""
    frames, before, mesh_before = list[int](), -1, None
    for frame in range(reader.frame_count):
        if (chunk := reader.static_of_frame(frame)) is None:
            continue
        try:
            mesh = pictured(frame)
        except FormatError:
            mesh = None  # reported when it is written
        if chunk.number != before or mesh is not mesh_before:
            frames.append(frame)
        before, mesh_before = chunk.number, mesh
    return frames


def _write_audio(file: Path, video: Video, output: Path, common: Common) -> None:
    """Write the audio file, byte for byte. Raises InputError if there is none."""
    clip = video.audio
    if clip is None:
        raise InputError(f"{file}: has no audio; meshreel tag --audio adds one")
    check_apart(output, [file])
    with replacing(output) as sink:
        sink.write(clip.data)
    row = {"output": str(output), "bytes": len(clip.data), "type": clip.media_type, "start_s": clip.start}
    common.result(row, f"{output}: {len(clip.data)} bytes of {clip.media_type}")


def _write_splats(file: Path, video: Video, output: Path, format: str, common: Common) -> None:
    """Write the splats of all frames. Raises InputError if there are none, or for a format of meshes."""
    if format not in ("ply", "spz"):
        raise InputError(f"--format {format}: splats are written as PLY or SPZ; give --format ply or spz")
    check_splats(video, str(file))
    _write(file, output, frame_names(len(video), format), (video.splats, write_splats), common)
    row = {"output": str(output), "frames": len(video), "format": format, "frame_rate": video.frame_rate}
    common.result(row, f"{output}: splats of {len(video)} frames, {format} files")


def _not_kept(reader: ReelReader, format: str) -> tuple[str, ...]:
    """Return a warning if files of a format cannot keep a video's textures."""
    if not reader.has_textures:
        return ()
    if format == "ply":
        return ("PLY has no textures, colours of vertices are kept: give --format obj or glb for textures",)
    if find_spec("av") and find_spec("PIL"):
        return ()
    return ("no textures, colours of vertices are kept: textures need the extra color: pip install 'meshreel[color]'",)


def _write(
    file: Path,
    output: Path,
    names: list[str],
    how: tuple[Callable[[int], Any], Callable[[Any, Path], None]],
    common: Common,
) -> None:
    """Decode and write frames by the functions `how`. Raises FormatError at the end if some are damaged."""
    make_folder(output)
    common.warn(left_over(output, names, f"frame_*{Path(names[0]).suffix}"))
    with common.stages(len(names)) as progress:
        paths, (decode, write) = [output / name for name in names], how
        failed = write_frames(decode, paths, lambda done: progress("decode", done, len(names)), write)
    if failed:
        lost = f"{len(failed)} of {len(names)} frames are lost, the others are written"
        lost = lost if len(failed) < len(names) else "all frames are lost"
        raise FormatError(f"{file}: {failed[0]}; {lost}; copy the file again, or encode it again")
