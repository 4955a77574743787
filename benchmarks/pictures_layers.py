"""Captured bodies at a low rate, to be looked at: a preset beside A2s and the preset `paper`, each codec at its own
point nearest to the rate; the preset's worst frame, normal-colored and as an error map, from the front and the back.

python benchmarks/pictures_layers.py ROWS.jsonl -o FOLDER      # ROWS: of `meshreel bench run layers`; a minute a body

The terms of the captures do not let them be published: do not write into docs/.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from meshreel_bench.codecs import make_codec
from meshreel_bench.curves import ANCHOR
from meshreel_bench.datasets import open_dataset
from meshreel_bench.experiments import layers
from meshreel_bench.rows import Row, curve_rows, read_rows

from meshreel.errors import InputError
from meshreel.metrics.distance import SurfaceErrors, surface_errors
from meshreel.types import Mesh, MeshList, MeshSequence

sys.path.insert(0, str(Path(__file__).parent))
from drawing import DPI, camera_for, heat, normal_colored

BODIES = ("dancer", "basketball_player")
VIEWS = (0, 2)  # front, back
LIMIT = 0.5  # % of the diagonal, where the error map's colors end
SIZE = 400  # pixels of a panel
KINDS = {"draco": "draco", "decimated_draco": "decimated_draco", ANCHOR: "decimated_draco"}  # of `make_codec`


@dataclass(frozen=True, slots=True)
class Shown:
    """A codec's frames, as decoded."""

    name: str
    point: str
    mbps: float
    frames: tuple[Mesh, ...]
    errors: tuple[SurfaceErrors, ...]

    @property
    def worst(self) -> int:
        """The frame of the lowest symmetric D2."""
        return int(np.argmin([errors.symmetric_psnr for errors in self.errors]))

    def title(self, frame: int) -> str:
        """Rate of the sequence, and quality of a frame."""
        errors = self.errors[frame]
        return (
            f"{self.name}, {self.point}\n{self.mbps:.3f} Mbps, D2 {errors.d2_psnr_paper:.1f} dB, "
            f"symmetric {errors.symmetric_psnr:.1f}, normals {errors.angle:.1f}°"
        )


def main(arguments: list[str]) -> int:
    """A picture a body."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("rows", type=Path)
    parser.add_argument("-o", "--output", type=Path, default=Path("build/pictures"))
    parser.add_argument("--data", type=Path, default=Path("../shared/data/performers"))
    parser.add_argument("--preset", default=layers.PRESET)
    parser.add_argument("--mbps", type=float, default=0.3)
    parser.add_argument("--frames", type=int, default=None, help="the first so many only")
    parser.add_argument("--bodies", nargs="+", default=BODIES)
    chosen = parser.parse_args(arguments)
    chosen.output.mkdir(parents=True, exist_ok=True)
    rows = read_rows(chosen.rows)
    for body in chosen.bodies:
        files = open_dataset(body, chosen.data, chosen.frames)
        originals = MeshList(tuple(files), files.frame_rate)
        names = dict.fromkeys((f"meshreel {chosen.preset}", ANCHOR, "meshreel paper"))
        shown = [show(nearest(curve_rows(rows, body), name, chosen.mbps), originals) for name in names]
        path = chosen.output / f"layers-{body}.png"
        draw(originals, shown, path)
        print(path)
    return 0


def nearest(rows: Sequence[Row], codec: str, mbps: float) -> Row:
    """The codec's row whose rate is nearest, by its logarithm."""
    own = [row for row in rows if row["codec"] == codec]
    if not own:
        raise InputError(f"no row of {codec}; measure it with `meshreel bench run layers`")
    return min(own, key=lambda row: abs(np.log(row["mbps"] / mbps)))


def show(row: Row, originals: MeshSequence) -> Shown:
    """The frames of a row's codec at its point, made again."""
    codec = make_codec(KINDS.get(row["codec"], "meshreel"), row["options"])
    data = codec.encode(originals)
    frames = tuple(codec.decode(data))
    point = ", ".join(f"{k} {v:g}" for k, v in row["options"].items() if isinstance(v, (int, float)))
    errors = tuple(surface_errors(a, b) for a, b in zip(originals, frames, strict=True))
    mbps = len(data) * 8 * originals.frame_rate / len(originals) / 1e6
    return Shown(row["codec"], point, mbps, frames, errors)


def draw(originals: MeshSequence, shown: Sequence[Shown], path: Path) -> None:
    """Two lines a view: the original and every codec, colored by normals, and the codecs' error maps."""
    frame = shown[0].worst
    original = originals[frame]
    columns, lines = 1 + len(shown), 2 * len(VIEWS)
    figure = Figure(figsize=(columns * SIZE / DPI, (lines * SIZE + 60) / DPI), dpi=DPI, layout="constrained")
    FigureCanvasAgg(figure)
    panels = figure.subplots(lines, columns, squeeze=False)
    for panel in panels.reshape(-1):
        panel.set_axis_off()
    for number, view in enumerate(VIEWS):
        camera = camera_for([original], SIZE, view)
        above, below = panels[2 * number], panels[2 * number + 1]
        above[0].imshow(normal_colored(original, camera))
        for one, top, bottom in zip(shown, above[1:], below[1:], strict=True):
            top.imshow(np.clip(normal_colored(one.frames[frame], camera), 0, 1))
            percent = 100 * heat(original, camera, one.frames[frame]) / original.diagonal
            image = bottom.imshow(percent, cmap="viridis", vmin=0, vmax=LIMIT, interpolation="nearest")
    panels[0][0].set_title(f"original, frame {frame}: the worst of {shown[0].name}", fontsize=8)
    for one, panel in zip(shown, panels[0][1:], strict=True):
        panel.set_title(one.title(frame), fontsize=8)
    bar = figure.colorbar(image, ax=panels[1][0], location="left", extend="max", fraction=0.1)
    bar.set_label("distance to the decoded surface, % of the diagonal", fontsize=8)
    figure.savefig(path, dpi=DPI)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
