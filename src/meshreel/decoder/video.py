"""Videos: the frames of a .reel file as meshes, decoded from the bytes of the file and nothing else.

In: a path, a URL, bytes or a file object. Out: a Video, a sequence of meshes in metres. Imports NumPy and the compiled
core, and PyAV when a picture is asked for.
"""

from __future__ import annotations

import operator
import os
import shutil
import sys
import time
import weakref
from collections.abc import Callable, Iterator, Sequence
from functools import cached_property
from mmap import mmap
from pathlib import Path
from typing import Any, overload

import numpy as np

from ..container.reader import ReelReader
from ..container.sources import BytesSource, FileSource, Source, Stream, StreamSource, source_at, viewed
from ..errors import FormatError, InputError, path_of, without_secret
from ..format.layout import MEDIA_TYPES
from ..format.view import View
from ..geometry.splats import Bound
from ..geometry.topology import concatenate
from ..shapes import Float, Float64
from ..types import Audio, Mesh, Up
from .pictures import Decoders
from .topology import FramePart, Topology, positions, topologies
from .tracks import BACKGROUND, Background, Track, moving_of_frame

_MOST_LAYERS = 255  # beyond the first, more than any group has
LOADED = 10.0  # s in which a browser has loaded a page (guess)
INLINE = 8_000_000  # bytes, largest file in a notebook's output (guess): saved notebooks hold 4/3 of it


def open(source: str | Path | bytes | bytearray | memoryview | mmap | Stream | Source) -> Video:
    """Open the video in a .reel file: a path, a URL, bytes, an mmap, a binary file object, or a source of byte ranges.

    A URL is http(s)://, or of a store that fsspec supports, such as s3:// (extra `remote`); only chunks that are
    decoded are fetched.
    Raises InputError if it cannot be read, and FormatError if the header or the index are damaged or of a version that
    this reader does not know.
    """
    if (data := viewed(source)) is not None:
        source = BytesSource(data)
    if isinstance(source, Source | Stream):
        return Video(ReelReader(source if isinstance(source, Source) else StreamSource(source)))
    path = path_of(source)
    ranges = source_at(path)
    try:
        return Video(ReelReader(ranges), close=ranges.close, path=path)
    except FormatError as error:
        ranges.close()
        raise FormatError(f"{path}: {error}") from error


def _reopened(source: str | Path | Source, layers: int | None, colored: bool) -> Video:
    """Return a pickled video, opened again by the process that unpickles it."""
    return open(source).at(layers, colored)


