"""The tables of docs/decisions from measured.jsonl, each between its markers `<!-- table: NAME -->` and `<!-- end -->`.

python benchmarks/tables.py        # after benchmarks/decisions.py
"""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

PAGES = Path(__file__).resolve().parents[1] / "docs" / "decisions"
MARKED = re.compile(r"(<!-- table: ([\w ]+) -->\n).*?(<!-- end -->)", re.DOTALL)
Row = dict[str, Any]
Table = tuple[list[str], list[list[str]]]  # heads, those of numbers with a leading ">"; and cells


def main() -> int:
    """Rewrites the pages that hold a table."""
    lines = (PAGES / "measured.jsonl").read_text(encoding="utf-8").splitlines()
    rows = [json.loads(line) for line in lines]
    for page in sorted(PAGES.glob("0*.md")):
        old = page.read_text(encoding="utf-8")
        new = MARKED.sub(lambda at: _filled(at, rows), old)
        if new != old:
            page.write_text(new, encoding="utf-8")
            print(page)
    return 0


def noise(rows: list[Row]) -> Table:
    """The variance that each way of rounding leaves."""
    heads = ["rounding", "> anchors", "> weight", "> variance, step² / 12"]
    return heads, [[r["rounding"], r["anchors"], r["anchor_weight"], _rough(r["variance"])] for r in rows]


def anchors(rows: list[Row]) -> Table:
    """Bytes and error, a row a step and a column a way of rounding."""
    ways, steps = _distinct(rows, "rounding"), _distinct(rows, "step")
    found = {(r["step"], r["rounding"]): f"{r['bytes']} / {_thousandths(r['rms'])}" for r in rows}
    cells = [[_thousandths(step, 3), *(found[step, way] for way in ways)] for step in steps]
    return ["> step x 1000", *(f"> {way}" for way in ways)], cells


def floor(rows: list[Row]) -> Table:
    """Bytes of both forms."""
    heads = ["> `laplacian`, bytes", "> `draco`, bytes", "> RMS x 1000", "> normal error, degrees"]
    return heads, [
        [r["laplacian_bytes"], r["draco_bytes"] or "none found", _thousandths(r["rms"]), f"{r['normal_error_deg']:.2f}"]
        for r in rows
    ]


def pose(rows: list[Row]) -> Table:
    """What is left in each pose."""
    heads = ["pose", "> key", "> mean over the frames", "> worst frame", ""]
    return heads, [
        [r["pose"], r["key"], _thousandths(r["mean_rms"]), _thousandths(r["worst_rms"]), "chosen" * r["chosen"]]
        for r in rows
    ]


def second_fit(rows: list[Row]) -> Table:
    """A row a fit and a number of components that are sent."""
    heads = ["> components sent", "> second fit from", "> bytes", "> RMS x 1000", "> normal error, degrees"]
    ordered = sorted(rows, key=lambda r: (r["basis_size"] or 999, r["start"]))
    return heads, [
        [
            r["basis_size"] or f"as many as pay: {r['components']}",
            r["start"] or "no second fit",
            r["bytes"],
            _thousandths(r["rms"]),
            f"{r['normal_error_deg']:.2f}",
        ]
        for r in ordered
    ]


def correspondence(rows: list[Row]) -> Table:
    """Two rows a case: what each way leaves before and after the same fit, what its motion costs, and its time."""
    heads = ["frames", "way", "> RMS before x 1000", "> after", "> worst frame", "> d2, dB", "> worst frame, dB"]
    heads += ["> normals, degrees", "> bits, plain", "> bits, predicted", "> CPU s a frame"]
    return heads, [
        [
            r["case"],
            r["way"],
            *(_thousandths(r[k]) for k in ("before_rms", "after_rms", "after_worst_rms")),
            *(f"{r[k]:.2f}" for k in ("d2_psnr_paper", "worst_d2_psnr_paper", "after_normal_error_deg")),
            *(f"{r[k]:.1f}" for k in ("bits_plain", "bits_predicted", "cpu_s_per_frame")),
        ]
        for r in rows
    ]


