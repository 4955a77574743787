"""Opens .reel files: a Video gives meshes by frame number, from nothing but the bytes.

Reads beside encoder.py. Imports NumPy, DracoPy and the compiled core only: no Open3D, SciPy or torch.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import overload

import numpy as np

from .coding.group import decode_group
from .container.reader import Chunk, ReelReader
from .container.sources import BytesSource, FileSource, Source
from .errors import FormatError
from .types import Mesh


def open(source: str | Path | bytes | Source) -> Video:
    """The video in a .reel file, in bytes, or behind any source of byte ranges.

    Raises FormatError where the header or the index are damaged, or of a version this reader does not know.
    """
    if isinstance(source, (str, Path)):
        return Video(ReelReader(FileSource(source)))
    return Video(ReelReader(BytesSource(source) if isinstance(source, bytes) else source))


class Video(Sequence[Mesh]):
    """Frames of a .reel file as a sequence of meshes; random access decodes one group and keeps it."""

    def __init__(self, reader: ReelReader, components: int | None = None) -> None:
        self.reader = reader
        self.components = components
        self._group: tuple[int, list[Mesh]] = (-1, [])

    def at(self, components: int | None) -> Video:
        """The same video with at most this many displacement components a group: fewer bytes, still valid."""
        if components is not None and components < 0:
            raise ValueError(f"components must not be negative, got {components}")
        return Video(self.reader, components)

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
        number, frames = self._group  # read once: threads may share a video
        if number != chunk.number:
            layers = None if self.components is None else self.components + 1
            payload = self.reader.read_chunk(chunk.number, layers)
            try:
                meshes = decode_group(payload, chunk.frame_count, self.components)
            except FormatError as error:
                raise FormatError(f"{chunk}: {error}") from error
            frames = [self._place(mesh) for mesh in meshes]
            self._group = (chunk.number, frames)
        return frames

    def _place(self, mesh: Mesh) -> Mesh:
        """A mesh in metres: the header's origin and scale undo the encoder's normalisation."""
        header = self.reader.header
        return replace(mesh, vertices=np.asarray(header.origin) + header.scale * mesh.vertices)