class Video(Sequence[Mesh]):
    """Frames of a .reel file as a sequence of meshes, decoded on access.

    A frame is its background, if it has one, and its moving bodies, one in each track; `parts` returns them separately.
    Random access decodes one group of each track, and the groups that it is predicted from. A file stays open until
    `close`, or until the end of a `with` block. The arrays of a frame belong to the caller, who may change them; those
    of `parts` and `background` are read-only, because the video keeps them: `mesh.copy()` returns a writable copy.
    """

    def __init__(
        self,
        reader: ReelReader,
        layers: int | None = None,
        close: Callable[[], None] | None = None,
        colored: bool = True,
        path: str | Path | None = None,
    ) -> None:
        self.reader = reader
        self.path = path  # path or URL that was opened; None for bytes and objects
        self.layers = layers
        self._colored = colored
        decoders, numbers = Decoders(), range(len(reader.tracks))
        self._tracks = tuple(Track(reader, number, decoders, layers, colored) for number in numbers)
        self._background = Background(reader, decoders, colored)
        self._close = close
        self._hide: weakref.finalize[..., Video] | Callable[[], None] = lambda: None  # removes the page of `show`

    def at(self, layers: int | None = None, colors: bool = True) -> Video:
        """Return the same video decoded from at most `layers` layers of each group beyond its first; None: from all.

        Fewer bytes are read, and each frame is a coarser, valid mesh. A layer is one subdivision of a group of form
        LAYERS, or its patches, which come last; of a group of form LAPLACIAN it is one displacement component. The
        background has no layers and is always whole. Without `colors`, they are not read.
        """
        layers = None if layers is None else operator.index(layers)
        if layers is not None and layers < 0:
            raise InputError(f"layers must not be negative, got {layers}: give a number of layers, or None for all")
        most = None if layers is None else min(layers, _MOST_LAYERS)
        return Video(self.reader, most, self._close, colors, self.path)

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle the path or URL, with which another process opens the file again, or else the bytes."""
        source: str | Path | Source = self.reader.source
        if self.path is not None:
            source = Path(self.path).absolute() if isinstance(source, FileSource) else self.path
        elif isinstance(source, StreamSource):
            raise InputError("a video of a file object cannot be pickled; open it by its path, its URL or its bytes")
        return _reopened, (source, self.layers, self._colored)

    def close(self) -> None:
        """Close the file. Afterwards only frames of the last decoded groups can be read."""
        self._hide()
        if self._close is not None:
            self._close()

    def __enter__(self) -> Video:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @property
    def tracks(self) -> tuple[Track, ...]:
        """The moving bodies, each a sequence of meshes as long as the video; what is no scene is one track."""
        return self._tracks

    @property
    def frame_rate(self) -> float:
        """Frames per second, 1/s."""
        return self.reader.frame_rate

    @property
    def duration(self) -> float:
        """Time from the first frame to the end of the last one, s."""
        return self.reader.duration

    @property
    def timestamps(self) -> list[float]:
        """Time at which each frame is shown, s."""
        return [self.reader.timestamp(frame) for frame in range(len(self))]

    @property
    def metadata(self) -> dict[str, Any]:
        """Values that the encoder recorded, such as preset and quality; decoding does not need them."""
        return self.reader.metadata

    @property
    def audio(self) -> Audio | None:
        """The audio file that belongs to the frames, byte for byte; None if there is none.

        Raises FormatError if it is damaged.
        """
        record, head = self.reader.read_audio(), self.reader.header
        if record is None:
            return None
        return Audio(record.data, MEDIA_TYPES[record.type], (record.start - head.first_time) / 1e6)

    @property
    def box(self) -> tuple[Float64[np.ndarray, "3"], Float64[np.ndarray, "3"]]:
        """Lower and upper corner of the box that holds all frames, m, as the encoder stored it."""
        return self.reader.box

    @property
    def bytes_read(self) -> int:
        """Bytes read so far: of a URL, all received bytes; of a local file, those of decoded chunks."""
        return self.reader.bytes_read

    @property
    def up(self) -> Up:
        """Axis that points up: y, z, -y or -z; y if the file does not name one."""
        return self.reader.up

    @property
    def view(self) -> View | None:
        """The view that players begin with: position and target in metres, and degrees; None if the file has none."""
        return self.reader.view

    def __len__(self) -> int:
        return self.reader.frame_count

    @overload
    def __getitem__(self, index: int) -> Mesh: ...
    @overload
    def __getitem__(self, index: slice) -> list[Mesh]: ...
    def __getitem__(self, index: int | slice) -> Mesh | list[Mesh]:
        """Return frame `index` in metres: its background, then its tracks, as one mesh; for a slice, a list of frames.

        Raises IndexError out of range and FormatError if one of its chunks is damaged.
        """
        if isinstance(index, slice):
            return [self[i] for i in range(*index.indices(len(self)))]
        return _joined(list(self.parts(index).values()))

    def __iter__(self) -> Iterator[Mesh]:
        return (self[i] for i in range(len(self)))

    def parts(self, index: int) -> dict[str, Mesh]:
        """Return the meshes that make up frame `index` by name: "background", if it has one, "track 0", "track 1" ...

        A body that is not in the frame is an empty mesh. Raises as indexing does.
        """
        frame = self._frame(index)
        background = self._background.of_frame(frame)
        parts = {} if background is None else {BACKGROUND: background}
        moving = moving_of_frame(self.tracks, frame)
        return parts | {track.name: mesh for track, mesh in zip(self.tracks, moving, strict=True)}

    def background(self, index: int) -> Mesh:
        """Return the background of frame `index`: the same object while it does not change, empty if there is none."""
        mesh = self._background.of_frame(self._frame(index))
        return Mesh.empty() if mesh is None else mesh

    def moving(self, index: int) -> Mesh:
        """Return frame `index` without its background, which is not read."""
        return _joined(moving_of_frame(self.tracks, self._frame(index)))

    def splats(self, index: int) -> Bound | None:
        """Return the splats of all moving bodies of frame `index` in metres; None if there are none.

        Draw them in place of the surface of these bodies. Raises as indexing does.
        """
        frame = self._frame(index)
        bound = [splats for splats in (track.splats(frame) for track in self.tracks) if splats is not None]
        return Bound.join(bound) if bound else None

    def vertices(
        self, first: int = 0, last: int | None = None, out: np.ndarray | None = None
    ) -> Float[np.ndarray, "T V 3"]:
        """Return the positions (m) of the vertices of frames `first` to `last` - 1, by default of all frames.

        V are the vertices of the background, then those of each track; patches are left out, because they are other
        vertices in each frame. `topology` has their faces, the rows of each part, and the runs of frames in which
        they stay the same. Of a scene each of `tracks` has `vertices` and `topology` of its own, for a body may come
        or change while others stay. Positions are written to `out` if it is given, an array of float64 or float32,
        for which coordinates are rounded; otherwise to a new array of float64. Raises InputError, which names the
        frame and the part, if vertices or faces change or do not fit the array; and otherwise as indexing does.
        """
        return positions(self._parts_of, first, len(self) if last is None else last, len(self), out)

    @cached_property
    def topology(self) -> tuple[Topology, ...]:
        """Runs of frames in which no part changes its vertices or faces, in order; together they are all frames.

        The first use decodes every group once. Raises FormatError as indexing does.
        """
        return topologies(self._parts_of, len(self))

    def _parts_of(self, frame: int) -> list[FramePart]:
        background = [self._background.part(frame)] if self.reader.has_background else []
        moving_of_frame(self.tracks, frame)  # refuses groups that take too much memory together
        return background + [track.part(frame) for track in self.tracks]

    def __repr__(self) -> str:
        return f"<meshreel.Video: {', '.join(self._facts().values())}>"

    def _repr_html_(self) -> str:
        """Return for a notebook the player with the file in it, or a table if the file has more than `INLINE` bytes.

        The output needs no network; browsers of 2023 and later play it.
        """
        from .page import table

        facts = self._facts().items()
        if self.reader.size > INLINE:
            place = without_secret(str(self.path or "FILE"))
            play = f"play it with video.show(), or in a terminal: meshreel play {place}"
            note = f"{self.name} is larger than {INLINE / 1e6:g} MB: {play}"
            return table(facts, note)
        try:
            return self._frame_of_page()
        except (InputError, OSError) as error:  # the file is closed, or the player is not built
            return table(facts, str(error))

    def show(self) -> None:
        """Play the video: in a notebook below the cell; elsewhere in the browser, as a page in a temporary folder.

        The page contains the whole file and needs no server; `meshreel play` streams a large file. It is removed with
        the video, by `close` and by the next call, which wait until a browser has had `LOADED` seconds to load it.
        """
        shell = sys.modules.get("IPython") and sys.modules["IPython"].get_ipython()
        if shell is not None and hasattr(shell, "kernel"):
            from IPython.display import HTML, display

            display(HTML(self._frame_of_page()))
            return
        import tempfile
        import webbrowser

        text = self._page()
        self._hide()
        folder = tempfile.mkdtemp(prefix="meshreel-")
        self._hide = weakref.finalize(self, _remove, folder, time.monotonic() + LOADED, os.getpid())
        page = Path(folder, f"{Path(self.name).stem}.html")
        page.write_text(text, encoding="utf-8")
        if not webbrowser.open(page.as_uri()):
            self._hide.detach()
            raise InputError(f"no browser was found: open {page}")

    @property
    def name(self) -> str:
        """Name of the file, without folders; "recording" for bytes and objects."""
        return "recording" if self.path is None else Path(without_secret(str(self.path))).name

    def _frame_of_page(self) -> str:
        from .page import in_frame

        return in_frame(self._page(), [self.name, *self._facts().values()])

    def _page(self) -> str:
        from .page import player_page

        return player_page(self.reader.source.get_bytes(0, self.reader.source.size), self.name)

    def _facts(self) -> dict[str, str]:
        facts = {
            "frames": _counted(len(self), "frame"),
            "frame rate": f"{self.frame_rate:g} frames/s",
            "duration": f"{self.duration:.3g} s",
            "size": _counted(self.reader.size, "byte"),
            "tracks": _counted(len(self.tracks), "track"),
            "background": "with background" if self.reader.has_background else "no background",
        }
        facts |= {"color": "in colour"} if self.reader.is_colored and self._colored else {}
        return facts if self.layers is None else facts | {"layers": f"at most {_counted(self.layers, 'layer')}"}

    def _frame(self, index: int) -> int:
        frame = index + len(self) if index < 0 else index
        if not 0 <= frame < len(self):
            raise IndexError(f"frame {index} of a video of {len(self)} frames")
        return frame


def _remove(folder: str, when: float, process: int) -> None:
    """Remove a folder of a process, not before a time of the monotonic clock."""
    if os.getpid() != process:  # a fork of it
        return
    try:
        time.sleep(max(when - time.monotonic(), 0))
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def _counted(count: int, what: str) -> str:
    return f"{count} {what}" if count == 1 else f"{count} {what}s"


def _joined(meshes: list[Mesh]) -> Mesh:
    """Return all meshes as one, in new arrays."""
    mesh = concatenate(meshes)
    return mesh.copy() if any(mesh is part for part in meshes) else mesh
