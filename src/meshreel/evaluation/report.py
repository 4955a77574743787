"""Tables and plots made from rows: rate-distortion curves of every codec on every sequence, and Markdown.

In -> out: JSON rows -> results.md, a part an experiment, and a PNG a sequence. Nothing is typed by hand: what is not in
a row is not shown, but for reference curves, which are named as such.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from ..io.write import replacing
from .curves import SSIM_WITHOUT_KEYS, curve_of, value
from .experiments import Experiment
from .promises import Promise
from .provenance import makers
from .rows import CURVE_KINDS, Row, curve_rows
from .scene_rows import NOISE_FLOOR

METRICS = (
    ("d2_psnr_paper", "D2-PSNR, paper form (dB)"),
    ("symmetric_psnr", "symmetric distance PSNR (dB)"),
    ("normal_error_deg", "normal error (degrees)"),
    ("ssim_masked", "masked SSIM"),
    (SSIM_WITHOUT_KEYS, "masked SSIM without key frames"),
)
FIRST = "targets"  # the experiment of rows that do not name theirs
REFERENCED = ("d2_psnr_paper",)  # what reference curves have

WIDEST = 5  # panels in a row
RATES = (0.1, 0.2, 0.5, 1, 2, 5, 10, 20)  # Mbps, where the plots have ticks


def write_report(rows: Sequence[Row], experiments: Mapping[str, Experiment], folder: Path) -> list[Path]:
    """Writes `results.md` and a plot per experiment and sequence into `folder`; the paths.

    `experiments` are those that the rows may be of, by name, in the order of the page.
    """
    pictures = folder / "results"
    pictures.mkdir(parents=True, exist_ok=True)
    plots, lines = list[Path](), list[str]()
    for name, chosen in experiments.items():
        own = [row for row in rows if row.get("experiment", FIRST) == name]
        if own:
            plots += [
                plot_curves(own, sequence, chosen, pictures / _plot(name, sequence)) for sequence in _sequences(own)
            ]
            lines += [*([""] if lines else []), *_page(own, name, chosen)]
    page = folder / "results.md"
    with replacing(page) as file:
        file.write(("\n".join(lines) + "\n").encode())
    return [page, *plots]


def plot_curves(measured: Sequence[Row], sequence: str, chosen: Experiment, path: Path) -> Path:
    """Quality against rate of every codec on one sequence, one panel a metric; the noise floor is a line.

    An experiment may have METRICS of its own, and `floors`: what the noisy input reaches, by metric.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    rows, references = curve_rows(measured, sequence), chosen.references(sequence)
    floors = chosen.floors([r for r in measured if r["sequence"] == sequence]) if hasattr(chosen, "floors") else {}
    metrics = getattr(chosen, "METRICS", METRICS)
    metrics = [(key, label) for key, label in metrics if any(value(row, key) is not None for row in rows)]
    across = len(metrics) if len(metrics) <= WIDEST else -(-len(metrics) // 2)
    down = -(-len(metrics) // across)
    figure = Figure(figsize=(5 * across, 4.6 * down), layout="constrained")
    FigureCanvasAgg(figure)
    panels = figure.subplots(down, across, squeeze=False).reshape(-1)
    for panel in panels[len(metrics) :]:
        panel.set_axis_off()
    for panel, (key, label) in zip(panels, metrics, strict=False):
        for codec in dict.fromkeys(map(curve_of, rows)):
            own = [(row["mbps"], value(row, key)) for row in rows if curve_of(row) == codec]
            points = sorted(point for point in own if point[1] is not None)
            panel.plot([p[0] for p in points], [p[1] for p in points], marker="o", markersize=4, label=codec)
        for name, curve in references.items() if key in REFERENCED else ():
            panel.plot([p[0] for p in curve], [p[1] for p in curve], "k--", marker="x", label=name)
        if key in floors:
            panel.axhline(floors[key], color="gray", linestyle=":", label=NOISE_FLOOR)
        panel.set(xlabel="Mbps", ylabel=label, xscale="log")
        panel.set_xticks(RATES, [f"{rate:g}" for rate in RATES])
        panel.minorticks_off()
        shown = [rate for line in panel.lines if line.get_label() != NOISE_FLOOR for rate in line.get_xdata()]
        panel.set_xlim(0.7 * min(shown), 1.4 * max(shown))
        panel.grid(alpha=0.3)
    figure.legend(*panels[0].get_legend_handles_labels(), fontsize=9, loc="outside lower center", ncols=4)
    figure.suptitle(sequence)
    with replacing(path) as file:
        figure.savefig(file, format="png", dpi=110)
    return path


def promise_table(promises: Sequence[Promise]) -> list[str]:
    """A Markdown table of targets."""
    lines = ["| target | bound | measured | |", "|---|---|---|---|"]
    return lines + [f"| {p.text} | {p.bound} | {p.value or ''} | {p.verdict} |" for p in promises]


def point_table(rows: Sequence[Row]) -> list[str]:
    """A Markdown table of operating points: rate, every metric, groups, encode and decode times."""
    head = ["codec", "operating point", "Mbps", *(key for key, _ in METRICS), "worst frame dB", "groups"]
    head += ["encode s/frame", "by stage", "decode ms/frame", "/ DracoPy", "decode peak MB"]
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    for row in rows:
        point = ", ".join(f"{k} {v}" for k, v in row["options"].items() if v is not None)
        stages = ", ".join(f"{k} {v:.2g}" for k, v in row.get("encode_stages_s", {}).items())
        decode = row.get("decode", {})
        cells = [row["codec"], point, _number(row["mbps"]), *(_number(value(row, key)) for key, _ in METRICS)]
        cells += [_number(row.get("d2_psnr_paper_worst")), _group_sizes(row), _number(row["encode_s"]), stages]
        times = (decode.get("frame_ms"), row.get("decode_over_peer"), decode.get("peak_rss_mb"))
        lines.append("| " + " | ".join([*cells, *map(_number, times)]) + " |")
    return lines


def _page(rows: Sequence[Row], name: str, chosen: Experiment) -> Iterator[str]:
    yield from (f"# Results of `{name}`", "")
    yield from (f"Made by `meshreel bench run {name} -o ROWS.jsonl` and `meshreel bench report ROWS.jsonl`.", "")
    promises = chosen.promises(rows)
    if promises:
        yield from promise_table(promises)
    for sequence in _sequences(rows):
        own = curve_rows(rows, sequence)
        picture = f"![{sequence}](results/{_plot(name, sequence)})"
        yield from ("", f"## {sequence}, {own[0]['frames']} frames", "", picture, "")
        if len(made := makers(own)) > 1:
            yield from (f"Rows of more than one version: {', '.join(made)}.", "")
        shown = chosen.shown(own)
        yield from (*(point_table(shown) if shown else ()), "", *chosen.comparisons(own))
    yield from chosen.sections(rows)


def _sequences(rows: Sequence[Row]) -> list[str]:
    return list(dict.fromkeys(row["sequence"] for row in rows if row["kind"] in CURVE_KINDS))


def _plot(name: str, sequence: str) -> str:
    return f"{name}-{sequence}.png"


def _group_sizes(row: Row) -> str:
    """Frames of each group, as 5+5; how many where they are many."""
    sizes = [str(group["frames"]) for group in row.get("groups", ())]
    return "+".join(sizes) if len(sizes) < 8 else f"{len(sizes)} groups"


def _number(value: int | float | None) -> str:
    return "" if value is None else f"{value:.4g}"
