"""Writes a small body with a moving texture, for tests: `textured.py FRAMES GROUP_SIZE`.

Writes a JSON object to standard output: the file; of each group the SHA-256 of the places of its faces' corners, with
all layers and with one beyond the first; and of each frame the mean colour of its texture as Python decodes it.
"""

from __future__ import annotations

import base64
import hashlib
import json
import sys
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[3]))

from meshreel.decoder.video import Video
from meshreel.decoder.video import open as open_video
from meshreel.encoder.presets import appearance_options
from meshreel.encoder.sequence import Encoder
from meshreel.geometry.derived_sequences import Welded
from meshreel.types import Mesh, MeshList, Texture
from tests.small_bodies import body
from tests.small_options import quick

SIDE = 64  # texels of the texture that is given


def textured(mesh: Mesh, rest: Mesh, t: int, frames: int) -> Mesh:
    """The mesh in one colour for each frame, by its texture: a ramp of red over time, and checks of green."""
    flat = rest.vertices[:, :2] / np.abs(rest.vertices).max() / 2 + 0.5
    pixels = np.full((SIDE, SIDE, 3), 60, np.uint8)
    pixels[..., 0] = 40 + 200 * t // max(1, frames - 1)
    pixels[..., 1] = (np.indices((SIDE, SIDE)) // 8).sum(axis=0) % 2 * 160
    return replace(mesh, uv=flat[mesh.faces].astype(np.float32), texture=Texture.of(pixels))


def written(frames: int, group_size: int) -> bytes:
    """The file."""
    meshes = body(1, frames)
    sequence = Welded(MeshList(tuple(textured(mesh, meshes[0], t, frames) for t, mesh in enumerate(meshes))))
    options = replace(quick(group_size=group_size), appearance=appearance_options(50.0, "auto"), scene=None)
    with tempfile.TemporaryDirectory() as folder:
        Encoder(sequence).encode(Path(folder) / "textured.reel", options)
        return (Path(folder) / "textured.reel").read_bytes()


def places(video: Video) -> list[str]:
    """SHA-256 of the places of the corners of each frame."""
    return [hashlib.sha256(np.ascontiguousarray(mesh.uv, "<f4").tobytes()).hexdigest() for mesh in video]


def main(frames: int, group_size: int) -> None:
    """Writes the object."""
    file = written(frames, group_size)
    with open_video(file) as video:
        means = [mesh.texture.pixels.reshape(-1, 3).mean(axis=0).tolist() for mesh in video]  # type: ignore[union-attr]
        one = [places(video.at(layers)) for layers in (1, None)]
    json.dump({"file": base64.b64encode(file).decode(), "oneLayer": one[0], "all": one[1], "means": means}, sys.stdout)


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]))
