"""Small picture of a mesh for notebooks, lit from the camera.

In: a mesh. Out: a PNG. Needs no more than decoding does; the renderer of `metrics` is for measuring.
"""

from __future__ import annotations

import struct
import zlib

import numpy as np

from ..types import Mesh
from .cameras import Camera
from .drawing import Parallel, draw_places
from .topology import blend, face_normals

WIDTH, HEIGHT = 400, 300  # pixels (guess)
_TURN, _TILT = 0.5, 0.25  # radians: the mesh from the right of its front, from above (guess)
_CLAY = np.array([190.0, 196.0, 205.0])  # of a surface without colours


def picture(mesh: Mesh, camera: Camera | None = None) -> bytes:
    """Return a PNG of a mesh with faces, from a camera of its size, or else from its front, whose up axis is y."""
    shown, viewer = _fitted(mesh) if camera is None else (mesh, camera)
    seen = draw_places(shown, viewer)
    faces, weights = seen.faces, seen.barycentric
    way = np.array([0.0, 0.0, 1.0]) if camera is None else camera.eye - seen.points
    facing = (face_normals(shown)[0][faces] * way).sum(axis=1) / np.sqrt((way**2).sum(axis=-1))
    color = _CLAY if mesh.colors is None else blend(mesh.colors.astype(np.float64), mesh.faces[faces], weights)
    pixels = np.zeros((HEIGHT, WIDTH, 4), np.uint8)
    pixels[seen.covered, :3], pixels[seen.covered, 3] = (color * (0.35 + 0.65 * np.abs(facing))[:, None]).round(), 255
    return _png(pixels)


def _fitted(mesh: Mesh) -> tuple[Mesh, Parallel]:
    """Return a mesh in pixels, from the middle of the picture, with the camera that sees it."""
    turn = np.array([[np.cos(_TURN), 0, -np.sin(_TURN)], [0, 1, 0], [np.sin(_TURN), 0, np.cos(_TURN)]])
    tilt = np.array([[1, 0, 0], [0, np.cos(_TILT), -np.sin(_TILT)], [0, np.sin(_TILT), np.cos(_TILT)]])
    turned = (mesh.vertices - mesh.middle) @ (tilt @ turn).T  # x to the right, y up, z to the camera
    low, high = turned.min(axis=0), turned.max(axis=0)
    size = np.maximum(high - low, 1e-12)
    scale = 0.94 * min(WIDTH / size[0], HEIGHT / size[1])
    shown = Mesh((turned - (low + high) / 2) * scale, mesh.faces)
    return shown, Parallel(WIDTH, HEIGHT, 1.0, np.diag([1.0, -1.0, -1.0, 1.0]))


def _png(pixels: np.ndarray) -> bytes:
    height, width = pixels.shape[:2]
    rows = np.concatenate([np.zeros((height, 1), np.uint8), pixels.reshape(height, -1)], axis=1)  # without filters
    head = struct.pack(">2I5B", width, height, 8, 6, 0, 0, 0)  # 8 bits, red, green, blue and alpha
    parts = [(b"IHDR", head), (b"IDAT", zlib.compress(rows.tobytes())), (b"IEND", b"")]
    chunks = [
        struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data)) for kind, data in parts
    ]
    return b"\x89PNG\r\n\x1a\n" + b"".join(chunks)
