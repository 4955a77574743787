"""Tables in Markdown, made from rows: operating points, the best in bold, codecs at one rate, BD-rates, failures.

In -> out: rows -> lines of Markdown. Names and reasons are escaped: what a row says is text, and never markup.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Hashable, Mapping, Sequence
from dataclasses import dataclass
from itertools import compress
from math import exp, log
from statistics import median
from typing import Any

from ..curves import Measure, against, curve, curve_of, value
from ..promises import Promise
from ..provenance import MADE_BY
from ..row_form import CURVE_KINDS, FAILED
from ..rows import Row, curve_rows, experiment_of
from .looks import arrow, in_order
from .plots import METRICS

NEAR = 1.25  # factor of a rate within which points are compared
NEAR_DB = 1.0  # of a PSNR
DAGGER = "†"
DECODE = "decode"  # the key of a row whose times count


@dataclass(frozen=True, slots=True)
class Told:
    """A number that is ranked, between two pieces of Markdown."""

    number: float
    before: str = ""
    after: str = ""


Cell = str | float | Told | None
_UNKNOWN = "not recorded"


def text(found: object) -> str:
    """Anything as text of one line, that Markdown shows as it is."""
    line = " ".join(str(found).split())
    line = without_html(re.sub(r"([\\`*|\[\]~])", r"\\\1", line))
    line = re.sub(r"&(?=#?\w+;)", r"\\&", line)
    return re.sub(r"(?<![A-Za-z0-9])_|_(?![A-Za-z0-9])", r"\\_", line)


def without_html(line: str) -> str:
    """Markdown in which what looks like a tag is text."""
    return re.sub(r"(?<!\\)((?:\\\\)*)<(?=[A-Za-z/!?])", r"\1\\<", line)  # behind an even number of backslashes


def table(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    """Lines of a table; the cells are Markdown."""
    lines = [f"| {' | '.join(heads)} |", "|" + "---|" * len(heads)]
    return lines + [f"| {' | '.join(row)} |" for row in rows]


def ranked_table(
    heads: Sequence[str],
    rows: Sequence[Sequence[Cell]],
    directions: Sequence[int],
    groups: Sequence[Hashable] | None = None,
) -> list[str]:
    """A table in whose columns the best number is bold and the second best is italic.

    `directions`, one a column: 1 where more is better, -1 where less is (the head has an arrow), 0 where nothing is
    ranked. Rows are ranked among those of an equal group, all of them where no groups are given, and not at all where
    the group is None. Equal as printed is equal: who ties for the best is bold, and the next is italic. One number
    alone has no rank. Texts are Markdown; None is an empty cell.
    """
    groups = groups if groups is not None else [True] * len(rows)
    cells = [[_shown(cell) for cell in row] for row in rows]
    for column, sign in enumerate(directions):
        for group in dict.fromkeys(groups) if sign else ():
            own = [i for i, g in enumerate(groups) if g == group and g is not None]
            numbers = {i: _number(rows[i][column]) for i in own}
            printed = {i: float(_shown(number)) for i, number in numbers.items() if number is not None}
            best = sorted(set(printed.values()), reverse=sign > 0)
            for i, number in printed.items() if len(printed) > 1 else ():
                cells[i][column] = _shown(rows[i][column], {0: "**", 1: "*"}.get(best.index(number), ""))
    return table([head + arrow(sign) for head, sign in zip(heads, directions, strict=True)], cells)


def sequences(rows: Sequence[Row]) -> list[str]:
    """The sequences of which rows have a rate and metrics."""
    return list(dict.fromkeys(row["sequence"] for row in rows if row["kind"] in CURVE_KINDS and FAILED not in row))


def common_rate(rows: Sequence[Row]) -> float:
    """Mbps: the median over codecs of each one's median, of logarithms; a codec with many points counts once."""
    rates: dict[str, list[float]] = {}
    for row in rows:
        rates.setdefault(curve_of(row), []).append(log(row["mbps"]))
    return exp(median(map(median, rates.values())))


def nearest(rows: Sequence[Row], wanted: float, key: str = "mbps") -> dict[str, Row]:
    """Of each codec, in order, the row nearest to a rate by factor, or to a quality; of two, the cheaper one."""
    found = {}
    for name in in_order(map(curve_of, rows)):
        own = [row for row in rows if curve_of(row) == name and value(row, key) is not None]
        if own:
            found[name] = min(own, key=lambda row: (_apart(row, wanted, key), row["mbps"]))
    return found


def is_near(row: Row, wanted: float, key: str = "mbps") -> bool:
    """Whether a row is within a factor of `NEAR` of a rate, or within `NEAR_DB` of a PSNR."""
    return _apart(row, wanted, key) <= 1 + 1e-9


def _apart(row: Row, wanted: float, key: str) -> float:
    """How far a row is from what is wanted, in units of what is near."""
    found = value(row, key) or 0.0
    return abs(log(found / wanted)) / log(NEAR) if key == "mbps" else abs(found - wanted) / NEAR_DB


