"""Vertices of a frame as Python decodes them, for python.browser.test.ts: `positions.py FILE FRAME`.

Writes those that a face uses, x, y, z in metres from the header's origin, float64, little-endian.
"""

from __future__ import annotations

import sys

import numpy as np

import meshreel


def main(file: str, frame: str) -> None:
    """Writes them to standard output."""
    with meshreel.open(file) as video:
        mesh, origin = video[int(frame)], np.array(video.reader.header.origin)
    used = np.unique(mesh.faces)
    sys.stdout.buffer.write((mesh.vertices[used] - origin).astype("<f8").tobytes())


if __name__ == "__main__":
    main(*sys.argv[1:])
