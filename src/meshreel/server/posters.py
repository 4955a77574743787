"""Posters: a PNG of the normals of the first frame with a surface. In: the path of a file. Out: cached bytes."""

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

WIDTH, HEIGHT = 480, 360  # pixels (guess)
FIELD = 30.0  # degrees, vertical (guess)
MOST_POSTERS = 256  # in memory (guess)
LOOKED_AT = 30  # frames that are searched for a surface (guess)


def poster_tag(path: Path) -> str | None:
    """Return the ETag of a poster, which changes with the file and the version of meshreel; None without a file."""
    try:
        found = path.stat()
    except OSError:
        return None
    return f'"{found.st_mtime_ns:x}-{found.st_size:x}-{__version__}"'


class Posters:
    """Cache of posters, one for each version of a file. Threads may share it; two may draw the same poster."""

    def __init__(self) -> None:
        self._known: OrderedDict[tuple[Path, str], bytes | None] = OrderedDict()
        self._lock = threading.Lock()

    def of(self, path: Path, tag: str) -> bytes | None:
        """Return a PNG, None for damaged and empty files and without the renderer (extra `encode`)."""
        version = (path, tag)
        with self._lock:
            if version in self._known:
                self._known.move_to_end(version)
                return self._known[version]
        picture = _poster(path)
        with self._lock:
            self._known[version] = picture
            while len(self._known) > MOST_POSTERS:
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
    """Return the first frame with a surface, None if the first LOOKED_AT have none."""
    frames = (video[index] for index in range(min(len(video), LOOKED_AT)))
    return next((mesh for mesh in frames if not mesh.is_empty), None)


def _picture(mesh: Mesh, up: str) -> bytes:
    """Return an upright PNG with a transparent background, from the front unless another side shows twice as much."""
    from PIL import Image

    from ..geometry.raycast import Rays
    from ..metrics.render import Crop, look
    from ..metrics.viewpoints import Box, ViewOptions, views_around

    box, rays = Box.of([mesh]), Rays(mesh)
    shown = []  # in each of the four views, pixels with the fronts of faces less those with backs: walls from outside
    for camera in views_around(box, ViewOptions(WIDTH // 4, HEIGHT // 4, FIELD, up=up)):
        seen = rays.look(camera)
        shown.append(int((seen.faces >= 0).sum()) - 2 * int(rays.backs(camera, seen).sum()))
    best = int(np.argmax(shown)) if max(shown) > 2 * shown[0] else 0
    view = look(mesh, views_around(box, ViewOptions(WIDTH, HEIGHT, FIELD, up=up))[best], Crop(0, HEIGHT, 0, WIDTH))
    picture = np.dstack([view.colors, view.covered])
    out = io.BytesIO()
    Image.fromarray((255 * picture).round().astype(np.uint8)).save(out, "PNG")
    return out.getvalue()
