"""The moving picture of README.md: procedural people beside the same people decoded from a .reel file.

`python -m meshreel_bench.decisions.moving_picture [FOLDER]` writes moving.gif, and moving.json with the numbers of its
captions, into docs/pictures, in some six minutes.
"""

from __future__ import annotations

import json
import sys
import tempfile
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont

import meshreel
from meshreel.capture.procedural import SoftBodiesOptions, soft_bodies
from meshreel.types import Mesh

from .drawing import oblique, shaded

FRAMES = 90  # of the recording: three seconds
EVERY = 2  # of the frames are drawn: 15 pictures per second
PANEL = (400, 300)  # pixels, width and height
TITLE = 26  # pixels over a panel
CONTRAST = 2  # exponent of the greys; chosen by eye
GREYS = 32  # in the palette of the GIF
MARGIN = 1.04  # of the view around the bodies
FROM = np.array([0.30, 0.28, 1.0])  # direction from the scene to the eye


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
        original = f"original: {self.triangles / 1000:.0f},000 triangles per frame, new in every frame"
        return original, f"decoded: {self.frames / self.frame_rate:.0f} s in {self.bytes / 1000:.0f} kB"


def main(folder: Path = Path("docs/pictures")) -> None:
    """Encode and decode the procedural people at the default quality, and draw both."""
    bodies = soft_bodies(SoftBodiesOptions(frames=FRAMES))
    sequence = meshreel.MeshList(tuple(bodies), frame_rate=bodies.frame_rate)
    with tempfile.TemporaryDirectory() as temporary:
        path = Path(temporary) / "people.reel"
        meshreel.encode(sequence, path)
        triangles = round(float(np.mean([len(mesh.faces) for mesh in sequence])))
        facts = Facts(len(sequence), sequence.frame_rate, triangles, path.stat().st_size)
        with meshreel.open(path) as video:
            pairs = [(sequence[number], video[number]) for number in range(0, FRAMES, EVERY)]
    write_gif(pairs, facts, folder / "moving.gif")
    (folder / "moving.json").write_text(json.dumps(asdict(facts)) + "\n", encoding="utf-8")


def write_gif(pairs: list[tuple[Mesh, Mesh]], facts: Facts, path: Path) -> None:
    """Write pairs of meshes side by side, at about the speed of the recording."""
    camera = oblique([original for original, _ in pairs], FROM, PANEL, MARGIN)
    pictures = [side_by_side([shaded(mesh, camera) for mesh in pair], facts.captions) for pair in pairs]
    duration = 10 * round(100 * EVERY / facts.frame_rate)  # ms; a GIF counts in hundredths of a second
    pictures[0].save(path, save_all=True, append_images=pictures[1:], duration=duration, loop=0, optimize=True)


def side_by_side(panels: list[np.ndarray], titles: tuple[str, ...]) -> Image.Image:
    """Return one picture of all panels under their titles, in few greys."""
    wide, high = PANEL
    picture = Image.new("L", (wide * len(panels), TITLE + high), 255)
    pen, font = ImageDraw.Draw(picture), ImageFont.load_default(14)
    for number, (panel, title) in enumerate(zip(panels, titles, strict=True)):
        picture.paste(
            Image.fromarray(np.rint(255 * panel[..., 0] ** CONTRAST).astype(np.uint8)), (number * wide, TITLE)
        )
        pen.text((number * wide + wide / 2, TITLE / 2), title, fill=60, font=font, anchor="mm")
    return picture.quantize(GREYS)


if __name__ == "__main__":
    main(*map(Path, sys.argv[1:]))
