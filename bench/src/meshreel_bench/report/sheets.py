"""Sheets of pictures: the original and one operating point of each codec, with a magnified box and maps of the error.

In: rows that name pictures, and the folders that have these. Out: a PNG a sequence, as wide as a page of a paper. A
row without pictures, or whose files are missing, has no place.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import UInt8

from meshreel.metrics.render import Window

from ..curves import curve_of, value
from ..names import BEST, title
from ..rows import Row
from .boxes import Layout, cut_out, layout_of
from .grids import LETTERS, Grid, Place
from .looks import in_order
from .plots import matplotlib_settings, new_figure, write_figure
from .tables import DAGGER, common_rate, is_near, nearest

PICTURES = "pictures"  # of a row: the names of its files, the frame, and where the scale of errors ends
_KEYS = {"normals", "errors", "frame", "limit_percent"}
SCALE = "viridis"  # of the maps, from 0 to the limit
ORIGINAL = "{}-original.png"  # of a sequence, where a row does not say
_DPI = 300
_EDGE = 0.01  # of the longer side, around each picture
_RED = "#E00000"
_D2 = (("d2_psnr_paper", "D2 {:.2f} dB"), ("input_d2_psnr_forward", "D2 to input {:.2f} dB"))
_SSIM = (("ssim_masked", "masked SSIM {:.3f}"), ("input_ssim_masked", "SSIM to input {:.3f}"))

Picture = UInt8[np.ndarray, "H W 3"]


@dataclass(frozen=True, slots=True)
class Files:
    """The pictures of one row, which are there."""

    row: Row
    original: Path
    normals: Path
    errors: Path
    scale: tuple[int, float, tuple[int, int]]  # frame, % of the diagonal, size in pixels: equal in all of a sheet


@dataclass(frozen=True, slots=True)
class Shots:
    """What a sheet shows."""

    sequence: str
    frame: int
    limit_percent: float
    mbps: float  # each codec's point is that nearest to it
    original: Path
    columns: tuple[Files, ...]  # one a codec
    left_out: tuple[str, ...]  # codecs whose pictures are of another frame, scale or size


def find_shots(rows: Sequence[Row], folders: Sequence[Path]) -> Shots | None:
    """The sheet of one sequence: each codec at its point nearest to a common rate; None where no pictures are there.

    Pictures of several frames, scales or sizes cannot be compared: those that most codecs have are shown.
    """
    files = [found for row in rows if (found := _files(row, folders)) is not None]
    if not files:
        return None
    scales = list(dict.fromkeys(found.scale for found in files))
    codecs = {scale: {curve_of(found.row) for found in files if found.scale == scale} for scale in scales}
    chosen = max(scales, key=lambda scale: len(codecs[scale]))  # the first of those that as many have
    own = [found for found in files if found.scale == chosen]
    mbps = common_rate([found.row for found in own])
    points = nearest([found.row for found in own], mbps)
    columns = tuple(next(found for found in own if found.row is row) for row in points.values())
    others = in_order(set[str]().union(*codecs.values()) - codecs[chosen])
    frame, limit, _ = chosen
    return Shots(str(rows[0]["sequence"]), frame, limit, mbps, columns[0].original, columns, tuple(others))


def draw_sheet(shots: Shots, path: Path) -> Path:
    """Writes the sheet; its path."""
    with matplotlib_settings():
        return write_figure(sheet_figure(shots), path, _DPI)


def sheet_figure(shots: Shots) -> Any:
    """Columns: the original, then codecs. Rows: normals with the magnified box, maps of the error; captions below."""
    original, normals, errors = _read(shots)
    layout = layout_of(original, normals)
    names = ["original", *(title(curve_of(files.row)) for files in shots.columns)]
    told = [[f"frame {shots.frame}"], *(_qualities(files.row, shots.mbps) for files in shots.columns)]
    grid = Grid.of(names, layout.cut.shape, max(map(len, told)))
    figure = new_figure(*grid.size, None)
    for column, picture in enumerate([original, *normals]):
        _show(figure.add_axes(grid.picture(column, 0), label=f"{column} 0"), picture, layout)
    for column, picture in enumerate(errors, 1):
        bare = Layout(layout.cut, None, None)
        _show(figure.add_axes(grid.picture(column, 1), label=f"{column} 1"), picture, bare)
    for column, lines in enumerate(told):
        row, first = (1, grid.name_lines) if column else (0, 1)  # the original has no map: its caption is in its place
        for place, line in [*enumerate(grid.names[column]), *enumerate(lines, first)]:
            weight = "bold" if names[column] == title(BEST) and place < first else "normal"
            at = grid.line(column, place, row)
            figure.text(*at, line, ha="center", va="top", fontsize=LETTERS, fontweight=weight)
    _scale(figure, grid.bar(1 + len(told[0])), shots.limit_percent)
    return figure


def _files(row: Row, folders: Sequence[Path]) -> Files | None:
    """The pictures of a row in the first folder that has all of them."""
    named = row.get(PICTURES)
    if not isinstance(named, dict) or not named.keys() >= _KEYS:
        return None
    frame, limit = named["frame"], named["limit_percent"]
    if not isinstance(frame, int) or not isinstance(limit, (int, float)) or not limit > 0:
        return None
    first = str(named.get("original", ORIGINAL.format(row["sequence"])))
    names = (first, str(named["normals"]), str(named["errors"]))
    if any(Path(name).name != name for name in names):  # of these folders only
        return None
    for folder in folders:
        original, normals, errors = (folder / name for name in names)
        sizes = {_size(path) for path in (original, normals, errors)}
        if len(sizes) == 1 and (size := sizes.pop()) is not None:
            return Files(row, original, normals, errors, (frame, float(limit), size))
    return None


def _size(path: Path) -> tuple[int, int] | None:
    """Of a picture; None where there is none that can be read."""
    from PIL import Image

    try:
        with Image.open(path) as picture:
            picture.load()
            return picture.size
    except (OSError, SyntaxError, ValueError, Image.DecompressionBombError):
        # Pillow's names for files that are missing, cut off, no pictures, or ones that claim to fill the memory
        return None


def _read(shots: Shots) -> tuple[Picture, list[Picture], list[Picture]]:
    """The original, and the codecs' normals and errors."""
    normals = [_pixels(files.normals) for files in shots.columns]
    return _pixels(shots.original), normals, [_pixels(files.errors) for files in shots.columns]


