"""Tables and plots made from rows: rate-distortion curves of every codec on every sequence, and Markdown.

In -> out: JSON rows -> PNG plots and results.md. Nothing is typed by hand: what is not in a row is not shown.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ..errors import InputError

Row = dict[str, Any]
METRICS = (
    ("d2_psnr_paper", "D2-PSNR, paper form (dB)"),
    ("symmetric_psnr", "symmetric distance PSNR (dB)"),
    ("normal_error_deg", "normal error (degrees)"),
    ("ssim_masked", "masked SSIM"),
)


def read_rows(path: Path) -> list[Row]:
    """The rows of a JSON-lines file. Raises InputError where it is missing or a line is no JSON object."""
    try:
        lines = path.read_text().splitlines()
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}; make it with `meshreel bench run`") from error
    rows = []
    for number, line in enumerate(lines, 1):
        try:
            row = json.loads(line)
        except json.JSONDecodeError as error:
            raise InputError(f"{path}, line {number}: not JSON: {error.msg}") from error
        if not isinstance(row, dict):
            raise InputError(f"{path}, line {number}: not a row")
        rows.append(row)
    return rows


def write_report(rows: Sequence[Row], folder: Path) -> list[Path]:
    """Writes `results.md` and a plot per sequence into `folder`; the paths written."""
    folder.mkdir(parents=True, exist_ok=True)
    names = list(dict.fromkeys(row["sequence"] for row in rows))
    plots = [plot_curves([r for r in rows if r["sequence"] == name], folder / f"{name}.png") for name in names]
    page = folder / "results.md"
    page.write_text("\n".join(_page(rows, names)) + "\n")
    return [page, *plots]


def plot_curves(rows: Sequence[Row], path: Path) -> Path:
    """Quality against rate of every codec in the rows of one sequence, one panel a metric."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, panels = plt.subplots(1, len(METRICS), figsize=(5 * len(METRICS), 4.2), layout="constrained")
    for panel, (key, label) in zip(panels, METRICS, strict=True):
        for codec in dict.fromkeys(row["codec"] for row in rows):
            points = sorted((r["mbps"], r[key]) for r in rows if r["codec"] == codec and r.get(key) is not None)
            panel.plot(*zip(*points, strict=True), marker="o", markersize=4, label=codec)
        panel.set(xlabel="Mbps", ylabel=label, xscale="log")
        panel.grid(alpha=0.3)
    panels[0].legend(fontsize=8)
    figure.suptitle(rows[0]["sequence"])
    figure.savefig(path, dpi=110)
    plt.close(figure)
    return path


def table(rows: Sequence[Row]) -> list[str]:
    """A Markdown table of operating points: rate, every metric, encode and decode times."""
    keys = [key for key, _ in METRICS]
    head = ["codec", "operating point", "Mbps", *keys, "worst frame dB", "encode s/frame", "decode ms/frame"]
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    for row in rows:
        point = ", ".join(f"{k} {v}" for k, v in row["options"].items() if v is not None)
        cells = [row["codec"], point, _number(row["mbps"]), *(_number(row.get(key)) for key in keys)]
        cells += [_number(row.get("d2_psnr_paper_worst")), _number(row["encode_s"]), _number(row["decode"]["frame_ms"])]
        lines.append("| " + " | ".join(cells) + " |")
    return lines


def _page(rows: Sequence[Row], names: Sequence[str]) -> list[str]:
    lines = ["# Results", ""]
    for name in names:
        own = [row for row in rows if row["sequence"] == name]
        lines += [f"## {name}, {own[0]['frames']} frames", "", f"![{name}]({name}.png)", "", *table(own), ""]
    return lines


def _number(value: float | None) -> str:
    return "" if value is None else f"{value:.4g}"
