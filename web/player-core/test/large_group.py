"""Writes a file for speed.test.ts to standard output: two groups of 10 frames of a ball of 20k vertices that ripples.

The second group is predicted from the first, as in what `meshreel encode` writes.
"""

from __future__ import annotations

import io
import sys

import numpy as np

from meshreel.coding.layers.coder import LayerCodingOptions, LayersState, encode_layers
from meshreel.coding.mesh import code_reference
from meshreel.container.writer import ReelWriter
from meshreel.format.layout import Header
from meshreel.types import Mesh

RINGS, LEVELS = 26, 2  # 27 x 52 vertices, subdivided twice: 21k
FRAMES = 10
STEP = 0.001


def main() -> None:
    """Writes the file."""
    reference = code_reference(ball(), 11, LEVELS)
    points = reference.base.vertices
    corner = (0.5, 0.5, 0.5)
    low = tuple(-x for x in corner)
    file = io.BytesIO()
    with ReelWriter(file, Header(24.0, (0.0, 0.0, 0.0), 2.0, low, corner, "{}", 0, ())) as writer:
        state: LayersState | None = None
        for group in range(2):
            time = (FRAMES * group + np.arange(FRAMES))[:, None, None]
            wanted = points * (1 + 0.01 * time) + 0.01 * np.sin(20 * points[:, [1, 2, 0]] + 0.3 * time)
            coded = encode_layers(reference, wanted, LayerCodingOptions(step=STEP), state)
            before = () if state is None else (0,)
            writer.add_group(FRAMES * group, FRAMES, coded.payload, coded.layers, before, 0)
            state = coded.state
    sys.stdout.buffer.write(file.getvalue())


def ball() -> Mesh:
    """A ball of rings, whose poles are rings of points in one place but for a little."""
    theta = np.linspace(0.02, np.pi - 0.02, RINGS + 1)
    phi = np.arange(2 * RINGS) * np.pi / RINGS
    t, p = (axis.reshape(-1) for axis in np.meshgrid(theta, phi, indexing="ij"))
    points = 0.25 * np.stack([np.sin(t) * np.cos(p), np.cos(t), np.sin(t) * np.sin(p)], axis=1)
    ring, step = np.meshgrid(np.arange(RINGS) * 2 * RINGS, np.arange(2 * RINGS), indexing="ij")
    a, b = (ring + step).reshape(-1), (ring + (step + 1) % (2 * RINGS)).reshape(-1)
    down = 2 * RINGS
    faces = np.concatenate([np.stack([a, b, a + down], axis=1), np.stack([b, b + down, a + down], axis=1)])
    return Mesh.of(points, faces)


if __name__ == "__main__":
    main()