def _pixels(path: Path) -> Picture:
    from PIL import Image

    with Image.open(path) as picture:
        return np.asarray(picture.convert("RGB"), dtype=np.uint8)


def _qualities(row: Row, mbps: float) -> list[str]:
    """Rate, marked where it is far from the common one, and qualities, a line each."""
    lines = [f"{row['mbps']:.3g} Mbps" + ("" if is_near(row, mbps) else f" {DAGGER}")]
    for measures in (_D2, _SSIM):
        found = [form.format(number) for key, form in measures if (number := value(row, key)) is not None]
        lines += found[:1]
    return lines


def _show(panel: Any, picture: Picture, layout: Layout) -> None:
    """What is shown of a picture, and the magnified box in it."""
    from matplotlib.patches import Rectangle

    panel.set_axis_off()
    cut, box, inset = layout.cut, layout.box, layout.inset
    panel.imshow(cut_out(picture, cut), extent=_extent(cut))
    if box is not None and inset is not None:
        panel.imshow(cut_out(picture, box), extent=_extent(inset), zorder=2)
        for window, style in ((box, ":"), (inset, "-")):
            corner = (window.left, window.top)
            height, width = window.shape
            frame = Rectangle(corner, width, height, fill=False, edgecolor=_RED, linestyle=style, lw=0.8, zorder=3)
            panel.add_patch(frame)
    edge = _EDGE * max(cut.shape)  # else a frame at the border is half as thick
    panel.set(xlim=(cut.left - edge, cut.right + edge), ylim=(cut.bottom + edge, cut.top - edge))


def _extent(window: Window) -> tuple[float, float, float, float]:
    return window.left, window.right, window.bottom, window.top


def _scale(figure: Any, place: Place, limit: float) -> None:
    """The color bar of the maps."""
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize

    bar = figure.add_axes(place, label="scale")
    drawn = figure.colorbar(ScalarMappable(Normalize(0, limit), SCALE), cax=bar, orientation="horizontal")
    ticks = (0, limit / 2, limit)
    drawn.set_ticks(ticks, labels=[f"{tick:g}" for tick in ticks], fontsize=LETTERS)
    drawn.set_label("error (% of\nthe diagonal)", fontsize=LETTERS)
