"""Opens .reel files: a Video gives meshes by frame number, from nothing but the bytes.

Reads beside encoder.py. Imports NumPy, DracoPy and the compiled core only: no Open3D, SciPy or torch.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import overload

import numpy as np

from .coding.group import continue_group
from .coding.layers import LayersState, needs_previous
from .container.reader import Chunk, ReelReader
from .container.sources import BytesSource, FileSource, Source
from .errors import FormatError, InputError
from .types import Mesh


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


class Video(Sequence[Mesh]):
    """Frames of a .reel file as a sequence of meshes; random access decodes one group and keeps it.

    A file stays open until `close`, or until the end of a `with` block.
    """

    def __init__(
        self, reader: ReelReader, components: int | None = None, close: Callable[[], None] | None = None
    ) -> None:
        self.reader = reader
        self.components = components
        self._close = close
        self._group: tuple[int, list[Mesh]] = (-1, [])
        self._state: tuple[int, LayersState | None] = (-1, None)

    def at(self, components: int | None) -> Video:
        """The same video with at most this many displacement components a group: fewer bytes, still valid."""
        if components is not None and components < 0:
            raise InputError(f"components must not be negative, got {components}")
        return Video(self.reader, components, self._close)

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
        number, frames = self._group  # together: another thread may put its own group there
        if number != chunk.number:
            frames = [self._place(mesh) for mesh in self._decode(chunk)]
            self._group = (chunk.number, frames)
        return frames

    def _decode(self, chunk: Chunk) -> list[Mesh]:
        """The frames of a group, normalised; first those before it that it is predicted from, as far as needed."""
        number, state = self._state
        layers = None if self.components is None else self.components + 1
        place = self.reader.groups.index(chunk)
        waiting = [(chunk, self.reader.read_chunk(chunk.number, layers))]
        while place > 0 and needs_previous(waiting[-1][1]):
            place -= 1
            before = self.reader.groups[place]
            if before.number == number:
                break
            waiting.append((before, self.reader.read_chunk(before.number, layers)))
        for group, payload in reversed(waiting):
            try:
                meshes, state = continue_group(payload, group.frame_count, self.components, state)
            except FormatError as error:
                raise FormatError(f"{group}: {error}") from error
        self._state = (chunk.number, state)
        return meshes

    def _place(self, mesh: Mesh) -> Mesh:
        """A mesh in metres: the header's origin and scale undo the encoder's normalisation."""
        header = self.reader.header
        return replace(mesh, vertices=np.asarray(header.origin) + header.scale * mesh.vertices)
