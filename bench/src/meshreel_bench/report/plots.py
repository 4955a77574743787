"""Rate-distortion plots, as PNG and SVG, 17 cm wide: the width of a page of a paper.

In -> out: rows of one experiment -> two files a sequence, a panel a metric. Same rows, same bytes, whatever settings
of matplotlib the user has.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

from meshreel.io.write import replacing

from ..curves import SSIM_WITHOUT_KEYS, curve_of, value
from ..experiment import Experiment
from ..names import BEST, title
from ..rows import Row, curve_rows
from ..scene_rows import NOISE_FLOOR
from .looks import Look, direction

METRICS = (
    ("d2_psnr_paper", "D2-PSNR, paper form (dB)"),
    ("symmetric_psnr", "symmetric distance PSNR (dB)"),
    ("normal_error_deg", "normal error (degrees)"),
    ("ssim_masked", "masked SSIM"),
    (SSIM_WITHOUT_KEYS, "masked SSIM without key frames"),
)
REFERENCED = ("d2_psnr_paper",)  # what reference curves have

WIDTH = 17 / 2.54  # inches
DPI = 200  # of the PNG
WIDEST = 3  # panels in a row
_HEIGHT = 2.15  # inches, of a row of panels
_LETTER = 0.052  # inches, of the legend's, at most on average
_LINE = 0.155  # inches, of the legend, from one to the next
_SAMPLE = 0.42  # inches, of the piece of line before a name, with the gaps around it
_SETTINGS: dict[Any, Any] = {
    "font.family": "DejaVu Sans",  # comes with matplotlib
    "font.size": 7.0,
    "axes.linewidth": 0.6,
    "axes.titlesize": 7.0,
    "axes.labelsize": 7.0,
    "legend.fontsize": 7.0,
    "xtick.labelsize": 6.5,
    "ytick.labelsize": 6.5,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "grid.linewidth": 0.5,
    "grid.alpha": 0.3,
    "svg.hashsalt": "meshreel",  # else ids differ from run to run
    "svg.fonttype": "path",
    "text.parse_math": False,  # a name may have dollars
}
_TOLD = {1: "↑ higher is better", -1: "↓ lower is better", 0: ""}


@dataclass(frozen=True, slots=True)
class Legend:
    """Names beside what they look like; lines of one name are one."""

    lines: Mapping[str, Any]

    def columns(self, inches: float) -> int:
        """How many fit side by side."""
        return max(1, min(len(self.lines), int(inches / self._widest)))

    def fits(self, wide: float, high: float) -> bool:
        """Whether all of it, one below the other, needs no more than so many inches."""
        return self._widest <= wide and _LINE * len(self.lines) <= high

    @property
    def _widest(self) -> float:
        return _SAMPLE + _LETTER * max(map(len, self.lines), default=0)


def plot_curves(measured: Sequence[Row], chosen: Experiment, looks: Mapping[str, Look], path: Path) -> list[Path]:
    """Quality against rate of every codec, one panel a metric, as `path`, a PNG, and its SVG twin; the paths.

    `measured` are rows of one sequence. An experiment may have METRICS of its own, and `floors`: where by metric a line
    is drawn, which FLOOR_NAME names, or the noise floor. `looks` has every curve.
    """
    with matplotlib_settings():
        figure = curves_figure(measured, chosen, looks)
        return [write_figure(figure, path.with_suffix(kind)) for kind in (".png", ".svg")]


def curves_figure(measured: Sequence[Row], chosen: Experiment, looks: Mapping[str, Look]) -> Any:
    """The figure of `plot_curves`, within `matplotlib_settings`."""
    sequence = str(measured[0]["sequence"])
    rows, references = curve_rows(measured, sequence), chosen.references(sequence)
    floors = chosen.floors(measured) if hasattr(chosen, "floors") else {}
    metrics = [each for each in getattr(chosen, "METRICS", METRICS) if any(value(r, each[0]) is not None for r in rows)]
    across = {1: 1, 2: 2, 4: 2}.get(len(metrics), WIDEST)
    down = max(1, -(-len(metrics) // across))
    figure, panels = _panels(down, across)
    figure.suptitle(f"{sequence}, {measured[0]['frames']} frames", fontsize=8, fontweight="bold")
    rates = [row["mbps"] for row in rows]
    for panel, (key, label) in zip(panels, metrics, strict=False):
        _draw_curves(panel, rows, key, looks)
        for name, curve in references.items() if key in REFERENCED else ():
            panel.plot([p[0] for p in curve], [p[1] for p in curve], "k--", marker="x", lw=1, ms=4, label=_shown(name))
            rates += [p[0] for p in curve]
        if key in floors:
            panel.axhline(
                floors[key], color="gray", linestyle=":", lw=1.2, label=getattr(chosen, "FLOOR_NAME", NOISE_FLOOR)
            )
        panel.set(xlabel="rate (Mbps)", ylabel=label, xscale="log")
        panel.set_title(_TOLD[direction(key)], loc="right", color="dimgray", fontsize=6.5, pad=3)
        panel.grid()
    for panel in panels[: len(metrics)]:
        set_rates(panel, rates)
    _add_legend(figure, panels, len(metrics), down)
    return figure


def set_rates(panel: Any, rates: Sequence[float]) -> None:
    """Limits a little beyond the rates, and ticks at 1, 2 and 5 of each decade: fewer or more where these are many or
    few."""
    low, high = 0.75 * min(rates), 1.35 * max(rates)
    panel.set_xlim(low, high)
    decades = 10.0 ** np.arange(np.floor(np.log10(low)), np.ceil(np.log10(high)) + 1)
    ticks: list[float] = []
    for steps in ((1, 1.5, 2, 3, 4, 5, 6, 8), (1, 2, 5), (1, 3), (1,)):
        found = [float(f"{step * decade:.3g}") for decade in decades for step in steps]
        ticks = [tick for tick in found if low <= tick <= high]
        if len(ticks) <= 8:
            break
    panel.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
    panel.minorticks_off()


@contextmanager
def matplotlib_settings() -> Iterator[None]:
    """Matplotlib as it comes, with the letters and lines of a paper."""
    import matplotlib

    with matplotlib.rc_context():
        matplotlib.rcdefaults()
        matplotlib.rcParams.update(_SETTINGS)
        yield


def new_figure(wide: float, high: float, layout: Literal["constrained"] | None = "constrained") -> Any:
    """An empty figure of so many inches, drawn without a display."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(wide, high), layout=layout, facecolor="white")
    FigureCanvasAgg(figure)
    return figure


