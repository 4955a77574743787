"""Export of a .reel file to one animated file that other programs play: GLB, USD or Alembic.

Frames of a group with the same vertices become one moving shape, every other frame a shape that is visible for one
frame. The states of a background are still shapes.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from itertools import accumulate, chain
from pathlib import Path

import numpy as np
from jaxtyping import Float32

from ..container.reader import Chunk, ReelReader
from ..decoder.pictures import Decoders
from ..decoder.tracks import Background, Track
from ..errors import InputError, path_of
from ..format.layout import Form
from ..io.alembic import EXTENSION
from ..io.usd import EXTENSIONS
from ..types import Mesh, Up
from .animated_abc import AbcWriter, animated_abc
from .animated_glb import GlbWriter, animated_glb
from .animated_usd import UsdWriter, animated_usd
from .frames import Part
from .shapes import Animation, Shape, check_output

MOST_FRAMES = 64  # of a shape, all in memory together; viewers limit the morph targets of a mesh (guess)
_FAR = 8.0  # diagonals; coordinates farther from the origin are stored relative to the center (guess)

Writer = GlbWriter | UsdWriter | AbcWriter
Progress = Callable[[str, int, int], None]  # stage, number of frames done, number of all frames


@dataclass(frozen=True, slots=True)
class ExportOptions:
    """Layers, parts and orientation of an export."""

    layers: int | None = None  # largest number of layers of each group beyond its first; None: all
    only: Part = "all"
    up: Up | None = None  # axis of the meshes that becomes the file's +y; None: the axis that the .reel file names
    texture: bool = False  # write textures: of each frame in USD, of each shape's first in GLB, which cannot change it
    compressed: bool = False  # GLB only: EXT_meshopt_compression and KHR_mesh_quantization

    def __post_init__(self) -> None:
        if self.layers is not None and self.layers < 0:
            raise InputError(f"layers must not be negative, got {self.layers}: give a number, or None for all")


@dataclass(frozen=True, slots=True)
class _Source:
    """A .reel file, decoded on access, and the frames to export."""

    reader: ReelReader
    tracks: tuple[Track, ...]
    background: Background
    frames: range
    textured: bool


def export(
    reader: ReelReader,
    path: Path,
    frames: range | None = None,
    options: ExportOptions = ExportOptions(),
    progress: Progress | None = None,
) -> int:
    """Write consecutive frames, by default all, to a .glb, .abc, .usd, .usdc, .usda or .usdz; return the shape count.

    The file appears when it is complete. At most two groups are in memory. Raises InputError if the format cannot hold
    the frames or the file cannot be written, and FormatError if a chunk is damaged.
    """
    path, frames = Path(path_of(path)), range(reader.frame_count) if frames is None else frames
    decoders, numbers = Decoders(), range(len(reader.tracks))
    tracks = tuple(Track(reader, number, decoders, options.layers) for number in numbers)
    source = _Source(reader, tracks, Background(reader, decoders), frames, options.texture)
    states = _states(source) if options.only != "moving" else ()
    moving = _moving(source, progress) if options.only != "background" else ()
    written = 0
    with _writer(path, _animation(reader, frames, options.up or reader.up), options.compressed) as writer:
        for shape in chain(states, moving):
            writer.add(shape)
            written += 1
    return written


def _writer(path: Path, animation: Animation, compressed: bool) -> AbstractContextManager[Writer]:
    check_output(path)
    extension = path.suffix.lower()
    if extension == ".glb":
        return animated_glb(path, animation, compressed)
    if compressed:
        raise InputError(f"{path}: only .glb is compressed; name such a file, or leave compression out")
    if extension == EXTENSION:
        return animated_abc(path, animation)
    if extension in EXTENSIONS:
        return animated_usd(path, animation)
    known = ", ".join((".glb", EXTENSION, *EXTENSIONS))
    raise InputError(f"{path}: {extension or 'no'} extension is not one of {known}; choose one")


def _animation(reader: ReelReader, frames: range, up: Up) -> Animation:
    """Return the times of the frames, from 0 for the first, and the coordinate system."""
    header = reader.header
    if header.intervals:
        chosen = header.intervals[frames.start : frames.stop - 1]
        times = np.array(list(accumulate(chosen, initial=0)), np.float64) / 1e6
    else:
        times = np.arange(len(frames)) / header.frame_rate
    corners = np.array(reader.box)
    is_far = np.abs(corners).max() > _FAR * np.linalg.norm(corners[1] - corners[0])
    x, y, z = corners.mean(axis=0).tolist() if is_far else (0.0, 0.0, 0.0)
    return Animation(times, header.frame_rate, (x, y, z), up, reader.view)


def _states(source: _Source) -> Iterator[Shape]:
    """Yield a shape for each state of the background, with the ranges of exported frames that show it."""
    frames = source.frames
    for number, spans in enumerate(source.reader.static_ranges(frames).values()):
        mesh = source.background.of_frame(spans[0][0])
        if mesh is not None and not mesh.is_empty:
            visible = tuple((first - frames.start, end - frames.start) for first, end in spans)
            uv = _uv(source, mesh)
            yield Shape("background", f"state_{number}", mesh.faces, visible[0][0], [mesh], visible, uv)


def _moving(source: _Source, progress: Progress | None) -> Iterator[Shape]:
    frames = source.frames
    for number, groups in enumerate(source.reader.tracks):
        for group in groups:
            exported = range(max(group.shown.start, frames.start), min(group.shown.stop, frames.stop))
            if exported:
                yield from _group_shapes(source, group, exported)
                if progress is not None:
                    done = number * len(frames) + exported.stop - frames.start
                    progress("export", done // len(source.tracks), len(frames))


def _group_shapes(source: _Source, group: Chunk, own: range) -> Iterator[Shape]:
    """Yield the shapes of the exported frames of a group."""
    track = source.tracks[group.track]
    if group.form == Form.EMPTY:
        track[own.start]  # raises FormatError if the group is damaged
        return
    meshes = [track[frame] for frame in own]
    for a, b in _shape_ranges(meshes):
        if not meshes[a].is_empty:
            moving = [*meshes[a:b], *_ahead(source, group, meshes[:b], own[b - 1] + 1)]
            first, name = own[a] - source.frames.start, f"frames_{own[a]}_to_{own[b - 1]}"
            span = (first, first + b - a)
            part, uv = f"track_{group.track}", _uv(source, meshes[a])
            yield Shape(part, name, meshes[a].faces, first, moving, (span,), uv)


def _shape_ranges(meshes: Sequence[Mesh]) -> Iterator[tuple[int, int]]:
    """Yield first frame and end of consecutive frames that form one shape, at most MOST_FRAMES each."""
    first = 0
    for frame in range(1, len(meshes) + 1):
        if frame == len(meshes) or frame - first == MOST_FRAMES or not _is_moved(meshes[frame - 1], meshes[frame]):
            yield first, frame
            first = frame


def _ahead(source: _Source, group: Chunk, meshes: Sequence[Mesh], frame: int) -> list[Mesh]:
    """Return the frame after `meshes`, the frames of a group, if the shape continues to move into it.

    The group after this one, if predicted from it, may have the same vertices. The faces of patches may be equal by
    chance, so the last two frames must be known to have no patches.
    """
    if frame not in source.frames:
        return []
    track, following = source.tracks[group.track], source.reader.chunk_of_frame(frame, group.track)
    if following == group:
        return [track[frame]] if _is_moved(meshes[-1], track[frame]) else []
    if source.reader.group_before(following) != group or len(meshes) < 2 or not _is_moved(*meshes[-2:]):
        return []
    mesh = track[frame]
    same = len(mesh.vertices) == len(meshes[-1].vertices) and np.array_equal(mesh.faces, meshes[-1].faces)
    return [mesh] if same else []


def _is_moved(before: Mesh, after: Mesh) -> bool:
    """Return whether two frames of a group have the same vertices, in different places.

    Frames that are decoded from one template share its faces in memory. Equal faces prove nothing: faces of patches,
    or of frames coded one by one, may be equal by chance.
    """
    same_place = before.faces.ctypes.data == after.faces.ctypes.data
    return same_place and before.faces.shape == after.faces.shape and len(before.vertices) == len(after.vertices)


def _uv(source: _Source, mesh: Mesh) -> Float32[np.ndarray, "F 3 2"] | None:
    return mesh.uv if source.textured and mesh.texture is not None else None
