"""Tables and plots made from rows: rate-distortion curves of every codec on every sequence, and Markdown.

In -> out: JSON rows -> results.md and a PNG a sequence. Nothing is typed by hand: what is not in a row is not shown,
but for reference curves, which are named as such.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from types import ModuleType

from ..io.write import replacing
from ..metrics.bd_rate import Curve, bd_rate
from .promises import Promise
from .rows import Row, select

METRICS = (
    ("d2_psnr_paper", "D2-PSNR, paper form (dB)"),
    ("symmetric_psnr", "symmetric distance PSNR (dB)"),
    ("normal_error_deg", "normal error (degrees)"),
    ("ssim_masked", "masked SSIM"),
)
ANCHOR = "decimated_draco_subdivided"
REFERENCED = ("d2_psnr_paper",)  # what reference curves have

RATES = (0.1, 0.2, 0.5, 1, 2, 5, 10, 20)  # Mbps, where the plots have ticks


def write_report(rows: Sequence[Row], chosen: ModuleType, folder: Path) -> list[Path]:
    """Writes `results.md` and a plot per sequence into `folder`, as the experiment `chosen` judges; the paths."""
    pictures = folder / "results"
    pictures.mkdir(parents=True, exist_ok=True)
    names = list(dict.fromkeys(row["sequence"] for row in rows if row["kind"] == "quality"))
    plots = [plot_curves(select(rows, n), chosen.references(n), pictures / f"{n}.png") for n in names]
    page = folder / "results.md"
    with replacing(page) as file:
        file.write(("\n".join(_page(rows, names, chosen)) + "\n").encode())
    return [page, *plots]


def plot_curves(rows: Sequence[Row], references: dict[str, list[tuple[float, float]]], path: Path) -> Path:
    """Quality against rate of every codec in the rows of one sequence, one panel a metric."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    metrics = [(key, label) for key, label in METRICS if any(row.get(key) is not None for row in rows)]
    figure = Figure(figsize=(5 * len(metrics), 4.6), layout="constrained")
    FigureCanvasAgg(figure)
    panels = figure.subplots(1, len(metrics), squeeze=False)[0]
    for panel, (key, label) in zip(panels, metrics, strict=True):
        for codec in dict.fromkeys(map(curve_of, rows)):
            points = sorted((r["mbps"], r[key]) for r in rows if curve_of(r) == codec and r.get(key) is not None)
            panel.plot([p[0] for p in points], [p[1] for p in points], marker="o", markersize=4, label=codec)
        for name, curve in references.items() if key in REFERENCED else ():
            panel.plot([p[0] for p in curve], [p[1] for p in curve], "k--", marker="x", label=name)
        panel.set(xlabel="Mbps", ylabel=label, xscale="log")
        panel.set_xticks(RATES, [f"{rate:g}" for rate in RATES])
        panel.minorticks_off()
        shown = [rate for line in panel.lines for rate in line.get_xdata()]
        panel.set_xlim(0.7 * min(shown), 1.4 * max(shown))
        panel.grid(alpha=0.3)
    figure.legend(*panels[0].get_legend_handles_labels(), fontsize=9, loc="outside lower center", ncols=4)
    figure.suptitle(rows[0]["sequence"])
    with replacing(path) as file:
        figure.savefig(file, format="png", dpi=110)
    return path


def curve_of(row: Row) -> str:
    """The curve that a point belongs to: a codec, and where the basis is fixed, the quality of the rest."""
    options = row["options"]
    return row["codec"] if options.get("basis_size") is None else f"{row['codec']}, quality {options['quality']:g}"


def promise_table(promises: Sequence[Promise]) -> list[str]:
    """A Markdown table of targets."""
    lines = ["| target | bound | measured | |", "|---|---|---|---|"]
    return lines + [f"| {p.text} | {p.bound} | {p.value or ''} | {p.verdict} |" for p in promises]


def point_table(rows: Sequence[Row]) -> list[str]:
    """A Markdown table of operating points: rate, every metric, encode and decode times."""
    keys = [key for key, _ in METRICS]
    head = [
        "codec",
        "operating point",
        "Mbps",
        *keys,
        "worst frame dB",
        "encode s/frame",
        "by stage",
        "decode ms/frame",
    ]
    head += ["/ DracoPy", "decode peak MB"]
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    for row in rows:
        point = ", ".join(f"{k} {v}" for k, v in row["options"].items() if v is not None)
        stages = ", ".join(f"{k} {v:.2g}" for k, v in row["encode_stages_s"].items())
        cells = [row["codec"], point, _number(row["mbps"]), *(_number(row.get(key)) for key in keys)]
        cells += [_number(row.get("d2_psnr_paper_worst")), _number(row["encode_s"]), stages]
        decode = row["decode"]
        cells += [_number(v) for v in (decode["frame_ms"], row["decode_over_peer"], decode["peak_rss_mb"])]
        lines.append("| " + " | ".join(cells) + " |")
    return lines


def bd_lines(rows: Sequence[Row]) -> Iterator[str]:
    """BD-rate of every codec against the subdivided anchor, by D2-PSNR and by normal error."""
    for key, sign in (("d2_psnr_paper", 1), ("symmetric_psnr", 1), ("normal_error_deg", -1)):
        curves = {codec: _curve(rows, codec, key, sign) for codec in dict.fromkeys(map(curve_of, rows))}
        if ANCHOR in curves:
            for codec, curve in curves.items():
                if codec != ANCHOR:
                    yield f"- BD-rate by `{key}`: {bd_rate(curves[ANCHOR], curve)}"


def _curve(rows: Sequence[Row], codec: str, key: str, sign: int) -> Curve:
    points = [(r["mbps"], sign * r[key]) for r in rows if curve_of(r) == codec and r.get(key) is not None]
    return Curve(codec, [p[0] for p in points], [p[1] for p in points])


def _page(rows: Sequence[Row], names: Sequence[str], chosen: ModuleType) -> Iterator[str]:
    name = chosen.__name__.rsplit(".", 1)[-1]
    yield from (f"# Results of `{name}`", "")
    yield from (f"Made by `meshreel bench run {name} -o ROWS.jsonl` and `meshreel bench report ROWS.jsonl`.", "")
    yield from promise_table(chosen.promises(rows))
    for sequence in names:
        own = select(rows, sequence)
        yield from ("", f"## {sequence}, {own[0]['frames']} frames", "", f"![{sequence}](results/{sequence}.png)", "")
        yield from (*point_table(own), "", *bd_lines(own))
        for curve, points in chosen.references(sequence).items():
            told = "; ".join(f"{mbps:g} Mbps {psnr:g} dB" for mbps, psnr in points)
            yield f"- Reference, not run here: {curve}: {told} (D2-PSNR, paper form)"


def _number(value: int | float | None) -> str:
    return "" if value is None else f"{value:.4g}"
