"""The page `reproducing.md`: the paper's numbers beside ours, and what differs between them.

In: rows of the paper's experiments. Out: lines of Markdown. Ours are of rows, theirs of `published`; a cell without a
row is empty.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from importlib.resources import files

from .curves import curve_of, value
from .names import BEST, TSMC, TUNED
from .published import RELEASED, RELEASED_TVMC, TABLE_1, TABLE_2, Published
from .rows import Row, curve_rows, measured_rows

NAMES = ("figure6", "table1", "table2")  # experiments whose rows count
SCENES = ("room2", "living_room", "procedural_room")
SYNTHETIC = "synthetic4"
SLACK_DB, SHORT = 0.1, " †"  # a point that is worse by more is marked
TEXT = "reproducing.md"  # package data: the page, with a line {NAME} for each table


def reproducing_page(rows: Sequence[Row]) -> list[str]:
    """The lines of the page; no lines where no row of the paper's experiments on one of its sequences is there."""
    own = list({row["point"]: row for row in measured_rows(rows) if row.get("experiment") in NAMES}.values())
    if not {row["sequence"] for row in own} & {*SCENES, SYNTHETIC, *RELEASED}:
        return []
    tables = {"{table_1}": _table_1, "{table_2}": _table_2, "{released}": _released}
    text = (files(__package__) / TEXT).read_text(encoding="utf-8")
    return [line for told in text.splitlines() for line in (tables[told](own) if told in tables else [told])]


def _table_1(rows: Sequence[Row]) -> Iterator[str]:
    scenes = [scene for scene in SCENES if curve_rows(rows, scene)]
    yield from _heads(["paper"], scenes or SCENES)
    for system in (*TABLE_1, None):
        codec = BEST if system is None else system.codec
        cells = [_published(system), *(_near_best(curve_rows(rows, scene), codec) for scene in scenes or SCENES)]
        yield _line(system, codec, cells)


def _table_2(rows: Sequence[Row]) -> Iterator[str]:
    yield from _heads(["paper"], [SYNTHETIC])
    own = curve_rows(rows, SYNTHETIC)
    for system in (*TABLE_2, None):
        codec = BEST if system is None else system.codec
        wanted = TABLE_2[0].d2_psnr if system is None else system.d2_psnr
        yield _line(system, codec, [_published(system), _as_good(own, codec, wanted)])


def _released(rows: Sequence[Row]) -> Iterator[str]:
    yield "| sequence | released code | the same system here | `best` |"
    yield "|---|---|---|---|"
    shown = [(name, each) for name, several in RELEASED.items() for each in several]
    for name, each in (*shown, (SYNTHETIC, RELEASED_TVMC)):
        own = curve_rows(rows, name)
        cells = [_as_good(own, codec, each.d2_psnr) for codec in (each.codec, BEST)]
        ssim = "" if each.ssim is None else f", SSIM {each.ssim:.3f}"
        told = f"{each.system}: {each.mbps:g} Mbps, {each.d2_psnr:g} dB{ssim}"
        yield f"| {name} | {told} | {' | '.join(cells)} |"


def _heads(first: Sequence[str], sequences: Sequence[str]) -> Iterator[str]:
    heads = ["system", *first, *(f"here, {name}" for name in sequences)]
    yield f"| {' | '.join(heads)} |"
    yield "|" + "---|" * len(heads)


def _line(system: Published | None, codec: str, cells: Sequence[str]) -> str:
    name = f"meshreel `{codec.removeprefix('meshreel ')}`" if system is None else f"{system.system} (`{codec}`)"
    return f"| {name} | {' | '.join(cells)} |"


def _published(system: Published | None) -> str:
    if system is None:
        return ""
    rate = "" if system.mbps is None else f"{system.mbps:.4g} Mbps, "  # where the paper tells it
    return f"{rate}{system.d2_psnr:.2f} dB, SSIM {system.ssim:.3f}, {system.decode_ms:.1f} ms"


def _told(row: Row | None) -> str:
    if row is None:
        return "not measured"
    decode = row.get("decode", {}).get("frame_ms")
    ssim = value(row, "ssim")
    told = [f"{row['mbps']:.3g} Mbps", f"{row['d2_psnr_paper']:.2f} dB"]
    told += [] if ssim is None else [f"SSIM {ssim:.3f}"]
    told += [] if decode is None else [f"{decode:.1f} ms"]
    return ", ".join(told) + _setting(row)


def _setting(row: Row) -> str:
    """Where TSMC is set to: several of its options choose a rate."""
    options, curve = row["options"], curve_of(row)
    if curve == TSMC:
        return f" (m {options['basis_size']})"
    return f" (quality {options.get('quality', 50):g})" if curve == TUNED else ""


def _of(rows: Sequence[Row], codec: str) -> list[Row]:
    """A codec's rows from the cheapest on; of TSMC those of both its curves."""
    curves = (TSMC, TUNED) if codec == TSMC else (codec,)
    return sorted((row for row in rows if curve_of(row) in curves), key=lambda row: row["mbps"])


def _near_best(rows: Sequence[Row], codec: str) -> str:
    """The cheapest point of a codec that is as good in D2, but for `SLACK_DB`, as all of `best`; or its best one."""
    best = [row["d2_psnr_paper"] for row in _of(rows, BEST)]
    return _as_good(rows, codec, max(best) - SLACK_DB) if best else _told(None)


def _as_good(rows: Sequence[Row], codec: str, db: float) -> str:
    """The cheapest point that is as good; the best one, marked, where none is."""
    own = _of(rows, codec)
    good = [row for row in own if row["d2_psnr_paper"] >= db]
    if good:
        return _told(good[0])
    return _told(max(own, key=lambda row: row["d2_psnr_paper"], default=None)) + SHORT * bool(own)
