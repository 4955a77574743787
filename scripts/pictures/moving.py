"""The moving picture of README.md: procedural people beside the same people decoded from a .reel file.

python scripts/pictures/moving.py      # docs/pictures/moving.gif and moving.json, about six minutes

In: nothing; the capture is computed. Out: an animated GIF, and a JSON object with the numbers that its captions show.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from jaxtyping import Float64, UInt8
from PIL import Image, ImageDraw, ImageFont

import meshreel
from meshreel.capture.procedural import SoftBodiesOptions, soft_bodies
from meshreel.metrics.render import Window, look
from meshreel.metrics.viewpoints import Box, OrthographicCamera
from meshreel.types import Mesh

OUTPUT = Path(__file__).resolve().parents[2] / "docs" / "pictures" / "moving.gif"
QUALITY = 50.0
EVERY = 2  # of the frames are drawn: 15 pictures per second
PANEL = (400, 300)  # pixels, width and height
TITLE = 26  # pixels over a panel
FINE = 2  # rays per pixel and axis, averaged
GREYS = 32  # the palette of the GIF
FROM = np.array([0.30, 0.28, 1.0])  # the direction from the scene to the eye
LAMP = np.array([0.35, 0.75, 0.55]) / np.linalg.norm([0.35, 0.75, 0.55])  # in the camera's axes: right, up, back


@dataclass(frozen=True)
class Facts:
    """The numbers in the captions."""

    frames: int
    frame_rate: float  # 1/s
    triangles: int  # mean per original frame
    bytes: int  # of the .reel file

    @property
    def captions(self) -> tuple[str, str]:
        """Titles of the two panels."""
        seconds = self.frames / self.frame_rate
        original = f"original: {self.triangles / 1000:.0f},000 triangles per frame, new in every frame"
        return original, f"decoded: {seconds:.0f} s in {self.bytes / 1000:.0f} kB"


def main(arguments: list[str]) -> int:
    """Encode, decode and draw."""
    parser = argparse.ArgumentParser(description="Draw the moving picture of README.md.")
    parser.add_argument("-o", "--output", type=Path, default=OUTPUT)
    parser.add_argument("--frames", type=int, default=90)
    chosen = parser.parse_args(arguments)
    bodies = soft_bodies(SoftBodiesOptions(frames=chosen.frames))
    sequence = meshreel.MeshList(tuple(bodies), frame_rate=bodies.frame_rate)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "people.reel"
        meshreel.encode(sequence, path, meshreel.preset_options(quality=QUALITY))
        triangles = round(np.mean([len(mesh.faces) for mesh in sequence]))
        facts = Facts(len(sequence), sequence.frame_rate, triangles, path.stat().st_size)
        with meshreel.open(path) as video:
            shown = range(0, len(sequence), EVERY)
            pairs = [(sequence[number], video[number]) for number in shown]
    write_gif(pairs, facts, chosen.output)
    row = json.dumps(facts.__dict__)
    chosen.output.with_suffix(".json").write_text(row + "\n", encoding="utf-8")
    print(row)
    return 0


def write_gif(pairs: list[tuple[Mesh, Mesh]], facts: Facts, path: Path) -> None:
    """Write the pairs side by side, at about the speed of the recording."""
    camera = oblique([original for original, _ in pairs])
    pictures = [side_by_side([shaded(mesh, camera) for mesh in pair], facts.captions) for pair in pairs]
    duration = 10 * round(100 * EVERY / facts.frame_rate)  # ms; a GIF counts in hundredths of a second
    pictures[0].save(path, save_all=True, append_images=pictures[1:], duration=duration, loop=0, optimize=True)


def side_by_side(panels: list[UInt8[np.ndarray, "H W"]], titles: tuple[str, ...]) -> Image.Image:
    """One picture of all panels under their titles, in few greys."""
    wide, high = PANEL
    picture = Image.new("L", (wide * len(panels), TITLE + high), 255)
    pen, font = ImageDraw.Draw(picture), ImageFont.load_default(14)
    for number, (panel, title) in enumerate(zip(panels, titles, strict=True)):
        picture.paste(Image.fromarray(panel), (number * wide, TITLE))
        pen.text((number * wide + wide / 2, TITLE / 2), title, fill=60, font=font, anchor="mm")
    return picture.quantize(GREYS)


def shaded(mesh: Mesh, camera: OrthographicCamera) -> UInt8[np.ndarray, "H W"]:
    """The mesh under a lamp above the eye, in greys."""
    fine = replace(camera, width=FINE * camera.width, height=FINE * camera.height, pixel=camera.pixel / FINE)
    view = look(mesh, fine, Window(0, fine.height, 0, fine.width))
    picture = np.ones(view.covered.shape)
    turned = view.normals @ fine.extrinsic[:3, :3].T * [1, -1, -1]
    picture[view.covered] = 0.25 + 0.65 * np.clip(turned @ LAMP, 0, 1)
    averaged = picture.reshape(camera.height, FINE, camera.width, FINE).mean(axis=(1, 3))
    return np.rint(255 * averaged).astype(np.uint8)


def oblique(meshes: list[Mesh]) -> OrthographicCamera:
    """A parallel view from slightly above that holds all meshes."""
    ahead = -FROM / np.linalg.norm(FROM)
    right = np.cross(ahead, [0.0, 1.0, 0.0])
    right /= np.linalg.norm(right)
    rotation = np.stack([right, np.cross(ahead, right), ahead])
    box = Box.of(meshes)
    placed: Float64[np.ndarray, "V 3"] = np.concatenate([mesh.vertices for mesh in meshes]) @ rotation.T
    low, high = placed.min(axis=0), placed.max(axis=0)
    extrinsic = np.eye(4)
    extrinsic[:3, :3] = rotation
    extrinsic[:3, 3] = -(low + high) / 2
    pixel = 1.04 * max((high - low)[:2] / PANEL)  # m
    return OrthographicCamera(*PANEL, pixel, extrinsic, back=2 * float(np.linalg.norm(box.size)))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
