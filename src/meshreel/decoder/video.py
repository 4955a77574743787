"""Opens .reel files: a Video gives meshes by frame number, from nothing but the bytes.

Reads beside encoder.py. Imports NumPy, DracoPy and the compiled core only: no Open3D, SciPy or torch.
"""

from __future__ import annotations

import operator
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import overload

from ..container.reader import ReelReader
from ..container.sources import BytesSource, FileSource, Source
from ..errors import FormatError, InputError
from ..geometry.topology import concatenate
from ..types import Mesh
from .tracks import Background, Track, moving_of_frame

BACKGROUND = "background"  # its name among the parts of a frame


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
    """Frames of a .reel file as a sequence of meshes; random access decodes one group a track, and those it depends on.

    A frame is its background, where it has one, and its moving bodies, one a track; `parts` has them apart. A file
    stays open until `close`, or until the end of a `with` block. The arrays of its meshes are read-only, and those of a
    group may be parts of one array: copy a frame to change it, or to keep it without the others.
    """

    def __init__(self, reader: ReelReader, quality: int | None = None, close: Callable[[], None] | None = None) -> None:
        self.reader = reader
        self.quality = quality
        self.tracks = tuple(Track(reader, number, quality) for number in range(len(reader.tracks)))
        self._background = Background(reader)
        self._close = close

    def at(self, quality: int | None) -> Video:
        """The same video from at most this many layers of a group beyond the first: fewer bytes, still valid.

        A layer is one subdivision of a group of form LAYERS, whose mesh is coarser without it, or its patches, which
        come last; and one displacement component of a group of form LAPLACIAN. None: all of them. The background is
        always whole.
        """
        quality = None if quality is None else operator.index(quality)
        if quality is not None and quality < 0:
            raise InputError(f"quality must not be negative, got {quality}: give a number of layers, or None for all")
        return Video(self.reader, quality, self._close)

    def close(self) -> None:
        """Closes the file; frames of other groups than the last ones decoded can no longer be read."""
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
        """Frame `index` in metres: its background, then its tracks, as one mesh.

        Raises IndexError out of range and FormatError where one of its chunks is damaged.
        """
        if isinstance(index, slice):
            return [self[i] for i in range(*index.indices(len(self)))]
        return _joined(list(self.parts(index).values()))

    def __iter__(self) -> Iterator[Mesh]:
        return (self[i] for i in range(len(self)))

    def parts(self, index: int) -> dict[str, Mesh]:
        """The meshes that frame `index` is made of, as they are kept: "background" where it has one, "track 0" ...

        A body that is not there is an empty mesh. Raises as the frame itself does.
        """
        frame = self._frame(index)
        background = self._background.of_frame(frame)
        parts = {} if background is None else {BACKGROUND: background}
        moving = moving_of_frame(self.tracks, frame)
        return parts | {f"track {number}": mesh for number, mesh in enumerate(moving)}

    def background(self, index: int) -> Mesh:
        """What does not move in frame `index`, the same mesh while nothing changes; empty where the frame has none."""
        mesh = self._background.of_frame(self._frame(index))
        return Mesh.empty() if mesh is None else mesh

    def moving(self, index: int) -> Mesh:
        """Frame `index` without its background, which is not read."""
        return _joined(moving_of_frame(self.tracks, self._frame(index)))

    def _frame(self, index: int) -> int:
        frame = index + len(self) if index < 0 else index
        if not 0 <= frame < len(self):
            raise IndexError(f"frame {index} of a video of {len(self)} frames")
        return frame


def _joined(meshes: list[Mesh]) -> Mesh:
    """All meshes as one, not to be written to, as they are not."""
    mesh = concatenate(meshes)
    mesh.vertices.flags.writeable = mesh.faces.flags.writeable = False
    return mesh
