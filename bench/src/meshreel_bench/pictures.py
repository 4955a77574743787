"""Pictures of what was decoded, for the sheets of a report: normals, and distances of the original as a heat map.

In: meshes of one frame, a camera. Out: PNGs in the folder beside the rows.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from jaxtyping import Float32
from matplotlib import colormaps
from PIL import Image

from meshreel.geometry.cameras import PinholeCamera
from meshreel.io.write import make_folder, replacing
from meshreel.metrics.error_sheet import error_at_pixels
from meshreel.metrics.render import BACKGROUND, look, render_normals, window_of
from meshreel.metrics.viewpoints import Box, Camera, parallel_views_around
from meshreel.types import Mesh

from .rows import Row

VIEW = 900  # pixels, width and height of the view of what no camera has seen
SMALLEST = 900  # pixels across: pictures of small cameras are enlarged by a whole factor
LIMIT_PERCENT = 0.5  # of the diagonal, where the heat map's colors end
COLORS = "viridis"


def draw_original(path: Path, mesh: Mesh, cameras: Sequence[PinholeCamera]) -> Camera:
    """Writes the original's normals where they are not there yet; the camera that all pictures of it are seen from."""
    camera = _enlarged(cameras[0]) if cameras else parallel_views_around(Box.of([mesh]), VIEW)[0]
    if not path.exists():
        make_folder(path.parent)
        _write(path, render_normals(mesh, camera))
    return camera


def draw_decoded(folder: Path, name: str, meshes: tuple[Mesh, Mesh], camera: Camera) -> Row:
    """Writes two pictures of a decoded mesh, the second after the original; their names, and the heat map's end."""
    original, decoded = meshes
    make_folder(folder)
    found: Row = {"normals": f"{name}-normals.png", "errors": f"{name}-errors.png", "limit_percent": LIMIT_PERCENT}
    _write(folder / found["normals"], render_normals(decoded, camera))
    view = look(original, camera, window_of([original], camera))
    errors = 100 * error_at_pixels(view, decoded) / (original.diagonal or 1.0)
    picture = np.full((camera.height, camera.width, 3), BACKGROUND, np.float32)
    window = view.window
    part = picture[window.top : window.bottom, window.left : window.right]
    part[view.covered] = colormaps[COLORS](np.clip(errors / LIMIT_PERCENT, 0, 1))[:, :3]
    _write(folder / found["errors"], picture)
    return found


def _enlarged(camera: PinholeCamera) -> PinholeCamera:
    """The same view in more pixels."""
    factor = max(1, -(-SMALLEST // camera.width))
    intrinsic = camera.intrinsic.copy()
    intrinsic[:2] *= factor
    return PinholeCamera(camera.width * factor, camera.height * factor, intrinsic, camera.extrinsic)


def _write(path: Path, picture: Float32[np.ndarray, "H W 3"]) -> None:
    with replacing(path) as file:
        Image.fromarray(np.rint(255 * np.clip(picture, 0, 1)).astype(np.uint8)).save(file, "PNG")
