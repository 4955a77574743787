"""`meshreel decode` and `export`: write a .reel file as one mesh file per frame, or as one animated file."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from contextlib import suppress
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated, Any, Literal

from cyclopts import Parameter

from ..container.reader import ReelReader
from ..decoder.video import Video
from ..decoder.video import open as open_video
from ..edit.metadata import tags_of
from ..errors import FormatError, InputError
from ..export.animated_file import ExportOptions
from ..export.animated_file import export as export_animated
from ..export.film_files import KINDS as FILMS
from ..export.frames import Part, check_part, check_splats, write_frames, write_splats
from ..format.layout import ChunkKind
from ..io.alembic import EXTENSION as ABC
from ..io.sequence import SequenceOptions
from ..io.usd import EXTENSIONS
from ..io.write import check_apart, check_free, frame_names, left_over, make_folder, write_file, write_mesh
from ..types import Mesh, Texture, Up
from .console import Common, Force
from .film import Filming, film

FLAGS = {".usdc": "usd"}  # of formats, where it is not their extension
How = tuple[Callable[[int], Any], Callable[[Any, Path], None]]  # decodes a frame, and writes it
UNKNOWN = "chunks of kinds that this version does not know (update meshreel)"
CONTENTS: dict[int, str] = {  # of chunks, by their kind, and how else they are written; "": in all outputs
    ChunkKind.STATIC: "background (meshreel decode without --splats)",
    **dict.fromkeys((ChunkKind.GROUP, ChunkKind.COLORS), ""),
    **dict.fromkeys((ChunkKind.ATLAS, ChunkKind.PICTURES, ChunkKind.COMPATIBLE), "textures"),
    ChunkKind.SPLATS: "splats (meshreel decode --splats)",
    ChunkKind.AUDIO: "audio (meshreel decode --audio)",
}


def decode(
    file: Path,
    /,
    *,
    output: Annotated[Path, Parameter(name=["--output", "-o"])],
    format: Literal["ply", "obj", "glb", "npz", "spz"] = "ply",
    layers: int | None = None,
    only: Part = "all",
    splats: Annotated[bool, Parameter(negative="")] = False,
    audio: Annotated[bool, Parameter(negative="")] = False,
    force: Force = False,
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
        Of splats, ply, spz or glb (KHR_gaussian_splatting).
    layers
        Largest number of layers (subdivisions, or KLT components) to decode of each group beyond its first: fewer
        give coarser, valid meshes from fewer bytes.
    only
        Of a scene, only the background, once for each change of it, or only the moving bodies; by default whole frames.
    splats
        Write the splats of each frame in place of meshes: PLY, SPZ or GLB files for viewers of 3D Gaussian splatting.
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
        check_free((output / name for name in frame_names(len(video), format)), force, [file])
        common.warn(unwritten(file, video.reader, ("splats",)))
        _write_splats(file, video, output, format, common)
        return
    if format == "spz":
        raise InputError("--format spz: has splats and no meshes; add --splats, or give ply, obj, glb or npz")
    looks: dict[Part, Callable[[Video, int], Mesh]]
    looks = {"all": Video.__getitem__, "background": Video.background, "moving": Video.moving}
    lost = _not_kept(video.reader, format)
    pictured = video.background if video.reader.has_textures and not lost else lambda _: None
    written = _changes(video.reader, pictured) if only == "background" else range(len(video))
    bare, pale = video.at(layers, colors=False), list[FormatError]()

    def decoded(frame: int) -> Mesh:
        try:
            mesh = looks[only](video, frame)
            if mesh.texture is None or lost:
                return replace(mesh, uv=None, texture=None)
            return replace(mesh, texture=Texture.of(mesh.texture.pixels))
        except FormatError as error:
            mesh = looks[only](bare, frame)  # raises if the surface is damaged
            pale.append(error)
            return mesh

    every_name = frame_names(len(video), format)
    names = [every_name[frame] for frame in written]
    kinds = (f".{format}", *((".png", ".mtl") if format == "obj" and video.reader.has_textures else ()))
    check_free(((output / name).with_suffix(kind) for name in names for kind in kinds), force, [file])
    common.warn(unwritten(file, video.reader, ("background",), lost))
    _write(file, output, names, (lambda at: decoded(written[at]), write_mesh), common)
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
    write_file(output, clip.data)
    row = {"output": str(output), "bytes": len(clip.data), "type": clip.media_type, "start_s": clip.start}
    common.result(row, f"{output}: {len(clip.data)} bytes of {clip.media_type}")


def _write_splats(file: Path, video: Video, output: Path, format: str, common: Common) -> None:
    """Write the splats of all frames. Raises InputError if there are none, or for a format of meshes."""
    if format not in ("ply", "spz", "glb"):
        raise InputError(f"--format {format}: splats are written as PLY, SPZ or GLB; give --format ply, spz or glb")
    check_splats(video, str(file))
    _write(file, output, frame_names(len(video), format), (video.splats, write_splats), common)
    row = {"output": str(output), "frames": len(video), "format": format, "frame_rate": video.frame_rate}
    common.result(row, f"{output}: splats of {len(video)} frames, {format} files")


def unwritten(file: Path, reader: ReelReader, kept: Collection[str], textures: str = "") -> list[str]:
    """Return a warning that names all that an output lacks, but what is `kept`; `textures` is the remedy for these."""
    found = [CONTENTS.get(chunk.kind, UNKNOWN) for chunk in reader.chunks]
    found += ["uneven times of frames (meshreel export)"] if reader.header.intervals else []
    found += ["tags (meshreel info --json)"] if tags_of(reader.metadata) else []
    lost = [name for name in dict.fromkeys(found) if name.split(" (")[0] not in ("", "textures", *kept)]
    lost += [f"textures ({textures})"] if textures and "textures" in found else []
    return [f"{file}: not written: {', '.join(lost)}"] if lost else []


def _not_kept(reader: ReelReader, format: str) -> str:
    """Return a remedy if files of a format cannot keep a video's textures."""
    if reader.has_textures and format == "ply":
        return "PLY has no textures, colours of vertices are kept: give --format obj or glb for textures"
    if reader.has_textures and not (find_spec("av") and find_spec("PIL")):
        return "colours of vertices are kept: textures need the extra color: pip install 'meshreel[color]'"
    return ""