def template(rows: list[Row]) -> Table:
    """A row a template or a choice of the coder; rate and quality at each step."""
    steps = _distinct(rows, "step")
    found = {(r["template"], r["choice"], r["step"]): r for r in rows}
    names = list(dict.fromkeys((r["template"], r["choice"]) for r in rows))
    heads = ["template", "choice", *(f"> step {100 * step:.2f} %: Mbps, symmetric dB, normals" for step in steps)]
    told = [[found[(*name, step)] for step in steps] for name in names]
    said = "{mbps:.3f}, {symmetric_psnr:.1f}, {normal_error_deg:.2f}"
    cells = [[said.format(**row) for row in line] for line in told]
    return heads, [[*name, *line] for name, line in zip(names, cells, strict=True)]


def tails(rows: list[Row]) -> Table:
    """A row a clip, quality and way: rate, and every metric."""
    heads = ["frames", "> quality", "tails", "> Mbps", "> d2 (paper), dB", "> symmetric, dB", "> worst frame, dB"]
    heads += ["> normals, degrees", "> SSIM", "> CPU s a frame"]
    names = ("d2_psnr_paper", "symmetric_psnr", "worst_symmetric_psnr", "normal_error_deg")
    return heads, [
        [
            r["case"],
            f"{r['quality']:g}",
            r["way"],
            "" if r["mbps"] is None else f"{r['mbps']:.4f}",
            *(f"{r[name]:.2f}" for name in names),
            f"{r['ssim_masked']:.4f}",
            f"{r['cpu_s_per_frame']:.2f}" if r.get("cpu_s_per_frame", 0) > 0.005 else "",
        ]
        for r in rows
    ]


def fused(rows: list[Row]) -> Table:
    """A row a body and way; the rates that it needs beside the anchors last."""
    heads = ["body", "way", "> Mbps", "> to the truth: median, mm", "> normals, degrees", "> SSIM", "> RMS, mm"]
    heads += ["> from the truth: RMS, mm", "> to the input: d2, dB", "> SSIM", "> CPU s a frame"]
    names = ("median_mm", "angle_deg", "ssim", "rms_mm", "coverage_mm", "d2_noisy", "ssim_noisy")
    digits = dict.fromkeys(names, 2) | {"ssim": 3, "ssim_noisy": 3, "angle_deg": 1, "coverage_mm": 1}
    told = [
        [
            r["body"],
            r["way"],
            "" if r["mbps"] is None else f"{r['mbps']:.3f}",
            *("" if r["mbps"] is None and name.endswith("noisy") else f"{r[name]:.{digits[name]}f}" for name in names),
            f"{r['cpu_s_per_frame']:.1f}" if r["way"].startswith("quality") else "",
        ]
        for r in rows
        if "note" not in r
    ]
    return heads, told + [[r["body"], r["way"] + ": " + r["note"], *[""] * 9] for r in rows if "note" in r]


def backgrounds(rows: list[Row]) -> Table:
    """A row a kind of background, against the truth."""
    heads = ["", "> median, mm", "> within 20 mm, %", "> D2, dB", "> normals, degrees", "> CPU s"]
    return heads, [
        [
            r["kind"],
            f"{1000 * r['median_m']:.2f}",
            f"{100 * r['covered']:.2f}",
            f"{r['d2_psnr_backward']:.1f}",
            f"{r['normal_error_deg']:.1f}",
            f"{r['cpu_s']:.0f}",
        ]
        for r in rows
    ]


TABLES: dict[str, Callable[[list[Row]], Table]] = {
    "noise": noise,
    "anchors": anchors,
    "floor": floor,
    "pose": pose,
    "second fit": second_fit,
    "correspondence": correspondence,
    "template": template,
    "tails": tails,
    "fused": fused,
    "backgrounds": backgrounds,
}


def _filled(at: re.Match[str], rows: list[Row]) -> str:
    heads, cells = TABLES[at[2]]([row for row in rows if row["decision"] == at[2]])
    lines = [[head.removeprefix("> ") for head in heads], ["---:" if head[:1] == ">" else "---" for head in heads]]
    return at[1] + "".join(f"| {' | '.join(map(str, line))} |\n" for line in lines + cells) + at[3]


def _distinct(rows: list[Row], name: str) -> list[Any]:
    return list(dict.fromkeys(row[name] for row in rows))


def _thousandths(value: float, digits: int = 2) -> str:
    return f"{1000 * value:.{digits}f}"


def _rough(value: float) -> str:
    """Two digits that count."""
    return f"{float(f'{value:.2g}'):g}"


if __name__ == "__main__":
    sys.exit(main())
