"""Posters: the first frame of a file that has a surface, as a PNG of its normals. In: a path. Out: bytes, kept."""

from __future__ import annotations

import io
import threading
from collections import OrderedDict
from pathlib import Path

import numpy as np

from .. import __version__
from ..decoder.video import Video
from ..decoder.video import open as open_video
from ..errors import MeshreelError
from ..types import Mesh

WIDTH, HEIGHT = 480, 360  # pixels
FIELD = 30.0  # degrees, vertical
MOST_KEPT = 256
LOOKED_AT = 30  # frames, for one with a surface


def poster_tag(path: Path) -> str | None:
    """The ETag of a file's poster: another one when the file changes, or what draws. None where no file is there."""
    try:
        found = path.stat()
    except OSError:
        return None
    return f'"{found.st_mtime_ns:x}-{found.st_size:x}-{__version__}"'


class Posters:
    """Kept until the file changes. Threads may share it; it does not keep two from drawing the same."""

    def __init__(self) -> None:
        self._known: OrderedDict[tuple[Path, str], bytes | None] = OrderedDict()
        self._lock = threading.Lock()

    def of(self, path: Path, tag: str) -> bytes | None:
        """The PNG; None where nothing can be shown: a damaged or empty file, or no renderer (the extra `encode`)."""
        version = (path, tag)
        with self._lock:
            if version in self._known:
                self._known.move_to_end(version)
                return self._known[version]
        picture = _poster(path)
        with self._lock:
            self._known[version] = picture
            while len(self._known) > MOST_KEPT:
                self._known.popitem(last=False)
        return picture


def _poster(path: Path) -> bytes | None:
    try:
        with open_video(path) as video:
            mesh = _first(video)
            return None if mesh is None else _picture(mesh, video.reader.up)
    except (MeshreelError, OSError, ModuleNotFoundError):
        return None


def _first(video: Video) -> Mesh | None:
    """The first of some frames that has a surface."""
    frames = (video[index] for index in range(min(len(video), LOOKED_AT)))
    return next((mesh for mesh in frames if not mesh.is_empty), None)


def _picture(mesh: Mesh, up: str) -> bytes:
    """A PNG, upright, clear where nothing is; from the front, where no other side shows clearly more than it."""
    from PIL import Image

    from ..geometry.raycast import Rays
    from ..metrics.render import Window, look
    from ..metrics.viewpoints import Box, ViewOptions, views_around

    box, rays = Box.of([mesh]), Rays(mesh)
    shown = []  # in each of the four views, pixels with the fronts of faces less those with backs: walls from outside
    for camera in views_around(box, ViewOptions(WIDTH // 4, HEIGHT // 4, FIELD, up=up)):
        seen = rays.look(camera)
        shown.append(int((seen.faces >= 0).sum()) - 2 * int(rays.backs(camera, seen).sum()))
    best = int(np.argmax(shown)) if max(shown) > 2 * shown[0] else 0
    view = look(mesh, views_around(box, ViewOptions(WIDTH, HEIGHT, FIELD, up=up))[best], Window(0, HEIGHT, 0, WIDTH))
    picture = np.dstack([view.colors, view.covered])
    out = io.BytesIO()
    Image.fromarray((255 * picture).round().astype(np.uint8)).save(out, "PNG")
    return out.getvalue()
