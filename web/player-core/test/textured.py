"""Writes a small body with a moving texture, for tests: `textured.py FRAMES GROUP_SIZE`, or `textured.py room FRAMES`.

Writes a JSON object to standard output: the file, with both videos; of each group the SHA-256 of the places of its
faces' corners, with all layers and with one beyond the first; of each frame the mean colour of its texture as Python
decodes it; and of each video a packet with a picture larger than a texture may be. Of a room, in which the light grows:
the file, and the mean of its background's texture.
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

from meshreel.coding.appearance.pictures import VideoEncoder, to_i420
from meshreel.decoder.video import Video
from meshreel.decoder.video import open as open_video
from meshreel.encoder.sequence import Encoder
from meshreel.encoder.settings.options import EncoderOptions, appearance_options
from meshreel.format.layout import VideoCodec
from meshreel.geometry.atlas import MOST_SIDE
from meshreel.geometry.derived_sequences import welded
from meshreel.types import Mesh, MeshList, MeshSequence, Texture
from tests.small_bodies import body
from tests.small_options import quick
from tests.small_scene import scene

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
    sequence = welded(MeshList(tuple(textured(mesh, meshes[0], t, frames) for t, mesh in enumerate(meshes))))
    appearance = appearance_options(50.0, "auto", None, compatible=True, splats=None)
    return encoded(sequence, replace(quick(group_size=group_size), appearance=appearance, scene=None))


def room(frames: int) -> bytes:
    """The file of a room that grows bright, with one picture for two frames."""
    lights = np.linspace(0.5, 1, frames)
    colors = [120 + 100 * np.tanh(mesh.vertices) for mesh in scene(frames, moving=True)]
    pairs = zip(scene(frames, moving=True), colors, lights, strict=True)
    meshes = tuple(replace(mesh, colors=(light * color).astype(np.uint8)) for mesh, color, light in pairs)
    options = replace(quick(), appearance=appearance_options(50.0, "texture", 128, compatible=False, splats=None))
    return encoded(welded(MeshList(meshes, 16.0)), options)


def encoded(sequence: MeshSequence, options: EncoderOptions) -> bytes:
    """The bytes of a sequence's file."""
    with tempfile.TemporaryDirectory() as folder:
        Encoder(sequence).encode(Path(folder) / "textured.reel", options)
        return (Path(folder) / "textured.reel").read_bytes()


def places(video: Video) -> list[str]:
    """SHA-256 of the places of the corners of each frame."""
    return [hashlib.sha256(np.ascontiguousarray(mesh.uv, "<f4").tobytes()).hexdigest() for mesh in video]


def too_large(codec: VideoCodec) -> str:
    """The packet of a picture that is larger than a texture may be."""
    width, height = MOST_SIDE + 16, 64
    encoder = VideoEncoder(width, height, codec=codec)
    [packet] = encoder.add(to_i420(np.zeros((height, width, 3), np.uint8))) + encoder.finish()
    return base64.b64encode(packet).decode()


def main_room(frames: int) -> None:
    """Writes the object of a room."""
    file = room(frames)
    with open_video(file) as video:
        means = [float(video.background(t).texture.pixels.mean()) for t in range(frames)]  # type: ignore[union-attr]
    json.dump({"file": base64.b64encode(file).decode(), "means": means}, sys.stdout)


def main(frames: int, group_size: int) -> None:
    """Writes the object of a body."""
    file = written(frames, group_size)
    with open_video(file) as video:
        means = [mesh.texture.pixels.reshape(-1, 3).mean(axis=0).tolist() for mesh in video]  # type: ignore[union-attr]
        one = [places(video.at(layers)) for layers in (1, 2)]  # without the one that hides faces
    large = {"pictures": too_large(VideoCodec.AV1), "compatible": too_large(VideoCodec.H264)}
    made = {"file": base64.b64encode(file).decode(), "oneLayer": one[0], "all": one[1], "means": means, "large": large}
    json.dump(made, sys.stdout)


if __name__ == "__main__":
    main_room(int(sys.argv[2])) if sys.argv[1] == "room" else main(int(sys.argv[1]), int(sys.argv[2]))