def write_figure(figure: Any, path: Path, dpi: int = DPI) -> Path:
    """The figure as .png or .svg, without dates or versions in it."""
    kind = path.suffix[1:]
    nothing = ("Software",) if kind == "png" else ("Date", "Creator", "Format", "Type")
    with replacing(path) as file:
        figure.savefig(file, format=kind, dpi=dpi, metadata=dict.fromkeys(nothing))
    return path


def _panels(down: int, across: int) -> tuple[Any, Any]:
    figure = new_figure(WIDTH, _HEIGHT * down + 0.6)
    return figure, figure.subplots(down, across, squeeze=False).reshape(-1)


def _draw_curves(panel: Any, rows: Sequence[Row], key: str, looks: Mapping[str, Look]) -> None:
    """The first look is drawn last, over the others."""
    for place, (name, look) in enumerate(looks.items()):
        own = [(row["mbps"], value(row, key)) for row in rows if curve_of(row) == name]
        points = sorted((mbps, quality) for mbps, quality in own if quality is not None)
        if points:
            panel.plot(
                *zip(*points, strict=True),
                color=look.color,
                marker=look.marker,
                lw=look.width,
                ms=look.size,
                label=_shown(name),
                zorder=3 - place / len(looks),
            )


def _add_legend(figure: Any, panels: Any, used: int, down: int) -> None:
    """In the empty panels where it fits, else below all."""
    found = [panel.get_legend_handles_labels() for panel in panels[:used]]
    legend = Legend({name: line for lines, names in found for line, name in zip(lines, names, strict=True)})
    for panel in panels[used:]:
        panel.set_axis_off()
    shown = list(legend.lines.values()), list(legend.lines)
    free = len(panels) - used
    if free and legend.fits(free * WIDTH / WIDEST - 0.1 * free, _HEIGHT - 0.5):
        drawn = panels[used].legend(*shown, loc="center" if free == 1 else "center left", frameon=False)
        drawn.set_in_layout(False)  # it may reach into the next empty panel
    else:
        columns = legend.columns(WIDTH)
        lines = -(-len(legend.lines) // columns)
        figure.set_size_inches(WIDTH, _HEIGHT * down + 0.3 + _LINE * lines)
        drawn = figure.legend(*shown, loc="outside lower center", ncols=columns, frameon=False)
    for text in drawn.get_texts():
        if text.get_text() == title(BEST):
            text.set_fontweight("bold")


def _shown(name: str) -> str:
    """A curve's title as a label: matplotlib leaves those out that begin with an underscore."""
    label = title(name)
    return f" {label}" if label.startswith("_") else label
