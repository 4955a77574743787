"""Rates that codecs need for the quality of `meshreel best`: tables of pages and numbers of the README, from rows."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from statistics import mean, median
from typing import Any

from ..bd_rate import RateAt, rate_at, reach
from ..experiments.figure6 import D1, SCENES
from ..experiments.study import D2, MASKED, NORMALS, Measure
from ..names import BEST, DECIMATED, DRACO, TVMC, in_order, title
from ..rows import Row
from .bandwidth import vdmc_ratios
from .tables import markdown, text
from .values import curve, curve_of, rated, sequences, value

SECONDS = 3.0  # that a person is said to play
QUALITY, MOST = 50.0, 85.0  # the default, and of `best` the highest that counts: more is hardly seen
TRIANGLES = 20_000  # of a frame of PEOPLE: `datasets.remesh` gives each about 10,000 vertices
PEOPLE = ("crane60", "samba60")
OTHERS = (DRACO, DECIMATED, TVMC)
EQUAL = (D2, MASKED, NORMALS)  # the table has the first two
HEAD = "times the bytes of `best`"


def winners_table(rows: Sequence[Row], points: Sequence[Row]) -> list[str]:
    """Return by codec the bytes over those of `best` on bodies and on scenes; `points` are compared with V-DMC's."""
    usual, every = _usual(rows), sequences(rows)
    curves = {name: set(map(curve_of, rated(usual, name))) for name in every}
    groups = {"bodies": [name for name in every if name not in SCENES]}
    groups["scenes"] = [name for name in every if name in SCENES]
    records = []
    for codec in in_order(map(curve_of, rated(usual))):
        if codec == BEST or sum(codec in own for own in curves.values()) < min(2, len(every)):
            continue  # variants that are measured on one sequence are in the appendix
        record = {HEAD: text(title(codec))}
        for group, names in groups.items():
            own = [rated(usual, name) for name in names if codec in curves[name]]
            record |= {f"{group}, equal {m.name}": _range([_ratio(r, codec, BEST, m) for r in own]) for m in EQUAL[:2]}
        records.append(record)
    vdmc = {measure: vdmc_ratios(points, measure) for measure in EQUAL[:2]}
    if records and any(vdmc.values()):
        cells = {f"bodies, equal {m.name}": _range([RateAt(ratio) for *_, ratio in own]) for m, own in vdmc.items()}
        records.append({HEAD: f"V-DMC TM4 with UVs, {len(vdmc[D2])} rates on one body"} | cells)
    return markdown(records) if any(BEST in own for own in curves.values()) else []


def _range(ratios: Sequence[RateAt | None]) -> str:
    """Return the median of ratios and their range, and on how many sequences there is one."""
    reached = [ratio for ratio in ratios if ratio and ratio.rate is not None]
    known = [round(ratio.rate, 2) for ratio in reached if ratio.rate is not None and not ratio.at_most]
    if not known:
        bounds = [_short(ratio.rate or 0.0) for ratio in reached]
        return f"at most {', '.join(bounds)}" if bounds else "not reached" if ratios else ""
    details = [f"{_short(min(known))} to {_short(max(known))}"] if len(known) > 1 else []
    details += [f"{len(known)} of {len(ratios)}"] if len(known) < len(ratios) else []
    return f"**{_short(median(known))}**" + (f" ({', '.join(details)})" if details else "")


def _short(ratio: float) -> str:
    return f"{ratio:.2g}" if ratio < 10 else f"{ratio:.0f}"


def losses(rows: Sequence[Row], points: Sequence[Row]) -> Iterator[str]:
    """Yield sentences about sequences on which another codec needs fewer bytes than `best` at its usual quality."""
    usual = _usual(rows)
    for measure in EQUAL:
        for name in sequences(usual):
            own = rated(usual, name)
            for codec in in_order(map(curve_of, own)):
                ratio = _ratio(own, codec, BEST, measure)
                if ratio and ratio.rate is not None and ratio.rate < 1:
                    times = f"{'at most ' * ratio.at_most}{ratio.rate:.2g} times"
                    yield f"- {name}: {title(codec)} needs {times} its bytes at equal {measure.name}."
    for measure in (D1, *EQUAL):
        for row, _, factor in vdmc_ratios(points, measure):
            if factor < 1:
                point = f"V-DMC's point {row.point.options['rate']} ({row.mbps:.3g} Mbps)"
                yield f"- {row.point.sequence}: {point} needs {factor:.2g} times its bytes at equal {measure.name}."


def beyond_table(rows: Sequence[Row]) -> list[str]:
    """Return the best point of `best` on each sequence where another codec reaches a better one, and that codec."""
    records = []
    for name in sequences(rows):
        own = rated(rows, name)
        cells = {measure.name: _beyond(own, measure) for measure in (D2, MASKED)}
        if any(cells.values()):
            records.append({"sequence": text(name)} | cells)
    return markdown(records)


