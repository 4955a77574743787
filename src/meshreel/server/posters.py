"""Posters: the first frame of a file that has a surface, as a PNG of its normals. In: a path. Out: bytes, kept."""

from __future__ import annotations

import io
import threading
from collections import OrderedDict
from pathlib import Path

from ..decoder import open as open_video
from ..errors import MeshreelError
from ..types import Mesh

WIDTH, HEIGHT = 480, 360  # pixels
MOST_KEPT = 256
LOOKED_AT = 30  # frames, for one with a surface

Version = tuple[Path, int, int]  # path, time of the last change, size


class Posters:
    """Rendered one at a time, and kept until the file changes."""

    def __init__(self) -> None:
        self._known: OrderedDict[Version, bytes | None] = OrderedDict()
        self._lock = threading.Lock()

    def of(self, path: Path) -> bytes | None:
        """The PNG; None where nothing can be shown: a damaged or empty file, or no renderer (the extra `encode`)."""
        try:
            found = path.stat()
        except OSError:
            return None
        version = (path, found.st_mtime_ns, found.st_size)
        with self._lock:
            if version not in self._known:
                self._known[version] = _poster(path)
            self._known.move_to_end(version)
            while len(self._known) > MOST_KEPT:
                self._known.popitem(last=False)
            return self._known[version]


def _poster(path: Path) -> bytes | None:
    try:
        from PIL import Image

        from ..metrics.cameras import Box, ViewOptions, views_around
        from ..metrics.render import render_normals

        mesh = _first(path)
        if mesh is None:
            return None
        camera = views_around(Box.of([mesh]), ViewOptions(WIDTH, HEIGHT))[0]
        picture = (255 * render_normals(mesh, camera)).round().astype("uint8")
        out = io.BytesIO()
        Image.fromarray(picture).save(out, "PNG")
        return out.getvalue()
    except (MeshreelError, OSError, ModuleNotFoundError):
        return None


def _first(path: Path) -> Mesh | None:
    """The first of some frames that has a surface."""
    with open_video(path) as video:
        for index in range(min(len(video), LOOKED_AT)):
            mesh = video[index]
            if not mesh.is_empty:
                return mesh
    return None