def _write(file: Path, output: Path, names: list[str], how: How, common: Common) -> None:
    """Decode and write frames by the functions `how`. Raises FormatError at the end if some are damaged."""
    is_new = not output.exists()
    make_folder(output)
    common.warn(left_over(output, names, f"frame_*{Path(names[0]).suffix}"))
    with common.stages() as progress:
        paths, (decode, write) = [output / name for name in names], how
        failed = write_frames(decode, paths, lambda done: progress("decode", done, len(names)), write)
    if failed:
        lost = f"{len(failed)} of {len(names)} frames are lost, the others are written"
        if len(failed) == len(names):
            lost = "all frames are lost"
            if is_new:
                with suppress(OSError):  # another program has put something there
                    output.rmdir()
        raise FormatError(f"{file}: {failed[0]}; {lost}; copy the file again, or encode it again")


def export(
    file: Path,
    /,
    *,
    output: Annotated[Path | None, Parameter(name=["--output", "-o"])] = None,
    glb: Annotated[bool, Parameter(negative="")] = False,
    usd: Annotated[bool, Parameter(negative="")] = False,
    mp4: Annotated[bool, Parameter(negative="")] = False,
    webm: Annotated[bool, Parameter(negative="")] = False,
    gif: Annotated[bool, Parameter(negative="")] = False,
    layers: int | None = None,
    frames: str = ":",
    only: Part = "all",
    up: Annotated[Up | None, Parameter(allow_leading_hyphen=True)] = None,
    texture: Annotated[bool, Parameter(negative="")] = False,
    compress: Annotated[bool, Parameter(negative="")] = False,
    filming: Filming = Filming(),
    force: Force = False,
    common: Common = Common(),
) -> None:
    """Write a .reel file as one animated file: GLB for viewers, USD or Alembic for film tools; or as a film to post.

    Parameters
    ----------
    file
        The .reel file. Nothing is written where a group of it is damaged.
    output
        The file to write: .glb, .abc, .usdc or .usd (binary), .usda (text), .usdz (package), .mp4, .webm, .gif, or
        .png, a picture of the first frame. If not given, the name of the .reel file with the extension of the format,
        in the current directory.
    glb
        Write GLB; implied by the extension of `output`.
    usd
        Write USD; implied by the extension of `output`. Needs the extra `usd`.
    mp4
        Write a film in H.264, with the audio that MP4 takes; implied by the extension of `output`, as the next two.
        Films need the extra `color`.
    webm
        Write a film in VP9, with audio in Opus.
    gif
        Write a film without sound that begins again at its end.
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
        Write textures, too, which take far more space than colours of vertices: in USD and Alembic one of each frame,
        PNG files in the folder NAME_textures (.usdz: inside); in GLB, which cannot change a picture in time, one for
        each mesh. Needs the extra `color`.
    compress
        Compress GLB to a quarter of its bytes or so, for viewers that know `EXT_meshopt_compression` and
        `KHR_mesh_quantization`. Needs the extra `glb`.
    """
    kinds = {".glb": glb, ".usdc": usd, ".mp4": mp4, ".webm": webm, ".gif": gif}
    target = _target(file, output, [kind for kind, wanted in kinds.items() if wanted])
    options, is_film = ExportOptions(layers, only, up, texture, compress), target.suffix.lower() in FILMS
    if is_film and (texture or compress):
        raise InputError(f"--{'texture' if texture else 'compress'}: is for GLB and USD; pictures always have textures")
    if filming.given and not is_film:
        raise InputError(f"{filming.given}: is for films, {', '.join(FILMS)}; {target} is none")
    wanted = SequenceOptions(frames=frames)
    with open_video(file) as video:
        if target.exists() and target.samefile(file):  # also through links and under other names
            raise InputError(f"{target}: is the recording itself, which would be lost; give another name with -o")
        has_folder = texture and target.suffix.lower() not in (".glb", ".usdz")
        pictures = sorted(target.with_name(f"{target.stem}_textures").glob("*")) if has_folder else []
        check_free([*([] if output else [target]), *pictures], force)
        check_part(file, video.reader, only)
        chosen = wanted.chosen(len(video))
        try:
            if is_film:
                written = film(video.reader, target, chosen, filming.options(options), common)
            else:
                with common.stages() as progress:
                    count = export_animated(video.reader, target, chosen, options, progress)
        except FormatError as error:
            raise FormatError(f"{file}: {error}; nothing is written, copy the file again") from error
    row = {"output": str(target), "format": target.suffix[1:].lower(), "bytes": target.stat().st_size}
    if is_film:
        kept = ("background", "textures", "splats", "uneven times of frames", *(["audio"] if written.has_audio else []))
        common.warn(unwritten(file, video.reader, kept))
        row |= {"pictures": written.pictures}
        common.result(row, f"{target}: {written.pictures} pictures, {row['bytes']} bytes")
        return
    _warn_of_textures(file, video.reader, target, options, common)
    if count == 0:
        common.warn([f"{target}: no frame has a surface, so it shows nothing"])
    row |= {"frames": len(chosen), "frame_rate": video.frame_rate, "meshes": count}
    common.result(row, f"{target}: {len(chosen)} frames in {count} meshes, {row['bytes']} bytes")


