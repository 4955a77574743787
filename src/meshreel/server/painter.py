"""Program that draws posters, the first frame with a surface in the player's light. In: paths, as JSON. Out: PNGs.

It runs as a process of its own, so that a hostile file costs no more than limits of memory and time. It ends with the
server: when its input ends; if a library never returns, Linux kills it at once, and other POSIX systems by an alarm.
"""

from __future__ import annotations

import io
import json
import os
import signal
import struct
import sys
from contextlib import suppress
from pathlib import Path
from queue import SimpleQueue
from threading import Thread

import numpy as np
from jaxtyping import Float64

from ..decoder.video import open as open_video
from ..encoder.run.worker import die_with_parent
from ..errors import MeshreelError
from ..types import Mesh

WIDTH, HEIGHT = 480, 360  # pixels (guess)
FIELD = 30.0  # degrees, vertical (guess)
LOOKED_AT = 30  # frames that are searched for a surface (guess)
MEMORY = 2**31  # bytes (guess); drawing 1.6 M faces takes 0.8e9 (measured)
PATIENCE = 10  # s for a poster (guess); drawing 1.6 M faces takes 3 (measured)
NICE = 5  # what plays comes before posters (guess)
CLAY = np.array([0xDC, 0xD8, 0xD0]) / 255  # of what has no colours, as in the player's colors.ts
SIZE = struct.Struct("<I")  # bytes of the picture that follows; 0 for none


def main() -> None:
    """Draw a poster for each line, until input ends. An empty answer at the start says that all is ready."""
    out = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # libraries that print must not disturb the answers
    die_with_parent()
    if hasattr(os, "nice"):
        os.nice(NICE)
    with suppress(ModuleNotFoundError):  # without what draws there are no posters
        from ..metrics import render  # noqa: F401  (before the limits: it takes a second and is no fault of a file)
    _limit_memory()
    paths: SimpleQueue[str] = SimpleQueue()
    Thread(target=_read, args=(paths,), daemon=True).start()
    _answer(out, b"")
    while True:
        path = paths.get()
        _set_alarm(PATIENCE + 1)  # the server is earlier, if it lives
        picture = poster(Path(path))
        _set_alarm(0)
        _answer(out, picture or b"")


def _read(paths: SimpleQueue[str]) -> None:
    for line in sys.stdin.buffer:
        paths.put(json.loads(line))
    os._exit(0)  # the server has ended


def _answer(out: io.BufferedWriter, picture: bytes) -> None:
    out.write(SIZE.pack(len(picture)) + picture)
    out.flush()


def _limit_memory() -> None:
    with suppress(ModuleNotFoundError, OSError, ValueError):  # Windows has no such limit, macOS does not keep to it
        import resource

        resource.setrlimit(resource.RLIMIT_DATA, (MEMORY, MEMORY))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


def _set_alarm(seconds: float) -> None:
    if hasattr(signal, "setitimer"):
        signal.signal(signal.SIGALRM, signal.SIG_DFL)
        signal.setitimer(signal.ITIMER_REAL, seconds)


def poster(path: Path) -> bytes | None:
    """Return a PNG, None for damaged and empty files and without what draws it (extra `encode`)."""
    try:
        with open_video(path) as video:
            frames = (video[index] for index in range(min(len(video), LOOKED_AT)))
            mesh = next((mesh for mesh in frames if not mesh.is_empty), None)
            return None if mesh is None else picture(mesh, video.reader.up)
    except (MeshreelError, OSError, ModuleNotFoundError):
        return None


def picture(mesh: Mesh, up: str) -> bytes:
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
    camera = views_around(box, ViewOptions(WIDTH, HEIGHT, FIELD, up=up))[best]
    view = look(mesh, camera, Crop(0, HEIGHT, 0, WIDTH))
    colors = np.ones((HEIGHT, WIDTH, 3))
    if mesh.colors is None:
        axis = ("z" in up) + 1
        sign = -1.0 if up.startswith("-") else 1.0
        ends = sorted((sign * box.low[axis], sign * box.high[axis]))
        height = (sign * view.points[:, axis] - ends[0]) / max(ends[1] - ends[0], 1e-9)
        colors[view.covered] = CLAY * lit(view.normals, camera.eye - view.points, sign * np.eye(3)[axis], height)
    else:
        faces = rays.look(camera).faces
        colors[faces >= 0] = mesh.colors[mesh.faces[faces[faces >= 0]]].mean(axis=1) / 255
    pixels = np.dstack([colors, view.covered])
    out = io.BytesIO()
    Image.fromarray((255 * pixels).clip(0, 255).round().astype(np.uint8)).save(out, "PNG")
    return out.getvalue()


def lit(
    normals: Float64[np.ndarray, "N 3"], to_eye: Float64[np.ndarray, "N 3"], up: np.ndarray, height: np.ndarray
) -> Float64[np.ndarray, "N 3"]:
    """Return what share of its colour a matte surface shows: the sums of `shaded` in the player's shaders.ts.

    `to_eye` is of any length, `up` a unit vector, and `height` (N) 0 on the floor and 1 at the top.
    """
    eye = to_eye / np.linalg.norm(to_eye, axis=1, keepdims=True)
    n = np.where((normals * eye).sum(axis=1, keepdims=True) < 0, -normals, normals)
    aside = np.cross(up, eye) + 1e-6
    lamp = eye + 0.7 * up + 0.5 * aside / np.linalg.norm(aside, axis=1, keepdims=True)
    key = ((n * lamp).sum(axis=1) / np.linalg.norm(lamp, axis=1) + 0.3).clip(0) / 1.3
    sky = (0.5 + 0.5 * n @ up)[:, None]
    hidden = (1 - sky) * np.exp(-7 * height.clip(0))[:, None]
    ambient = (1 - sky) * np.array([0.27, 0.255, 0.245]) + sky * np.array([0.43, 0.44, 0.46])
    return ambient * (1 - 0.6 * hidden) + 0.68 * key[:, None] ** 1.3 * np.array([1.0, 0.985, 0.96])


if __name__ == "__main__":
    main()
