"""Tables of docs/decisions, each made from rows between its markers `<!-- table: NAME -->` and `<!-- end -->`."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

MARKED = re.compile(r"(<!-- table: (\w+) -->\n).*?(<!-- end -->)", re.DOTALL)
Row = dict[str, Any]  # that docs/decisions rests on: a line of JSON each
Cell = str | Callable[[Row], str]  # a format string, or a function of the row
Columns = dict[str, Cell]  # cells by head; heads of numbers begin with ">"
Table = tuple[list[str], list[list[str]]]  # heads and lines


def write_tables(pages: Path) -> Iterator[Path]:
    """Rewrite the pages whose tables differ from the rows; yield each of them."""
    rows = read(pages / "measured.jsonl")
    for page in sorted(pages.glob("0*.md")):
        old = page.read_text(encoding="utf-8")
        new = MARKED.sub(lambda at: at[1] + table(at[2], rows) + at[3], old)
        if new != old:
            page.write_text(new, encoding="utf-8")
            yield page


def read(file: Path) -> list[Row]:
    """Return all rows of a file."""
    return [json.loads(line) for line in file.read_text(encoding="utf-8").splitlines()]


def table(name: str, rows: Sequence[Row]) -> str:
    """Return a table in Markdown, made of the rows of its decision."""
    own = [row for row in rows if row["decision"] == name]
    heads, lines = PIVOTS[name](own) if name in PIVOTS else _plain(COLUMNS[name], own)
    rules = ["---:" if head[:1] == ">" else "---" for head in heads]
    shown = [[head.removeprefix("> ") for head in heads], rules, *lines]
    return "".join(f"| {' | '.join(line)} |\n" for line in shown)


def thousandths(key: str) -> Cell:
    """Return the cell of a value times 1000."""
    return lambda row: f"{1000 * row[key]:.2f}"


def optional(key: str, form: str) -> Cell:
    """Return the cell of a value that a row may lack."""
    return lambda row: "" if row.get(key) is None else format(row[key], form)


COLUMNS: dict[str, Columns] = {
    "noise": {
        "rounding": "{rounding}",
        "> anchors": "{anchors}",
        "> weight": "{anchor_weight}",
        "> variance, step² / 12": lambda row: f"{float(format(row['variance'], '.2g')):g}",  # two digits that count
    },
    "floor": {
        "> `laplacian`, bytes": "{laplacian_bytes}",
        "> `draco`, bytes": lambda row: str(row["draco_bytes"] or "none found"),
        "> RMS x 1000": thousandths("rms"),
        "> normal error, degrees": "{normal_error_deg:.2f}",
    },
    "pose": {
        "pose": "{pose}",
        "> key": "{key}",
        "> mean over the frames": thousandths("mean_rms"),
        "> worst frame": thousandths("worst_rms"),
        "": lambda row: "chosen" * row["chosen"],
    },
    "second_fit": {
        "> components sent": lambda row: str(row["basis_size"] or f"as many as pay: {row['components']}"),
        "> second fit from": lambda row: str(row["start"] or "no second fit"),
        "> bytes": "{bytes}",
        "> RMS x 1000": thousandths("rms"),
        "> normal error, degrees": "{normal_error_deg:.2f}",
    },
    "correspondence": {
        "frames": "{case}",
        "way": "{way}",
        "> RMS before x 1000": thousandths("before_rms"),
        "> after": thousandths("after_rms"),
        "> worst frame": thousandths("after_worst_rms"),
        "> d2, dB": "{d2_psnr_paper:.2f}",
        "> worst frame, dB": "{worst_d2_psnr_paper:.2f}",
        "> normals, degrees": "{after_normal_error_deg:.2f}",
        "> bits, plain": "{bits_plain:.1f}",
        "> bits, predicted": "{bits_predicted:.1f}",
        "> CPU s a frame": "{cpu_s_per_frame:.1f}",
    },
    "tails": {
        "frames": "{case}",
        "> quality": "{quality:g}",
        "tails": "{way}",
        "> Mbps": optional("mbps", ".4f"),
        "> d2 (paper), dB": "{d2_psnr_paper:.2f}",
        "> symmetric, dB": "{symmetric_psnr:.2f}",
        "> worst frame, dB": "{worst_symmetric_psnr:.2f}",
        "> normals, degrees": "{normal_error_deg:.2f}",
        "> SSIM": "{ssim_masked:.4f}",
        "> CPU s a frame": lambda row: f"{cost:.2f}" if (cost := row.get("cpu_s_per_frame", 0)) > 0.005 else "",
    },
    "fused": {
        "body": "{body}",
        "way": "{way}",
        "> Mbps": optional("mbps", ".3f"),
        "> to the truth: median, mm": "{median_mm:.2f}",
        "> normals, degrees": "{angle_deg:.1f}",
        "> SSIM": "{ssim:.3f}",
        "> RMS, mm": "{rms_mm:.2f}",
        "> from the truth: RMS, mm": "{coverage_mm:.1f}",
        "> to the input: d2, dB": lambda row: "" if row["mbps"] is None else f"{row['d2_noisy']:.2f}",
        "> SSIM ": lambda row: "" if row["mbps"] is None else f"{row['ssim_noisy']:.3f}",
        "> CPU s a frame": lambda row: f"{row['cpu_s_per_frame']:.1f}" if row["way"].startswith("quality") else "",
    },
    "views": {
        "> views": "{views}",
        "> pixels": "{width} x {height}",
        "> faces": "{faces:.1%}",
        "> area": "{area:.1%}",
        "> in sight": "{in_sight:.1%}",
    },
    "backgrounds": {
        "": "{kind}",
        "> median, mm": thousandths("median_m"),
        "> within 20 mm, %": lambda row: f"{100 * row['covered']:.2f}",
        "> D2, dB": "{d2_psnr_backward:.1f}",
        "> normals, degrees": "{normal_error_deg:.1f}",
        "> CPU s": "{cpu_s:.0f}",
    },
    "still_normals": {
        "frames": "{case}",
        "normals": "{way}",
        "> bytes": optional("bytes", "d"),
        "> normals, degrees": "{normal_error_deg:.2f}",
        "> rate at equal normals": optional("equal", "+.0%"),
    },
    "pcqm": {
        "three frames of a person": "{way}",
        "> Mbps": optional("mbps", ".2f"),
        "> YUV 6:1:1, dB": optional("yuv_psnr", ".1f"),
        "> SSIM in colour": optional("view_ssim", ".3f"),
        "> PCQM x 1000": thousandths("pcqm"),
    },
    "four": {
        "system": "{system}",
        "operating point": "{point}",
        "> Mbps": "{mbps:.3f}",
        "> D2 (paper), dB": "{d2_psnr_paper:.2f}",
        "> masked SSIM": "{ssim_masked:.3f}",
        "> normals, degrees": "{normal_error_deg:.2f}",
        "> decode, ms a frame": "{decode_ms:.1f}",
    },
    "eyes": {
        "weights": "{way}",
        "> bodies": "{bodies}",
        "> quality": "{quality}",
        "> bytes at this quality": "{bytes:+.1%}",
        "> d2 (paper), dB": "{d2_psnr_paper:+.2f}",
        "> symmetric, dB": "{symmetric_psnr:+.2f}",
        "> normals, degrees": "{normal_error_deg:+.3f}",
        "> masked SSIM": "{ssim_masked:+.4f}",
        "> weighed distance, dB": "{weighed_psnr:+.2f}",
        "> weighed normals, degrees": "{weighed_normals_deg:+.3f}",
    },
    "eyes_rate": {
        "frames": "{case}",
        "weights": "{way}",
        "> d2 (paper)": "{d2_psnr_paper:+.1f} %",
        "> symmetric": "{symmetric_psnr:+.1f} %",
        "> normals": "{normal_error_deg:+.1f} %",
        "> masked SSIM": "{ssim_masked:+.1f} %",
    },
    "eyes_heads": {
        "heads of": "{case}",
        "weights": "{way}",
        "> bytes of the file": "{bytes}",
        "> masked SSIM": "{ssim_masked:.3f}",
    },
    "points": {
        "points": "{case}",
        "> voxel, mm": thousandths("voxel_m"),
        "> from the truth, mm RMS": thousandths("rms_forward_m"),
        "> the truth from it, mm RMS": thousandths("rms_backward_m"),
        "> faces that face the right way, %": lambda row: f"{100 * row['right_side']:.2f}",
        "> CPU s": optional("cpu_s", ".2f"),
    },
    "walks": {
        "recording": "{case}",
        "> surfaces apart as recorded, mm": optional("before_mm", ".1f"),
        "> refined, mm": optional("after_mm", ".1f"),
        "> people, median mm": optional("people_median_mm", ".1f"),
        "> people covered, %": optional("people_covered", ".1%"),
        "> room, median mm": optional("background_median_mm", ".1f"),
        "> depth covered, %": "{all_covered:.2%}",
        "> invented, %": "{all_invented:.3%}",
        "> bytes": "{bytes:,}",
    },
    "detail": {
        "frames": "{case}",
        "way": "{way}",
        "> bytes": "{bytes}",
        "> d2 (paper), dB": "{d2_psnr_paper:.2f}",
        "> symmetric, dB": "{symmetric_psnr:.2f}",
        "> normals, degrees": "{normal_error_deg:.2f}",
    },
}


def _plain(columns: Columns, rows: Sequence[Row]) -> Table:
    """One line for each row; a row with a note, such as a BD-rate, has its note in the last lines."""
    plain = (row for row in rows if "note" not in row)
    cells = [[c(row) if callable(c) else c.format_map(row) for c in columns.values()] for row in plain]
    notes = [[row["body"], f"{row['way']}: {row['note']}"] + [""] * (len(columns) - 2) for row in rows if "note" in row]
    return [head.rstrip() for head in columns], [*cells, *notes]


def _anchors(rows: Sequence[Row]) -> Table:
    """Bytes and error: a line for each step, a column for each way of rounding."""
    ways, steps = _distinct(rows, "rounding"), _distinct(rows, "step")
    found = {(row["step"], row["rounding"]): f"{row['bytes']} / {1000 * row['rms']:.2f}" for row in rows}
    lines = [[f"{1000 * step:.3f}", *(found[step, way] for way in ways)] for step in steps]
    return ["> step x 1000", *(f"> {way}" for way in ways)], lines


def _templates(rows: Sequence[Row]) -> Table:
    """Rate and quality: a line for each template and choice of the coder, a column for each step."""
    steps = _distinct(rows, "step")
    found = {(row["template"], row["choice"], row["step"]): row for row in rows}
    names = dict.fromkeys((row["template"], row["choice"]) for row in rows)
    heads = ["template", "choice", *(f"> step {100 * step:.2f} %: Mbps, symmetric dB, normals" for step in steps)]
    form = "{mbps:.3f}, {symmetric_psnr:.1f}, {normal_error_deg:.2f}"
    return heads, [[*name, *(form.format_map(found[(*name, step)]) for step in steps)] for name in names]


def _distinct(rows: Sequence[Row], key: str) -> list[Any]:
    return list(dict.fromkeys(row[key] for row in rows))


PIVOTS: dict[str, Callable[[Sequence[Row]], Table]] = {"anchors": _anchors, "template": _templates}