def _warn_of_textures(file: Path, reader: ReelReader, target: Path, options: ExportOptions, common: Common) -> None:
    """Warn of what an animated file lacks."""
    texture = options.texture
    pale = "" if texture else "colours of vertices are: --texture writes them"
    common.warn(unwritten(file, reader, ("background", "uneven times of frames"), pale))
    if texture and not reader.has_textures:
        common.warn([f"{file}: has no textures to export"])
    elif texture and target.suffix.lower() == ".glb":
        common.warn([f"{target}: glTF cannot change a picture in time: each mesh has the texture of its first frame"])
    elif texture and reader.has_background and options.only != "moving":
        common.warn([f"{target}: the background has its first picture in all frames: its shadows stand still"])


def _target(file: Path, output: Path | None, kinds: list[str]) -> Path:
    """Return the file to write. Raises InputError if flags and name give no format, or different ones."""
    if len(kinds) > 1:
        raise InputError(f"{' and '.join(f'--{FLAGS.get(kind, kind[1:])}' for kind in kinds)}: give one of them")
    if output is None:
        if not kinds:
            raise InputError("no format: give --glb, --usd, --mp4, --webm, --gif, or a name with -o")
        return Path(file.stem + kinds[0])
    extensions = (".glb", ABC, *EXTENSIONS, *FILMS) if not kinds else EXTENSIONS if kinds == [".usdc"] else tuple(kinds)
    if output.suffix.lower() not in extensions:
        text = f"{output}: the output must end in {' or '.join(extensions)}"
        raise InputError(f"{text}; a mesh file for each frame is written by meshreel decode")
    return output