def _beyond(rows: Sequence[Row], measure: Measure) -> str:
    ends = {codec: end[1] for codec in in_order(map(curve_of, rows)) if (end := reach(curve(rows, codec, measure)))}
    if BEST not in ends or not (others := {codec: end for codec, end in ends.items() if codec != BEST}):
        return ""
    codec, (quality, mbps) = max(others.items(), key=lambda pair: pair[1][0])
    own = ends[BEST]
    if quality <= own[0] + measure.least:
        return ""
    other = f"{title(codec)} {measure.shown(quality)} at {mbps:.3g}"
    return f"{measure.shown(own[0])} at {own[1]:.3g} Mbps; {other}"


def rate_table(rows: Sequence[Row], best: str, measures: Sequence[Measure]) -> list[str]:
    """Return the rate that each curve needs for a common quality, and how many times that of `best` it is."""
    names = in_order(map(curve_of, rows))
    if best not in names or len(names) < 2:
        return []
    records = [{"codec": text(name)} for name in names]
    for measure in measures:
        quality = _common_quality(rows, best, measure)
        if quality is not None:
            head = f"Mbps at {measure.shown(quality)} ({measure.name}) ↓"
            for record, name in zip(records, names, strict=True):
                record[head] = _cell(rows, name, best, measure, quality)
    if len(records[0]) == 1:
        return []
    lines = markdown(records)
    shown = "".join(lines)
    used = ["≤: the rate of its cheapest point, which is better still."] if "≤ " in shown else []
    used += ["-: even its best point, which is shown, is not as good."] if "- (" in shown else []
    rule = f"×: how many times the rate of {text(best)}. The quality is the median of its points."
    return [*lines, "", f"Rates are interpolated on each codec's own curve, as for BD-rates; {rule}", *used]


def _cell(rows: Sequence[Row], name: str, best: str, measure: Measure, quality: float) -> str:
    points = curve(rows, name, measure)
    needed, ends = rate_at(points, quality), reach(points)
    if ends is None:
        return ""
    if needed.rate is None:
        return f"- (up to {measure.shown(ends[1][0])} at {ends[1][1]:.4g})"
    ratio = rate_ratio(rows, name, best, measure) if name != best else None
    return "≤ " * needed.at_most + f"{needed.rate:.4g}" + ("" if ratio is None else f" (×{ratio:.3g})")


def rate_ratio(rows: Sequence[Row], name: str, best: str, measure: Measure) -> float | None:
    """Return the rate of a curve over that of `best` at the common quality; None where it has no rate there."""
    ratio = _ratio(rows, name, best, measure)
    return None if ratio is None or ratio.at_most else ratio.rate


def _ratio(rows: Sequence[Row], name: str, best: str, measure: Measure) -> RateAt | None:
    """Return `rate_ratio`, upper bounds included; without a rate where the quality is not reached."""
    quality = _common_quality(rows, best, measure)
    if quality is None or name == best:
        return None
    own, other = (rate_at(curve(rows, each, measure), quality) for each in (best, name))
    if own.rate is None or other.rate is None:
        return RateAt(None)
    return RateAt(other.rate / own.rate, other.at_most)


def _common_quality(rows: Sequence[Row], best: str, measure: Measure) -> float | None:
    """Return the median quality of the points of `best`, that is, of those between its lowest and highest rate."""
    qualities = curve(rows, best, measure).qualities
    return float(f"{median(qualities):.3g}") if len(qualities) > 1 else None


def _usual(rows: Sequence[Row]) -> list[Row]:
    return [row for row in rows if row.name != BEST or float(row.options.get("quality") or 0.0) <= MOST]


def headline(studies: Mapping[str, Sequence[Row]]) -> dict[str, Any]:
    """Return the README's numbers from the rows of studies by name, ready for JSON; empty if they are not measured."""
    best = [row for row in studies.get("layers", ()) if row.name == BEST and row.options.get("quality") == QUALITY]
    people = [_person(row) for row in best if row.point.sequence in PEOPLE]
    usual = _usual(studies.get("figure6", ()))
    bodies = [name for name in sequences(usual) if name not in SCENES]
    own = {body: rated(usual, body) for body in bodies}
    table = {title(codec): {body: rate_ratio(own[body], codec, BEST, D2) for body in bodies} for codec in OTHERS}
    known = {codec: {body: round(ratio, 2) for body, ratio in each.items() if ratio} for codec, each in table.items()}
    ratios = {codec: each | {"median": round(median(each.values()), 1)} for codec, each in known.items() if each}
    if not people or not ratios:
        return {}
    size = round(mean(person["kilobytes"] for person in people))
    person = {"triangles": TRIANGLES, "seconds": SECONDS, "kilobytes": size, "quality": QUALITY, "from": people}
    rows = [row for name in ("figure6", "mpeg") for row in studies.get(name, ())]
    vdmc = {each.key: sorted(round(ratio, 2) for *_, ratio in vdmc_ratios(rows, each)) for each in (D1, D2, MASKED)}
    return {"person": person, "times_larger_at_equal_d2": ratios, "vdmc_times": vdmc}


def _person(row: Row) -> dict[str, Any]:
    """Return the size of `SECONDS` at the rate of a whole sequence."""
    kilobytes = row.mbps * 1e6 / 8 * SECONDS / 1000
    head = {"sequence": row.point.sequence, "frames": row.frames, "bytes": row.stream.bytes if row.stream else 0}
    return head | {"d2_psnr_db": round(value(row, D2.key) or 0.0, 1), "kilobytes": round(kilobytes, 1)}
