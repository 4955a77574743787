"""Opens .reel files: a Video gives meshes by frame number, from nothing but the bytes.

Reads beside encoder.py. Imports NumPy, DracoPy and the compiled core only: no Open3D, SciPy or torch.
"""

from __future__ import annotations

import operator
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import overload

from .coding.group import continue_group
from .coding.layers import LayersState
from .container.reader import Chunk, ReelReader
from .container.sources import BytesSource, FileSource, Source
from .errors import FormatError, InputError
from .format.layout import ChunkKind
from .types import Mesh, Placement

MOST_KEPT = 1 << 29  # bytes of states: a few bytes may say groups that take as much as a file may claim, each


def open(source: str | Path | bytes | Source) -> Video:
    """The video in a .reel file, in bytes, or behind any source of byte ranges.

    Raises FormatError where the header or the index are damaged, or of a version this reader does not know.
    """
    if isinstance(source, (str, Path)):
        file = FileSource(source)
        try:
            return Video(ReelReader(file), close=file.close)
        except FormatError as error:
            file.close()
            raise FormatError(f"{source}: {error}") from error
    return Video(ReelReader(BytesSource(source) if isinstance(source, bytes) else source))


@dataclass(frozen=True, slots=True)
class _Decoded:
    """The last group decoded: its chunk, its frames, and what a group that is predicted from it needs."""

    number: int
    frames: list[Mesh]
    state: LayersState | None


@dataclass(frozen=True, slots=True)
class _States:
    """Of the groups of one chain: playing backwards asks for each."""

    known: dict[int, LayersState | None]
    size: int = 0  # bytes

    def of(self, number: int | None) -> LayersState | None:
        """That of a group, None where there is none."""
        return None if number is None else self.known.get(number)

    def add(self, number: int, state: LayersState | None, before: LayersState | None) -> _States:
        """With that of a group in `known`; without those of other groups where they would be too much."""
        if number in self.known:
            return self
        size = 0 if state is None else state.nbytes_beyond(before)
        if self.size + size > MOST_KEPT:
            return _States({number: state}, 0 if state is None else state.nbytes_beyond(None))
        self.known[number] = state
        return _States(self.known, self.size + size)


class Video(Sequence[Mesh]):
    """Frames of a .reel file as a sequence of meshes; random access decodes one group, and those it depends on.

    A file stays open until `close`, or until the end of a `with` block. The arrays of its meshes are read-only, and
    those of a group may be parts of one array: copy a frame to change it, or to keep it without the others.
    """

    def __init__(self, reader: ReelReader, quality: int | None = None, close: Callable[[], None] | None = None) -> None:
        self.reader = reader
        self.quality = quality
        self._close = close
        self._place = Placement(reader.header.scale, reader.header.origin)  # undoes the encoder's normalisation
        self._group = _Decoded(-1, [], None)
        self._states = _States({})

    def at(self, quality: int | None) -> Video:
        """The same video from at most this many layers of a group beyond the first: fewer bytes, still valid.

        A layer is one subdivision of a group of form LAYERS, whose mesh is coarser without it, or its patches, which
        come last; and one displacement component of a group of form LAPLACIAN. None: all of them.
        """
        quality = None if quality is None else operator.index(quality)
        if quality is not None and quality < 0:
            raise InputError(f"quality must not be negative, got {quality}: give a number of layers, or None for all")
        return Video(self.reader, quality, self._close)

    def close(self) -> None:
        """Closes the file; frames of other groups than the last one decoded can no longer be read."""
        if self._close is not None:
            self._close()

    def __enter__(self) -> Video:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @property
    def frame_rate(self) -> float:
        """Frames per second, 1/s."""
        return self.reader.frame_rate

    @property
    def timestamps(self) -> list[float]:
        """When each frame is shown, s from the start."""
        return [self.reader.timestamp(frame) for frame in range(len(self))]

    def __len__(self) -> int:
        return self.reader.frame_count

    @overload
    def __getitem__(self, index: int) -> Mesh: ...
    @overload
    def __getitem__(self, index: slice) -> list[Mesh]: ...
    def __getitem__(self, index: int | slice) -> Mesh | list[Mesh]:
        """Frame `index` in metres. Raises IndexError out of range and FormatError where its group is damaged."""
        if isinstance(index, slice):
            return [self[i] for i in range(*index.indices(len(self)))]
        frame = index + len(self) if index < 0 else index
        if not 0 <= frame < len(self):
            raise IndexError(f"frame {index} of a video of {len(self)} frames")
        chunk = self.reader.chunk_of_frame(frame)
        return self._frames(chunk)[frame - chunk.first_frame]

    def __iter__(self) -> Iterator[Mesh]:
        return (self[i] for i in range(len(self)))

    def _frames(self, chunk: Chunk) -> list[Mesh]:
        """The decoded frames of a group, from the last call where it is the same group."""
        known = self._group  # one value: another thread may put its own group there
        if known.number == chunk.number:
            return known.frames
        chain = [chunk]
        states = self._states
        while (before := self._group_before(chain[-1])) is not None and before not in states.known:
            chain.append(self.reader.chunks[before])
        state = states.of(before)
        states = _States({}) if before is None else _States(dict(states.known), states.size)
        for link in reversed(chain):
            meshes, after = self._decode(link, state)
            states = states.add(link.number, after, state)
            state = after
        self._states = states  # replaced, not changed: other threads may read it
        known = _Decoded(chunk.number, meshes, state)
        self._group = known
        return known.frames

    def _group_before(self, chunk: Chunk) -> int | None:
        """The number of the group that a chunk is predicted from."""
        chunks = self.reader.chunks
        return next((n for n in chunk.depends_on if chunks[n].kind == ChunkKind.GROUP), None)

    def _decode(self, chunk: Chunk, before: LayersState | None) -> tuple[list[Mesh], LayersState | None]:
        payload = self.reader.read_chunk(chunk.number, None if self.quality is None else self.quality + 1)
        try:
            meshes, state = continue_group(payload, chunk.frame_count, self.quality, before, self._place)
        except FormatError as error:
            raise FormatError(f"{chunk}: {error}") from error
        return [_read_only(mesh) for mesh in meshes], state


def _read_only(mesh: Mesh) -> Mesh:
    """The mesh, not to be written to: it is kept and given again, and shares its faces with other frames and groups."""
    vertices, faces = mesh.vertices.view(), mesh.faces.view()
    vertices.flags.writeable = faces.flags.writeable = False
    return Mesh(vertices, faces)
