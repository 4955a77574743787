"""Rate-distortion plots as PNG, 17 cm wide as a page: same rows, same picture, whatever the user's settings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from meshreel.io.write import replacing

from ..experiments.study import Measure
from ..names import BEST, Look, title
from ..rows import Row
from .values import curve_of, floors, rated, value

Axis = tuple[str, str]  # a value, and what it is
RATE: Axis = ("mbps", "rate (Mbps)")
Looks = Mapping[str, Look]
WIDTH = 17 / 2.54  # inches
DPI = 130
LONG = 24  # letters of a sequence's title that have room beside another (guess)
_HEIGHT = 2.3  # inches, of a line of panels
_LINE = 0.155  # inches, of the legend, from one to the next
WIDE = 34  # letters of a curve's title of which three do not fit a line (guess)
WIDER = 52  # of which two do not fit (guess)
_SETTINGS: dict[Any, Any] = {
    **dict.fromkeys(("font.size", "axes.titlesize", "axes.labelsize", "legend.fontsize"), 7.0),
    "xtick.labelsize": 6.5,
    "ytick.labelsize": 6.5,
    "axes.linewidth": 0.6,
    "font.family": "DejaVu Sans",  # comes with matplotlib
    "text.parse_math": False,  # a name may have dollars
}
_BETTER = {1: "↑ higher is better", -1: "↓ lower is better"}


def plot_curves(rows: Sequence[Row], measures: Sequence[Measure], looks: Looks, path: Path, x: Axis = RATE) -> Path:
    """Write quality against `x` of each curve; a dotted line is what the truth reaches."""
    import matplotlib

    with matplotlib.rc_context():
        matplotlib.rcdefaults()
        matplotlib.rcParams.update(_SETTINGS)
        figure = curves_figure(rows, measures, looks, x)
        with replacing(path) as file:
            figure.savefig(file, format="png", dpi=DPI, metadata={"Software": None})
    return path


def drawable(rows: Sequence[Row], measures: Sequence[Measure]) -> bool:
    """Return whether rows have anything that `plot_curves` draws."""
    return any(value(row, measure.key) is not None for row in rated(rows) for measure in measures)


def curves_figure(rows: Sequence[Row], measures: Sequence[Measure], looks: Looks, x: Axis = RATE) -> Any:
    """Return the figure of `plot_curves`."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    shown = [row for row in rated(rows) if any(value(row, measure.key) is not None for measure in measures)]
    sequences = list(dict.fromkeys(row.point.sequence for row in shown))
    names = {curve_of(row) for row in shown}
    longest = max(len(title(name)) for name in names)
    columns = 3 if longest <= WIDE else 2 if longest <= WIDER else 1
    legend_lines = -(-len(names) // columns)
    size = (WIDTH, _HEIGHT * len(sequences) + 0.3 + _LINE * legend_lines)
    figure = Figure(figsize=size, layout="constrained", facecolor="white")
    FigureCanvasAgg(figure)
    lines = figure.subplots(len(sequences), len(measures), squeeze=False)
    for panels, sequence in zip(lines, sequences, strict=True):
        own = [row for row in rows if row.point.sequence == sequence]
        for panel, measure in zip(panels, measures, strict=True):
            _draw(panel, own, measure, looks, x)
        name = f"{sequence}, {rated(own)[0].frames} frames"
        name += "\n" * (len(name) > LONG)  # over what stands at the right
        panels[0].set_title(name, loc="left", fontweight="bold")
    known = [panel.get_legend_handles_labels() for panel in lines.flat]
    handles = {name: line for drawn, labels in known for line, name in zip(drawn, labels, strict=True)}
    legend = figure.legend([*handles.values()], [*handles], loc="outside lower center", ncols=columns, frameon=False)
    for label in legend.get_texts():
        if label.get_text() == title(BEST):
            label.set_fontweight("bold")
    return figure


def _draw(panel: Any, rows: Sequence[Row], measure: Measure, looks: Looks, x: Axis) -> None:
    """Draw one panel: the first look last, over the others."""
    own, rates = rated(rows), [value(row, x[0]) or row.mbps for row in rated(rows)]
    for place, (name, look) in enumerate(looks.items()):
        pairs = zip(rates, own, strict=True)
        found = [(mbps, value(row, measure.key)) for mbps, row in pairs if curve_of(row) == name]
        points = sorted((mbps, quality) for mbps, quality in found if quality is not None)
        if points:
            style: dict[str, Any] = {"color": look.color, "marker": look.marker, "lw": look.width, "ms": look.size}
            label = title(name)
            label = f" {label}" if label.startswith("_") else label  # matplotlib leaves those out
            panel.plot(*zip(*points, strict=True), **style, label=label, zorder=3 - place / len(looks))
    if (floor := floors(rows).get(measure.key)) is not None:
        panel.axhline(floor, color="gray", linestyle=":", lw=1.2, label="the truth itself")
    panel.set(xlabel=x[1], ylabel=measure.label, xscale="log")
    panel.set_title(_BETTER[measure.sign], loc="right", color="dimgray", fontsize=6.5, pad=3)
    panel.grid()
    set_rates(panel, rates)


def set_rates(panel: Any, rates: Sequence[float]) -> None:
    """Set limits a little beyond the rates, and ticks at round numbers: eight at most."""
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