def comparable_table(rows: Sequence[Row], wanted: float, key: str = "mbps") -> list[str]:
    """Each codec at its point nearest to a rate or a PSNR, ranked among those of a sequence.

    A codec whose nearest point is not within a factor of `NEAR`, or within `NEAR_DB`, has a dagger, and is not ranked.
    No lines where there is no quality.
    """
    lines, groups = list[list[Cell]](), list[Hashable]()
    names = sequences(rows)
    told = [
        (sequence, found) for sequence in names for found in nearest(curve_rows(rows, sequence), wanted, key).items()
    ]
    columns = [(head, 0 if at == key else sign, at) for head, sign, at in _COMPARED]
    if key != "mbps":  # then it is the rate that is compared
        columns = [(head, -1 if at == "mbps" else sign, at) for head, sign, at in columns]
    kept = [column for column in columns if any(_read(row, column[2]) is not None for _, (_, row) in told)]
    if not any(sign for _, sign, _ in kept):
        return []
    for sequence, (name, row) in told:
        near = is_near(row, wanted, key)
        first = [text(sequence)] if len(names) > 1 else []
        lines.append([*first, text(name) + ("" if near else f" {DAGGER}"), *(_read(row, at) for _, _, at in kept)])
        groups.append(sequence if near else None)
    first_heads = ["sequence", "codec"] if len(names) > 1 else ["codec"]
    heads, signs = [head for head, _, _ in kept], [sign for _, sign, _ in kept]
    made = ranked_table([*first_heads, *heads], lines, [0] * len(first_heads) + signs, groups)
    if None in groups:
        limit = f"a factor of {NEAR:g} of {wanted:.3g} Mbps" if key == "mbps" else f"{NEAR_DB:g} dB of {wanted:g} dB"
        made += ["", f"{DAGGER} No point within {limit}: the nearest is shown, and is not ranked."]
    return made


def bd_table(rows: Sequence[Row], one: str, measures: Sequence[Measure], is_anchor: bool = False) -> list[str]:
    """BD-rate of the curve `one` against every other one of each sequence, with the qualities that both reach.

    Negative: `one` needs less rate for equal quality. With `is_anchor` it is that of every other one against it. No
    lines where it has no curve, or no other has one.
    """
    lines, names = [], sequences(rows)
    for sequence in names:
        own = curve_rows(rows, sequence)
        others = in_order(map(curve_of, own))
        for other in others if one in others else ():
            if other != one:
                first = [text(sequence)] if len(names) > 1 else []
                pair = (other, one) if is_anchor else (one, other)
                lines.append([*first, text(other), *(_bd_cell(own, *pair, measure) for measure in measures)])
    heads = [f"rate at equal {measure.name} ↓" for measure in measures]
    head = f"against {text(one)}" if is_anchor else f"{text(one)} against"
    return table([*(["sequence"] if len(names) > 1 else []), head, *heads], lines) if lines else []


def summary_table(rows: Sequence[Row], one: str, measure: Measure) -> list[str]:
    """BD-rate of the curve `one` against every other one by one measure: a line a codec, a column a sequence.

    Empty where a sequence has no such curve. No lines where there is no other curve.
    """
    names = sequences(rows)
    curves = {name: set(map(curve_of, curve_rows(rows, name))) for name in names}
    lines = []
    for other in in_order(name for found in curves.values() for name in found if name != one):
        own = [curve_rows(rows, name) if {one, other} <= curves[name] else [] for name in names]
        lines.append([text(other), *(_bd_cell(found, one, other, measure) if found else "" for found in own)])
    return table([f"{text(one)} against: rate at equal {measure.name} ↓", *map(text, names)], lines) if lines else []


def promise_table(promises: Sequence[Promise]) -> list[str]:
    """Targets."""
    lines = [[p.text, p.bound, p.value or "", p.verdict] for p in promises]  # Markdown already
    return ["| target | bound | measured | |", *table(["", "", "", ""], lines)[1:]]


def point_table(rows: Sequence[Row], metrics: Sequence[tuple[str, str]] = METRICS) -> list[str]:
    """Operating points: rate, every metric, groups, encode and decode times; below, what all points of a codec share.

    `metrics` are keys of rows and labels. Curve by curve, each from its lowest rate on. Columns of which nothing is
    known are left out.
    """
    metrics = [*metrics, *(each for each in METRICS if each[0] not in dict(metrics))]
    order = in_order(map(curve_of, rows))
    rows = sorted(rows, key=lambda row: (order.index(curve_of(row)), row["mbps"]))
    heads = ["codec", "operating point", "Mbps", *(label for _, label in metrics), "worst frame (dB)", "groups"]
    heads += ["encode (s/frame)", "by stage", "decode (ms/frame)", "/ DracoPy", "decode peak (MB)"]
    lines, shared = list[list[str]](), _shared_options(rows)
    for row in rows:
        stages = ", ".join(f"{k} {v:.2g}" for k, v in row.get("encode_stages_s", {}).items())
        decode = row.get("decode", {})
        qualities = [_shown(value(row, key)) for key, _ in metrics]
        cells = [text(row["codec"]), text(_point(row, shared[row["codec"]])), _shown(row["mbps"]), *qualities]
        cells += [_shown(row.get("d2_psnr_paper_worst")), _group_sizes(row), _shown(row.get("encode_s")), text(stages)]
        times = (decode.get("frame_ms"), row.get("decode_over_peer"), decode.get("peak_rss_mb"))
        lines.append([*cells, *map(_shown, times)])
    known = [any(line[column] for line in lines) for column in range(len(heads))]
    lines = [list(compress(line, known)) for line in lines]
    told = [f"{text(codec)}: {text(_told(options))}" for codec, options in shared.items() if options]
    below = ["", f"All points of {'; '.join(told)}."] if told else []
    return [*table(list(compress(heads, known)), lines), *below]


