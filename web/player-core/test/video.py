"""Writes a video of a texture, for tests: `video.py FRAMES SIDE`, a JSON object of its packets in base64, by rendition.

Its pictures are the colours of a procedural room, in a light that moves over them.
"""

from __future__ import annotations

import base64
import json
import sys

import numpy as np

from meshreel.capture.simulated.solid_colors import room_colors
from meshreel.coding.appearance.pictures import VideoEncoder, to_i420
from meshreel.format.layout import VideoCodec

WIDTH = 2.0  # m, of what the texture shows: texels of 2 mm where there are 1024
SOFT = 0.3  # m, of the border of the light


def main(frames: int, side: int) -> None:
    """Writes the object."""
    right, up = (axis.ravel() * WIDTH / side for axis in np.meshgrid(np.arange(side), np.arange(side)))
    colors = room_colors(np.column_stack([right, up, np.zeros(side * side)]))
    codecs = {"pictures": VideoCodec.AV1, "compatible": VideoCodec.H264}
    encoders = {name: VideoEncoder(side, side, codec=codec) for name, codec in codecs.items()}
    packets = {name: list[bytes]() for name in codecs}
    for t in range(frames):
        light = 0.75 + 0.25 * np.tanh((right - WIDTH * t / frames) / SOFT)
        planes = to_i420((light[:, None] * colors).reshape(side, side, 3).astype(np.uint8))
        for name, encoder in encoders.items():
            packets[name] += encoder.add(planes)
    for name, encoder in encoders.items():
        packets[name] += encoder.finish()
    coded = {name: [base64.b64encode(packet).decode() for packet in found] for name, found in packets.items()}
    json.dump(coded, sys.stdout)


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]))
