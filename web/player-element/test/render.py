"""Draws a frame as Python does, for python.browser.test.ts: `render.py FILE FRAME WIDTH HEIGHT FOV CAMERA`.

Writes RGB bytes. CAMERA is the element's attribute: where it is and what it looks at, six numbers, from the header's
origin.
"""

from __future__ import annotations

import math
import sys

import numpy as np

import meshreel
from meshreel.geometry.cameras import Camera
from meshreel.metrics.render import look
from meshreel.types import Mesh


def main(file: str, frame: str, width: str, height: str, fov: str, camera: str) -> None:
    """Writes the picture to standard output."""
    numbers = [float(number) for number in camera.split(",")]
    eye, target = np.array(numbers[:3]), np.array(numbers[3:6])
    forward = (target - eye) / np.linalg.norm(target - eye)
    right = np.cross(forward, [0.0, 1.0, 0.0])
    right /= np.linalg.norm(right)
    axes = np.stack([right, -np.cross(right, forward), forward])  # x to the right, y down, z away
    extrinsic = np.eye(4)
    extrinsic[:3, :3], extrinsic[:3, 3] = axes, -axes @ eye
    w, h = int(width), int(height)
    focal = h / 2 / math.tan(math.radians(float(fov)) / 2)
    intrinsic = np.array([[focal, 0, w / 2], [0, focal, h / 2], [0, 0, 1]])
    with meshreel.open(file) as video:
        mesh, origin = video[int(frame)], np.array(video.reader.header.origin)
    moved = Mesh(mesh.vertices - origin, mesh.faces)
    picture = look(moved, Camera.of(w, h, intrinsic, extrinsic)).colors
    sys.stdout.buffer.write((255 * picture).round().astype(np.uint8).tobytes())


if __name__ == "__main__":
    main(*sys.argv[1:])
