"""Pictures of coloured surfaces by ray casting, unlit, on white: what a viewer of a recording sees."""

from __future__ import annotations

import numpy as np
from jaxtyping import UInt8

from ..geometry.painted import Painted
from ..geometry.raycast import Rays
from ..types import Mesh
from .viewpoints import Camera


def render_colors(mesh: Mesh, camera: Camera) -> UInt8[np.ndarray, "H W 3"]:
    """Render a mesh with its colours; one without is grey."""
    image = np.full((camera.height, camera.width, 3), 255, np.uint8)
    if mesh.is_empty:
        return image
    rows, columns = np.mgrid[: camera.height, : camera.width]
    origins, directions = camera.rays(np.column_stack([columns.ravel(), rows.ravel()]) + 0.5)
    turn, move = camera.extrinsic[:3, :3], camera.extrinsic[:3, 3]
    hit = Rays(mesh).cast((origins - move) @ turn, directions @ turn)
    seen = hit.faces >= 0
    colors = Painted(mesh).on(hit.faces[seen], hit.barycentric[seen])
    image.reshape(-1, 3)[seen] = np.clip(np.rint(colors), 0, 255)
    return image
