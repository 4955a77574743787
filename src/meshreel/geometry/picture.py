"""Small picture of a mesh for notebooks: points on its faces, the nearest in each pixel, lit from the camera.

In: a mesh. Out: a PNG. Needs NumPy alone, as decoding does; the renderer of `metrics` is for measuring.
"""

from __future__ import annotations

import struct
import zlib

import numpy as np

from ..types import Mesh
from .topology import blend, face_normals

WIDTH, HEIGHT = 400, 300  # pixels (guess)
_TURN, _TILT = 0.5, 0.25  # radians: the mesh from the right of its front, from above (guess)
_DENSITY = 4.0  # points for each pixel of a face: fewer leave holes (measured on a sphere)
_CLAY = np.array([190.0, 196.0, 205.0])  # of a surface without colours
_STEPS = np.array([0.7548776662466927, 0.5698402909980532])  # R2 sequence: fills a face evenly


def picture(mesh: Mesh) -> bytes:
    """Return a PNG of a mesh with faces, seen from its front, whose up axis is y."""
    turn = np.array([[np.cos(_TURN), 0, -np.sin(_TURN)], [0, 1, 0], [np.sin(_TURN), 0, np.cos(_TURN)]])
    tilt = np.array([[1, 0, 0], [0, np.cos(_TILT), -np.sin(_TILT)], [0, np.sin(_TILT), np.cos(_TILT)]])
    turned = (mesh.vertices - mesh.middle) @ (tilt @ turn).T  # x to the right, y up, z to the camera
    low, high = turned.min(axis=0), turned.max(axis=0)
    size = np.maximum(high - low, 1e-12)
    scale = 0.94 * min(WIDTH / size[0], HEIGHT / size[1])
    turned = (turned - (low + high) / 2) * scale
    faces, weights = _points(turned[mesh.faces])
    places = blend(turned, mesh.faces[faces], weights)
    column = np.clip(places[:, 0] + WIDTH / 2, 0, WIDTH - 1).astype(int)
    row = np.clip(HEIGHT / 2 - places[:, 1], 0, HEIGHT - 1).astype(int)
    order = np.argsort(places[:, 2], kind="stable")  # the nearest last, so that it stays in a pixel
    light = 0.35 + 0.65 * np.abs(face_normals(Mesh(turned, mesh.faces))[0][faces, 2:])
    color = _CLAY if mesh.colors is None else blend(mesh.colors.astype(np.float64), mesh.faces[faces], weights)
    pixels = np.zeros((HEIGHT, WIDTH, 4), np.uint8)
    pixels[row[order], column[order], :3] = (color * light).round()[order]
    pixels[row, column, 3] = 255
    return _png(pixels)


def _points(corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the faces of points that cover each pixel of all faces, and their barycentric weights."""
    first, second = corners[:, 1, :2] - corners[:, 0, :2], corners[:, 2, :2] - corners[:, 0, :2]
    areas = np.abs(first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]) / 2
    counts = 1 + (_DENSITY * areas).astype(int)
    faces = np.repeat(np.arange(len(corners)), counts)
    number = np.arange(len(faces)) - np.repeat(np.cumsum(counts) - counts, counts)
    weights = (0.5 + (number[:, None] + 1) * _STEPS) % 1
    weights = np.where(weights.sum(axis=1, keepdims=True) > 1, 1 - weights, weights)
    return faces, np.column_stack([1 - weights.sum(axis=1), weights])


def _png(pixels: np.ndarray) -> bytes:
    height, width = pixels.shape[:2]
    rows = np.concatenate([np.zeros((height, 1), np.uint8), pixels.reshape(height, -1)], axis=1)  # without filters
    head = struct.pack(">2I5B", width, height, 8, 6, 0, 0, 0)  # 8 bits, red, green, blue and alpha
    parts = [(b"IHDR", head), (b"IDAT", zlib.compress(rows.tobytes())), (b"IEND", b"")]
    chunks = [
        struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data)) for kind, data in parts
    ]
    return b"\x89PNG\r\n\x1a\n" + b"".join(chunks)