def failure_table(rows: Sequence[Row]) -> list[str]:
    """Points of which nothing was measured, and why."""
    heads = ["experiment", "sequence", "codec", "operating point", "kind", "reason"]
    lines = []
    for row in rows:
        cells = [experiment_of(row), row["sequence"], row["codec"], _point(row), row["kind"], row[FAILED]]
        lines.append([text(cell) for cell in cells])
    return table(heads, lines)


def maker_table(rows: Sequence[Row]) -> list[str]:
    """What made the rows of each experiment: version, commit and machine, and how many rows."""
    counts: dict[tuple[str, ...], int] = {}
    for row in rows:
        made = row.get(MADE_BY) or row.get("machine") or {}  # older rows have a machine without a commit
        commit = made.get("commit", _UNKNOWN) or "none: installed"
        told = [made.get(key) or _UNKNOWN for key in ("platform", "cpu", "python", "cores")]
        key = (experiment_of(row), made.get("meshreel") or _UNKNOWN, commit, *told)
        counts[tuple(map(text, key))] = counts.get(tuple(map(text, key)), 0) + 1
    heads = ["experiment", "meshreel", "commit", "platform", "processor", "Python", "cores", "rows"]
    return table(heads, [[*key, str(count)] for key, count in counts.items()])


def _read(row: Row, key: str) -> float | None:
    found = row.get("decode", {}).get("frame_ms") if key == DECODE else value(row, key)
    return None if found is None else float(found)


# Head, direction, and the key of a row.
_COMPARED = (
    ("Mbps", 0, "mbps"),
    ("D2, paper form (dB)", 1, "d2_psnr_paper"),
    ("SSIM", 1, "ssim"),
    ("masked SSIM", 1, "ssim_masked"),
    ("normal error (degrees)", -1, "normal_error_deg"),
    ("decode (ms/frame)", -1, DECODE),
)


def _bd_cell(rows: Sequence[Row], test: str, other: str, measure: Measure) -> str:
    """One BD-rate and its overlap, or why there is none."""
    pair = [curve([row for row in rows if curve_of(row) == name], name, measure) for name in (other, test)]
    missing = [each.name for each in pair if not each.rates]
    if missing:
        return f"not measured of {text(' and '.join(missing))}"
    found = against(pair[0], pair[1], measure).rate
    if min(found.points) < 2:
        few = [name for name, points in zip((other, test), found.points, strict=True) if points < 2]
        return f"one usable point of {text(' and '.join(few))}"
    if found.percent is None:
        return "no overlap"
    if found.high - found.low < measure.least:
        return f"overlap too small ({measure.shown(found.low)} to {measure.shown(found.high)})"
    return f"{found.percent:+.1f} % ({measure.shown(found.low)} to {measure.shown(found.high)})"


def _shared_options(rows: Sequence[Row]) -> dict[str, dict[str, Any]]:
    """By codec the options that are the same at all of its points; none where it has one point."""
    found: dict[str, dict[str, Any]] = {}
    for codec in dict.fromkeys(row["codec"] for row in rows):
        first, *others = (row["options"] for row in rows if row["codec"] == codec)
        same = {key: value for key, value in first.items() if all(other.get(key) == value for other in others)}
        found[codec] = same if others and len(same) < len(first) else {}
    return found


def _told(options: Mapping[str, Any]) -> str:
    return ", ".join(f"{key} {value}" for key, value in options.items() if value is not None)


def _point(row: Row, shared: Collection[str] = ()) -> str:
    told = _told({key: value for key, value in row["options"].items() if key not in shared})
    coded = row.get("coded_frames", row.get("frames"))
    return told if coded == row.get("frames") else f"{told}; {coded} of {row['frames']} frames coded"


def _group_sizes(row: Row) -> str:
    """Frames of each group, as 5+5; how many where they are many."""
    sizes = [str(group["frames"]) for group in row.get("groups", ())]
    return "+".join(sizes) if len(sizes) < 8 else f"{len(sizes)} groups"


def _number(cell: Cell) -> float | None:
    """What a cell is ranked by; None for texts."""
    if isinstance(cell, Told):
        return cell.number
    return cell if isinstance(cell, (int, float)) else None


def _shown(cell: Cell, mark: str = "") -> str:
    """A cell, and the mark around its number."""
    if isinstance(cell, Told):
        return f"{cell.before}{_shown(cell.number, mark)}{cell.after}"
    return cell or "" if cell is None or isinstance(cell, str) else f"{mark}{cell:.4g}{mark}"
