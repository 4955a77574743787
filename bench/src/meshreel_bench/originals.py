"""Pictures of originals, kept in a folder: all points of an experiment compare with the same ones, in many processes.

In: a mesh, pixels -> what `metrics.render.Visible` sees there, bit by bit. A file is known by all that its picture
follows from: the mesh, the camera, and, as its folder, the code, the libraries and the processor that render it.
"""

from __future__ import annotations

import hashlib
import shutil
import zipfile
import zlib
from contextlib import suppress
from dataclasses import dataclass, fields, is_dataclass
from functools import cache, cached_property
from pathlib import Path

import numpy as np
from jaxtyping import Bool, Float32

from meshreel import geometry, metrics, types
from meshreel.errors import InputError
from meshreel.io.write import make_folder, replacing
from meshreel.metrics.render import BACKGROUND, Picture, Pixels, Visible, Window, window_of
from meshreel.types import Mesh

from .provenance import cpu, sources

KEPT_PICTURES = "originals"  # the folder, below that where sequences are kept
MOST = 2_000_000_000  # bytes of the folder: no more are kept then
_DAMAGED = (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile, zlib.error)


@dataclass(frozen=True, slots=True)
class KeptPictures:
    """What originals look like, by way of a folder; any number of processes may share it."""

    folder: Path

    def __call__(self, mesh: Mesh) -> Original:
        """A mesh that is looked at."""
        return Original(mesh, self.folder / _renderer())


class Original:
    """A mesh whose pictures are read where they are kept, and are kept where they are not."""

    def __init__(self, mesh: Mesh, folder: Path) -> None:
        self._mesh, self._folder = mesh, folder
        self._digest = _digest(mesh.vertices, mesh.faces)

    def look(self, pixels: Pixels) -> Picture:
        """What a camera sees of it in a window."""
        camera = pixels.camera
        assert is_dataclass(camera)
        told = [getattr(camera, field.name) for field in fields(camera)]
        path = self._folder / f"{_digest(self._digest, type(camera).__name__, *told)}.npz"
        found = _read(path)
        if found is None:
            window = window_of([self._mesh], camera)  # its own: that of a pair is another for each decoded mesh
            view = self._visible.look(Pixels(camera, window))
            found = Kept(window, view.covered, view.colors)
            _write(path, found)
        return found.within(pixels.window)

    @cached_property
    def _visible(self) -> Visible:
        return Visible(self._mesh)


@dataclass(frozen=True, slots=True)
class Kept:
    """A picture; outside of its window nothing is seen."""

    window: Window
    covered: Bool[np.ndarray, "H W"]
    colors: Float32[np.ndarray, "H W 3"]

    def within(self, window: Window) -> Kept:
        """The same in another window."""
        if window == self.window:
            return self
        covered, colors = np.zeros(window.shape, bool), np.full((*window.shape, 3), BACKGROUND, np.float32)
        here, there = _common(self.window, window), _common(window, self.window)
        covered[there], colors[there] = self.covered[here], self.colors[here]
        return Kept(window, covered, colors)


def _common(window: Window, other: Window) -> tuple[slice, slice]:
    """The rows and columns of a window that another has, too."""
    rows = range(max(window.top, other.top), min(window.bottom, other.bottom))
    columns = range(max(window.left, other.left), min(window.right, other.right))
    return (
        slice(rows.start - window.top, max(rows.start, rows.stop) - window.top),
        slice(columns.start - window.left, max(columns.start, columns.stop) - window.left),
    )


def _read(path: Path) -> Kept | None:
    """A picture; None where it is not kept, or the file is damaged."""
    try:
        with np.load(path, allow_pickle=False) as file:
            window = Window(*map(int, file["window"]))
            height, width = window.shape
            covered = np.unpackbits(file["covered"], count=height * width).astype(bool).reshape(height, width)
            colors = np.full((height, width, 3), BACKGROUND, np.float32)
            colors[covered] = file["colors"]
    except _DAMAGED:
        return None
    return Kept(window, covered, colors)


def _write(path: Path, kept: Kept) -> None:
    """Keeps a picture where there is room for it: whole or not at all, as others may read it already."""
    window = kept.window
    numbers = np.array([window.top, window.bottom, window.left, window.right])
    with suppress(InputError, OSError):  # nothing depends on it, and others write and remove, too
        if _has_room(path.parent):
            make_folder(path.parent)
            with replacing(path) as file:
                np.savez(file, window=numbers, covered=np.packbits(kept.covered), colors=kept.colors[kept.covered])


def _has_room(folder: Path) -> bool:
    """Whether one more may be kept; where there are too many, those of other renderers are removed."""
    if _size(folder.parent) < MOST:
        return True
    for other in folder.parent.iterdir():
        if other != folder:
            shutil.rmtree(other, ignore_errors=True)
    return _size(folder) < MOST


def _size(folder: Path) -> int:
    return sum(path.stat().st_size for path in folder.rglob("*"))


@cache
def _renderer() -> str:
    """A name for what renders: other code, libraries or processors may give other bits."""
    import open3d as o3d

    files = [*sources(geometry), *sources(metrics), Path(types.__file__)]
    found = [f"{library.__name__} {library.__version__}" for library in (np, o3d)]
    return _digest(*(path.read_bytes() for path in files), *found, str(cpu()))[:16]


def _digest(*parts: str | bytes | float | np.ndarray) -> str:
    """Of all parts in their order."""
    found = hashlib.sha256()
    for part in parts:
        data = part if isinstance(part, bytes) else np.asarray(part).tobytes()
        found.update(len(data).to_bytes(8, "little"))
        found.update(data)
    return found.hexdigest()[:32]
