"""Tables in Markdown, made from data frames. Texts of rows are escaped, so that they are never markup."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence

from ..bd_rate import bd_rate
from ..experiments.study import Measure
from ..names import in_order
from ..rows import Options, Row
from .values import curve, curve_of, is_twin, rated, sequences, value
from .verdicts import Verdict


def text(found: object) -> str:
    """Return anything as text of one line that Markdown shows as it is."""
    line = re.sub(r"([\\`*|\[\]~])", r"\\\1", " ".join(str(found).split()))
    line = re.sub(r"<(?=[A-Za-z/!?])", r"\\<", line)
    line = re.sub(r"&(?=#?\w+;)", r"\\&", line)
    return re.sub(r"(?<![A-Za-z0-9])_|_(?![A-Za-z0-9])", r"\\_", line)


def markdown(records: Sequence[Mapping[str, object]]) -> list[str]:
    """Return the lines of a table, numbers in four digits; columns of which nothing is known are left out."""
    every = dict.fromkeys(name for record in records for name in record)
    heads = [name for name in every if any(_cell(record.get(name)) for record in records)]
    lines = [heads, *([_cell(record.get(name)) for name in heads] for record in records)] if heads else []
    shown = [f"| {' | '.join(line)} |" for line in lines]
    return [*shown[:1], "|" + "---|" * len(heads), *shown[1:]] if shown else []


def point_table(rows: Sequence[Row], measures: Sequence[Measure]) -> list[str]:
    """Return operating points, each curve from its lowest rate on: rate, every measure, groups, and times."""
    order = in_order(map(curve_of, rows))
    records = []
    for row in sorted(rows, key=lambda row: (order.index(curve_of(row)), row.mbps)):
        assert row.stream is not None
        sizes = [str(group.frames) for group in row.stream.groups]
        stages, work = (row.encoding.stages_s, row.encoding.work) if row.encoding else ({}, {})
        record: dict[str, object] = {"codec": text(row.name), "operating point": text(operating_point(row))}
        record |= {"Mbps": row.mbps} | {measure.label: value(row, measure.key) for measure in measures}
        record |= {
            "worst frame (dB)": value(row, "d2_psnr_paper_worst"),
            "background (kB)": row.stream.background_bytes / 1000 or None,
            "groups": "+".join(sizes) if len(sizes) < 8 else f"{len(sizes)} groups",
            "encode (s/frame)": value(row, "encode_s"),
            "by stage": text(", ".join(f"{stage} {s:.2g}" for stage, s in stages.items())),
            "at rest (s/frame)": value(row, "encode_s_at_rest"),
            "work a frame": text(", ".join(f"{kind} {number:.3g}" for kind, number in work.items())) or None,
            "decode (ms/frame)": value(row, "decode_ms"),
            "decode peak (MB)": value(row, "decode_mb"),
        }
        records.append(record)
    return markdown(records)


def value_table(rows: Sequence[Row]) -> list[str]:
    """Return the values of rows that have no rate: noise floors, segmentations, memory of encodes."""
    records = []
    for row in rows:
        found = {"encode peak (MB)": value(row, "encode_mb")} if row.stream else {}
        kept = {key: number for key, number in row.metrics.items() if not key.endswith("_worst") or "iou" in key}
        measured = text(f"{row.name} {_listed(row.options)}".strip())
        head = {"sequence": text(row.point.sequence), "measured": measured, "frames": str(row.frames)}
        listed = ", ".join(f"{key} {_cell(number)}" for key, number in (found | kept).items())
        records.append(head | {"values": text(listed)})
    return markdown(records)


def bd_table(rows: Sequence[Row], one: str, measures: Sequence[Measure], is_anchor: bool = False) -> list[str]:
    """Return BD-rates of a curve against every other one; those of every other one against it with `is_anchor`."""
    names = in_order(map(curve_of, rows))
    if one not in names or len(names) < 2:
        return []
    head = f"against {text(one)}" if is_anchor else f"{text(one)} against"
    pairs = {other: (other, one) if is_anchor else (one, other) for other in names if other != one}
    cells = {o: {f"rate at equal {m.name} ↓": bd_cell(rows, *pair, m) for m in measures} for o, pair in pairs.items()}
    return markdown([{head: text(other)} | own for other, own in cells.items()])


def summary_table(rows: Sequence[Row], one: str, measure: Measure) -> list[str]:
    """Return BD-rates of a curve against every other one by one measure: a line a curve, a column a sequence."""
    head, records = f"{text(one)} against: rate at equal {measure.name} ↓", list[dict[str, str]]()
    curves = {name: set(map(curve_of, rated(rows, name))) for name in sequences(rows)}
    for other in in_order(set[str]().union(*curves.values()) - {one}):
        both = [name for name, own in curves.items() if {one, other} <= own and not is_twin(other, measure)]
        cells = {text(name): "" for name in curves}
        cells |= {text(name): bd_cell(rated(rows, name), one, other, measure) for name in both}
        records += [{head: text(other)} | cells] if both else []
    return markdown(records)


def bd_cell(rows: Sequence[Row], test: str, other: str, measure: Measure) -> str:
    """Return one BD-rate and its overlap, or why there is none."""
    found = bd_rate(curve(rows, other, measure), curve(rows, test, measure))
    if min(found.points) < 2:
        few = [name for name, points in zip((other, test), found.points, strict=True) if points < 2]
        return f"less than two usable points of {text(' and '.join(few))}"
    if found.percent is None:
        return "no overlap"
    span = f"{measure.shown(found.low)} to {measure.shown(found.high)}"
    if found.high - found.low < measure.least:
        return f"overlap too small ({span})"
    return f"{found.percent:+.1f} % ({span})"


def verdict_table(found: Sequence[Verdict]) -> list[str]:
    """Return a table of targets and measured values."""
    records = [{"target": text(v.text), "bound": v.bound, "measured": text(v.value or ""), " ": v.word} for v in found]
    return markdown(records)


def failure_table(rows: Sequence[Row]) -> list[str]:
    """Return points of which nothing was measured, and why."""
    heads = ("sequence", "codec", "operating point", "reason")
    found = ((row.point.sequence, row.name, _listed(row.options), row.failed) for row in rows)
    return markdown([dict(zip(heads, map(text, cells), strict=True)) for cells in found])


def maker_table(rows: Sequence[Row]) -> list[str]:
    """Return versions, commits and machines with the number of rows that each made."""
    heads = {"meshreel": "meshreel", "commit": "commit", "platform": "platform", "cpu": "processor", "python": "Python"}
    heads |= {"cores": "cores"}
    made = Counter(tuple(text(getattr(row.made_by, n, None) or "not recorded") for n in heads) for row in rows)
    return markdown([dict(zip(heads.values(), own, strict=True)) | {"rows": str(n)} for own, n in made.items()])


def _cell(cell: object) -> str:
    if isinstance(cell, str):
        return cell
    return "" if cell is None or cell != cell else f"{cell:.4g}"  # not a number


def _listed(options: Options) -> str:
    return ", ".join(f"{key} {option}" for key, option in options.items() if option is not None)


def operating_point(row: Row) -> str:
    """Return the options of a point, and how much of a sequence it has."""
    assert row.stream is not None
    coded = row.stream.coded_frames
    first = "" if row.point.frames is None else f"; first {row.frames} frames"
    return _listed(row.options) + (first if coded == row.frames else f"; {coded} of {row.frames} frames coded")
