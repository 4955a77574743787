"""A .reel file as one animated file that other programs play: GLB, or USD.

In: a reader and a path. Out: the file. Frames of a group that have the same vertices become one shape that moves; other
frames a shape each, shown for one frame. The states of a background are shapes that stand still.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from itertools import accumulate, pairwise
from pathlib import Path
from typing import Literal

import numpy as np

from ..container.reader import Chunk, ReelReader
from ..decoder.tracks import Background, Track
from ..errors import InputError
from ..format.layout import Form
from ..geometry.topology import vertex_normals
from ..types import Mesh, Up
from .animated_glb import animated_glb
from .animated_usd import EXTENSIONS, animated_usd
from .shapes import Animation, AnimationWriter, Points, Shape, check_target

MOST_TOGETHER = 64  # frames of a shape: what viewers take as morph targets of one mesh, and what is in memory
_FAR = 8.0  # diagonals from the origin from which float32 coordinates count from elsewhere

Progress = Callable[[str, int, int], None]  # stage, frames done, frames of all


@dataclass(frozen=True, slots=True)
class ExportOptions:
    """What of a file is exported."""

    layers: int | None = None  # of a group beyond its first, at most; None: all
    only: Literal["all", "background", "moving"] = "all"
    up: Up | None = None  # axis of the meshes that points up, the file's if not given; +y does in what is written

    def __post_init__(self) -> None:
        if self.layers is not None and self.layers < 0:
            raise InputError(f"layers must not be negative, got {self.layers}: give a number, or None for all")


@dataclass(frozen=True, slots=True)
class _Source:
    """A file, decoded as it is asked for, and which frames of it are wanted."""

    reader: ReelReader
    tracks: tuple[Track, ...]
    background: Background
    frames: range


def export(
    reader: ReelReader,
    path: Path,
    frames: range | None = None,
    options: ExportOptions = ExportOptions(),
    progress: Progress | None = None,
) -> int:
    """Writes some frames in a row, all if not given, to a .glb, .usd, .usdc, .usda or .usdz file; how many shapes.

    The file appears when it is complete. Memory is that of two groups. Raises InputError where the format cannot hold
    them or the file cannot be written, and FormatError where a chunk is damaged.
    """
    frames = range(reader.frame_count) if frames is None else frames
    tracks = tuple(Track(reader, number, options.layers) for number in range(len(reader.tracks)))
    source = _Source(reader, tracks, Background(reader), frames)
    written = 0
    with _writer(path, _animation(reader, frames, options.up or reader.up)) as writer:
        if options.only != "moving":
            for shape in _states(source):
                writer.add(shape)
                written += 1
        for shape in _moving(source, progress) if options.only != "background" else ():
            writer.add(shape)
            written += 1
    return written


def _writer(path: Path, animation: Animation) -> AbstractContextManager[AnimationWriter]:
    check_target(path)
    extension = path.suffix.lower()
    if extension == ".glb":
        return animated_glb(path, animation)
    if extension in EXTENSIONS:
        return animated_usd(path, animation)
    raise InputError(f"{path}: {extension or 'no'} extension is not one of .glb, {', '.join(EXTENSIONS)}; choose one")


def _animation(reader: ReelReader, frames: range, up: Up) -> Animation:
    """Time begins with the first of the frames."""
    header = reader.header
    if header.intervals:
        chosen = header.intervals[frames.start : frames.stop - 1]
        times = np.array(list(accumulate(chosen, initial=0)), np.float64) / 1e6
    else:
        times = np.arange(len(frames)) / header.frame_rate
    corners = np.asarray(header.origin) + header.scale * np.array([header.minimum, header.maximum], np.float64)
    is_far = np.abs(corners).max() > _FAR * np.linalg.norm(corners[1] - corners[0])
    x, y, z = corners.mean(axis=0).tolist() if is_far else (0.0, 0.0, 0.0)
    return Animation(times, header.frame_rate, (x, y, z), up)


def _states(source: _Source) -> Iterator[Shape]:
    """A shape for each state of the background, shown where groups name it; frames count from the first wanted."""
    reader, frames = source.reader, source.frames
    spans: dict[int, list[tuple[int, int]]] = {}
    starts = sorted({frames.start, *(group.first_frame for group in reader.groups if group.first_frame in frames)})
    for start, end in pairwise([*starts, frames.stop]):
        if (chunk := reader.static_of_frame(start)) is not None:
            own = spans.setdefault(chunk.number, [])
            first = own.pop()[0] if own and own[-1][1] == start else start
            own.append((first, end))
    for number, own in enumerate(spans.values()):
        mesh = source.background.of_frame(own[0][0])
        if mesh is not None and not mesh.is_empty:
            shown = tuple((first - frames.start, end - frames.start) for first, end in own)
            yield Shape("background", f"state_{number}", mesh.faces, shown[0][0], 1, map(_points, [mesh]), shown)


def _moving(source: _Source, progress: Progress | None) -> Iterator[Shape]:
    """The shapes of one track after the other."""
    frames = source.frames
    for number, groups in enumerate(source.reader.tracks):
        for group in groups:
            own = range(max(group.first_frame, frames.start), min(group.first_frame + group.frame_count, frames.stop))
            if own:
                yield from _group_shapes(source, group, own)
                if progress is not None:
                    done = number * len(frames) + own.stop - frames.start
                    progress("export", done // len(source.tracks), len(frames))


def _group_shapes(source: _Source, group: Chunk, own: range) -> Iterator[Shape]:
    """The shapes of those frames of a group that are wanted."""
    track = source.tracks[group.track]
    if group.form == Form.EMPTY:
        track[own.start]  # damage is told, however little there is
        return
    meshes = [track[frame] for frame in own]
    for a, b in _runs(meshes):
        if not meshes[a].is_empty:
            moving = [*meshes[a:b], *_ahead(source, group, meshes[:b], own[b - 1] + 1)]
            first, name = own[a] - source.frames.start, f"frames_{own[a]}_to_{own[b - 1]}"
            span = (first, first + b - a)
            part = f"track_{group.track}"
            yield Shape(part, name, meshes[a].faces, first, len(moving), map(_points, moving), (span,))


def _runs(meshes: Sequence[Mesh]) -> Iterator[tuple[int, int]]:
    """First frame and end of frames in a row that are one shape, at most so many."""
    first = 0
    for frame in range(1, len(meshes) + 1):
        if frame == len(meshes) or frame - first == MOST_TOGETHER or not _is_moved(meshes[frame - 1], meshes[frame]):
            yield first, frame
            first = frame


def _ahead(source: _Source, group: Chunk, meshes: Sequence[Mesh], frame: int) -> list[Mesh]:
    """The frame behind `meshes`, which are of a group, where the last of them moves on to it; else none.

    A group that is predicted from this one may have the same vertices. A patch may have the same faces by chance, so
    the last two frames must be known to have none.
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
    """Whether two frames of a group have the same vertices elsewhere.

    Frames that one template is decoded to share its faces in memory. Faces that are only equal do not tell: those of
    patches, or of frames coded one by one, may be equal by chance.
    """
    same_place = before.faces.ctypes.data == after.faces.ctypes.data
    return same_place and before.faces.shape == after.faces.shape and len(before.vertices) == len(after.vertices)


def _points(mesh: Mesh) -> Points:
    return Points(mesh.vertices, vertex_normals(mesh))
