"""The paper's headline measures: bandwidth at an SSIM of .9, compression ratio, dynamic ratio; and V-DMC's points.

In: rows of figure 6. Out: Markdown.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from ..bd_rate import RateAt, rate_at, reach
from ..experiments.mpeg import D1
from ..experiments.study import D2, MASKED, NORMALS, SSIM, SYMMETRIC, Measure
from ..names import BEST, DRACO, FLOOR_RATIO, FOUND_NAME, KLT, NECGS, TSMC, TVMC, title
from ..rows import Row
from .published import anchor_rows
from .values import curve, rated, sequences, value

WANTED = 0.9  # SSIM of the paper's headline
# Of an input that is not compressed, for each vertex: three floats, and two faces of three 32-bit numbers, as a closed
# surface has.
RAW = 36
SYSTEMS = (TSMC, TVMC, DRACO, KLT, NECGS, BEST)


def headline_table(rows: Sequence[Row]) -> Iterator[str]:
    """Yield each system's rate for an SSIM of .9, of whole pictures and of covered pixels, on every sequence."""
    names = sequences(rows)
    yield f"| | {' | '.join(names)} |"
    yield "|" + "---|" * (len(names) + 1)
    yield f"| dynamic ratio | {' | '.join(_dynamic(rows, name) for name in names)} |"
    yield f"| not compressed | {' | '.join(_shown(_raw_mbps(rated(rows, name))) for name in names)} |"
    for measure in (SSIM, MASKED):
        for system in SYSTEMS:
            cells = [_needed(rated(rows, name), system, measure) for name in names]
            yield f"| {title(system)}, {measure.name} {WANTED:g} | {' | '.join(cells)} |"
    yield f"| AOM PMC (cannot be run yet) |{' |' * len(names)}"


def vdmc_table(rows: Sequence[Row]) -> Iterator[str]:
    """Yield V-DMC's points, each beside the rates at which `best` is as good by what is known of it."""
    measures = (D1, D2, SYMMETRIC, NORMALS, MASKED)
    yield f"| sequence | V-DMC | {' | '.join(f'`best` at equal {measure.name}' for measure in measures)} |"
    yield "|" + "---|" * (len(measures) + 2)
    for anchor in anchor_rows():
        cells = [f"{title(anchor.name)}, {anchor.point.options['rate']}: {anchor.mbps:.4g} Mbps"]
        for measure in measures:
            known, found = value(anchor, measure.key), _best_beside(anchor, rows, measure)
            if known is None or found is None:
                cells.append("")
            elif found.rate is None:
                cells.append(f"{known:g}{measure.unit}: not reached")
            else:
                sign = "≤ " * found.at_most
                cells.append(f"{known:g}{measure.unit}: {sign}{found.rate:.3g} Mbps (÷ {anchor.mbps / found.rate:.2g})")
        yield f"| {anchor.point.sequence} | {' | '.join(cells)} |"


def vdmc_times(rows: Sequence[Row], measure: Measure) -> list[float]:
    """Return how many times the rate of `best` V-DMC needs where both are as good, by its points, the least first."""
    pairs = [(anchor, _best_beside(anchor, rows, measure)) for anchor in anchor_rows()]
    return sorted(round(anchor.mbps / found.rate, 2) for anchor, found in pairs if found and found.rate is not None)


def _best_beside(anchor: Row, rows: Sequence[Row], measure: Measure) -> RateAt | None:
    """Return the rate at which `best` is as good as a point; None where the point's quality is not known."""
    known, own = value(anchor, measure.key), rated(rows, anchor.point.sequence)
    return None if known is None else rate_at(curve(own, BEST, measure), measure.sign * known)


def _needed(rows: Sequence[Row], system: str, measure: Measure) -> str:
    """Return the rate for the SSIM, interpolated, and how many times less that is than the input has."""
    points, raw = curve(rows, system, measure), _raw_mbps(rows)
    found, ends = rate_at(points, WANTED), reach(points)
    if ends is None:
        return "not measured"
    if found.rate is None:
        return f"up to {ends[1][0]:.3f} at {_shown(ends[1][1])}"
    return "≤ " * found.at_most + _shown(found.rate) + ("" if raw is None else f" (1/{raw / found.rate:.0f})")


def _raw_mbps(rows: Sequence[Row]) -> float | None:
    """Return the rate of what is not compressed: Draco keeps every vertex at its highest number of bits."""
    found = [
        8 * RAW * row.decoding.vertices * row.frame_rate / 1e6 for row in rows if row.name == DRACO and row.decoding
    ]
    return max(found, default=None)


def _dynamic(rows: Sequence[Row], sequence: str) -> str:
    """Return the share of the vertices that move: all where there is no background."""
    own = [row for row in rows if row.point.sequence == sequence]
    known = [(each, row.name) for row in own if (each := row.metrics.get(FLOOR_RATIO)) is not None]
    if known:
        return f"{100 * known[0][0]:.1f} %" + " (as found)" * (known[0][1] == FOUND_NAME)
    return "not known" if any(row.stream and row.stream.background_bytes for row in own) else "100 %"


def _shown(mbps: float | None) -> str:
    return "" if mbps is None else f"{mbps:.3g} Mbps"
