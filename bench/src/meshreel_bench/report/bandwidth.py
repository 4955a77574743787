"""Published numbers beside ours: bandwidth at an SSIM of .9, compression ratio, dynamic ratio, V-DMC's points."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from importlib.resources import files

import msgspec

from ..bd_rate import RateAt, rate_at, reach
from ..experiments.figure6 import D1
from ..experiments.study import D2, MASKED, NORMALS, SSIM, SYMMETRIC, Measure
from ..names import BEST, DRACO, FLOOR_RATIO, FOUND_NAME, KLT, NECGS, TSMC, TVMC, VDMC, VDMC_HERE, title
from ..rows import Point, Row, Stream
from .values import curve, rated, sequences, value

DATA = "published.json"
FRAME_RATE = 30.0  # 1/s, of every sequence of V-DMC's that is shown


class Published(msgspec.Struct, frozen=True):
    """Numbers of a system; None: not published."""

    system: str  # as the source has it
    codec: str  # the curve of ours that stands beside it, or its own
    d2_psnr: float | None = None  # dB
    ssim: float | None = None  # whole pictures, four views
    decode_ms: float | None = None  # a frame
    mbps: float | None = None
    symmetric_psnr: float | None = None  # dB
    normal_error_deg: float | None = None
    ssim_masked: float | None = None
    mpeg_d1_psnr: float | None = None  # dB


class Table(msgspec.Struct, frozen=True):
    """Systems of one source."""

    source: str
    systems: list[Published]
    frames: int | None = None
    sequence: str | None = None  # of ours, in whose plots they are drawn


_TABLES = msgspec.json.decode((files(__package__) / DATA).read_bytes(), type=dict[str, Table])
TABLE_1, TABLE_2 = _TABLES["table_1"].systems, _TABLES["table_2"].systems
RELEASED = {name: _TABLES[name].systems for name in ("dancer", "synthetic4-crane")}


def anchor_rows() -> list[Row]:
    """Return V-DMC's points on sequences of ours as rows; only what is published of them is known."""
    return [_row(table, each) for table in _TABLES.values() if table.sequence is not None for each in table.systems]


def _row(table: Table, point: Published) -> Row:
    assert table.sequence is not None and table.frames is not None and point.mbps is not None
    known = ("symmetric_psnr", "normal_error_deg", "ssim_masked", "mpeg_d1_psnr")
    metrics = {"d2_psnr_paper": point.d2_psnr} | {name: getattr(point, name) for name in known}
    size = round(point.mbps * 1e6 / 8 * table.frames / FRAME_RATE)
    return Row(
        point=Point(table.sequence, point.codec, {"rate": point.system}, table.frames),
        name=VDMC if point.codec == "vdmc" else VDMC_HERE,
        frames=table.frames,
        frame_rate=FRAME_RATE,
        stream=Stream(size, table.frames),
        metrics={name: number for name, number in metrics.items() if number is not None},
    )


WANTED = 0.9  # SSIM of the paper's headline
# Of an input that is not compressed, for each vertex: three floats, and two faces of three 32-bit numbers, as a closed
# surface has.
RAW = 36
SYSTEMS = (TSMC, TVMC, DRACO, KLT, NECGS, BEST)


def headline_table(rows: Sequence[Row]) -> Iterator[str]:
    """Yield the rate of each system at an SSIM of .9, of whole pictures and of covered pixels, on every sequence."""
    names = sequences(rows)
    yield f"| | {' | '.join(names)} |"
    yield "|" + "---|" * (len(names) + 1)
    yield f"| dynamic ratio | {' | '.join(_dynamic(rows, name) for name in names)} |"
    yield f"| not compressed | {' | '.join(_mbps(_raw_mbps(rated(rows, name))) for name in names)} |"
    for measure in (SSIM, MASKED):
        for system in SYSTEMS:
            cells = [_needed(rated(rows, name), system, measure) for name in names]
            yield f"| {title(system)}, {measure.name} {WANTED:g} | {' | '.join(cells)} |"
    yield f"| AOM PMC (cannot be run yet) |{' |' * len(names)}"


def vdmc_table(rows: Sequence[Row]) -> Iterator[str]:
    """Yield V-DMC's points, each beside the rates of `best` at equal quality by every measure that is published."""
    measures = (D1, D2, SYMMETRIC, NORMALS, MASKED)
    yield f"| sequence | V-DMC | {' | '.join(f'`best` at equal {measure.name}' for measure in measures)} |"
    yield "|" + "---|" * (len(measures) + 2)
    for anchor in anchor_rows():
        cells = [f"{title(anchor.name)}, {anchor.point.options['rate']}: {anchor.mbps:.4g} Mbps"]
        for measure in measures:
            known, best = value(anchor, measure.key), _best_beside(anchor, rows, measure)
            if known is None or best is None:
                cells.append("")
            elif best.rate is None:
                cells.append(f"{known:g}{measure.unit}: not reached")
            else:
                ratio = f"(÷ {anchor.mbps / best.rate:.2g})"
                cells.append(f"{known:g}{measure.unit}: {'≤ ' * best.at_most}{best.rate:.3g} Mbps {ratio}")
        yield f"| {anchor.point.sequence} | {' | '.join(cells)} |"


def vdmc_ratios(rows: Sequence[Row], measure: Measure) -> list[tuple[Row, RateAt, float]]:
    """Return V-DMC's points with the rate of `best` at equal quality, and how many times that V-DMC needs."""
    pairs = [(anchor, _best_beside(anchor, rows, measure)) for anchor in anchor_rows()]
    return [(anchor, best, anchor.mbps / best.rate) for anchor, best in pairs if best and best.rate is not None]


def _best_beside(anchor: Row, rows: Sequence[Row], measure: Measure) -> RateAt | None:
    """Return the rate at which `best` is as good as a point; None where the point's quality is not known."""
    known, own = value(anchor, measure.key), rated(rows, anchor.point.sequence)
    return None if known is None else rate_at(curve(own, BEST, measure), measure.sign * known)


def _needed(rows: Sequence[Row], system: str, measure: Measure) -> str:
    """Return the interpolated rate at the SSIM, and which share of the uncompressed rate that is."""
    points, raw = curve(rows, system, measure), _raw_mbps(rows)
    needed, ends = rate_at(points, WANTED), reach(points)
    if ends is None:
        return "not measured"
    if needed.rate is None:
        return f"up to {ends[1][0]:.3f} at {_mbps(ends[1][1])}"
    return "≤ " * needed.at_most + _mbps(needed.rate) + ("" if raw is None else f" (1/{raw / needed.rate:.0f})")


def _raw_mbps(rows: Sequence[Row]) -> float | None:
    """Return the rate without compression, from Draco's rows: at its highest number of bits it keeps every vertex."""
    own = [(row.decoding.vertices, row.frame_rate) for row in rows if row.name == DRACO and row.decoding]
    return max((8 * RAW * vertices * frame_rate / 1e6 for vertices, frame_rate in own), default=None)


def _dynamic(rows: Sequence[Row], sequence: str) -> str:
    """Return the share of the vertices that move: all where there is no background."""
    own = [row for row in rows if row.point.sequence == sequence]
    known = [(each, row.name) for row in own if (each := row.metrics.get(FLOOR_RATIO)) is not None]
    if known:
        return f"{100 * known[0][0]:.1f} %" + " (as found)" * (known[0][1] == FOUND_NAME)
    return "not known" if any(row.stream and row.stream.background_bytes for row in own) else "100 %"


def _mbps(mbps: float | None) -> str:
    return "" if mbps is None else f"{mbps:.3g} Mbps"
