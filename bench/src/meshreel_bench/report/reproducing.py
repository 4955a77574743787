"""The page `reproducing.md`: the paper's numbers beside ours, and what differs between them. Rows -> Markdown."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from importlib.resources import files

from ..datasets import FOURS
from ..datasets import RELEASED as DATA_OF_AUTHORS
from ..experiments import EXPERIMENTS
from ..experiments.headset import FILM, HOLDS, THROTTLES
from ..names import BEST, LITERAL, LITERAL_FINEST, TSMC, TUNED
from ..rows import Row
from .bandwidth import RELEASED, TABLE_1, TABLE_2, Published, headline_table, vdmc_table
from .values import curve_of, rated, value

WRITTEN = (LITERAL, LITERAL_FINEST)  # the second where the first does not reach
*AUTHORS, AUTHORS_FOUR = DATA_OF_AUTHORS
SCENES = ("room2", "living_room", "procedural_room", *AUTHORS)
FOUR_AND_TWO = (*FOURS, "synthetic2x150", AUTHORS_FOUR)  # people
Cell = Callable[[Sequence[Row], str, Published | None], str]  # of a codec's rows on a sequence beside a system
SLACK_DB, SHORT = 0.1, " †"  # a point that is worse by more is marked
PAPER_3 = (("TSMC", 6.13, 25.35, 0.9462), ("uncompressed", 357.6, 26.46, 0.9594))  # LMG of 2026: name, Mbps, dB, SSIM
TEXT = "reproducing.md"  # package data: the page, with a line {NAME} for each table, and {canonical} within one


def reproducing_page(studies: Mapping[str, Sequence[Row]]) -> list[str]:
    """Return the lines of the page from the rows of experiments; none if no row has a counterpart in the paper."""
    both = [row for name in ("figure6", "long") for row in studies.get(name, ())]
    every = [row for row in both if row.point.metrics == "views"]  # the truth itself has no rate
    own = rated(every)
    if not {row.point.sequence for row in own} & {*SCENES, *FOUR_AND_TWO, *RELEASED}:
        return []
    literal = [row for row in rated(studies.get("ablation_paper", ())) if curve_of(row) in WRITTEN]
    streams = [row.stream for row in own if curve_of(row) in (TSMC, TUNED) and row.stream]
    canonical = f"{sum(each.canonical for each in streams)} of {sum(len(each.groups) for each in streams)} groups"
    page = (files(__package__) / TEXT).read_text(encoding="utf-8").replace("{canonical}", canonical)  # in the MDS pose
    lines = {
        "{table_1}": _beside(own, SCENES, TABLE_1, _near_best),
        "{table_2}": _beside(own, FOUR_AND_TWO, TABLE_2, _as_published),
        "{table_3}": _table_3(rated(studies.get("table3", ()))),
        "{headline}": headline_table(every),
        "{vdmc}": vdmc_table([*own, *studies.get("mpeg", ())]),
        "{tracker}": _tracker(studies.get("tracker", ())),
        "{figure_9}": _figure_9(studies.get("headset", ())),
        "{released}": _released([*own, *literal]),
        "{experiments}": [f"All experiments: {', '.join(f'`{name}`' for name in EXPERIMENTS)}; those which share"],
    }
    return [line for text in page.splitlines() for line in lines.get(text, [text])]


def _beside(rows: Sequence[Row], names: Sequence[str], systems: Sequence[Published], found: Cell) -> Iterator[str]:
    """Yield published systems, and `best`, each beside what is found of its codec on every sequence."""
    names = [name for name in names if rated(rows, name)] or names[:1]
    yield f"| {' | '.join(['system', 'paper', *(f'here, {name}' for name in names)])} |"
    yield "|" + "---|" * (len(names) + 2)
    for system in (*systems, None):
        codec = BEST if system is None else system.codec
        head = f"meshreel `{codec.removeprefix('meshreel ')}`" if system is None else f"{system.system} (`{codec}`)"
        cells = [head, _published(system), *(found(rated(rows, name), codec, system) for name in names)]
        yield f"| {' | '.join(cells)} |"


def _released(rows: Sequence[Row]) -> Iterator[str]:
    yield "| sequence | released code | preset `paper-literal` | preset `paper`, m varied | `best` |"
    yield "|---|---|---|---|---|"
    for name, each in [(name, each) for name, several in RELEASED.items() for each in several]:
        own = rated(rows, name)
        reaching = (codec for codec in WRITTEN if any(_d2(row) >= _wanted(each) for row in _of(own, codec)))
        shown = _as_good(own, next(reaching, LITERAL), _wanted(each)) if each.codec == TSMC else ""
        cells = [shown, *(_as_good(own, codec, _wanted(each)) for codec in (each.codec, BEST))]
        ssim = "" if each.ssim is None else f", SSIM {each.ssim:.3f}"
        yield f"| {name} | {each.system}: {each.mbps:g} Mbps, {each.d2_psnr:g} dB{ssim} | {' | '.join(cells)} |"


def _table_3(rows: Sequence[Row]) -> Iterator[str]:
    new, once_a_chain = "splats new in each frame: dB, SSIM | their Mbps", "splats once a chain: dB, SSIM | their Mbps"
    yield f"| sequence | mesh | its Mbps | {new} | {once_a_chain} |"
    yield "|---|---|---|---|---|---|---|"
    yield from (f"| dancer (paper) | {name} | {mesh} | {db}, {ssim} | 719.8 | | |" for name, mesh, db, ssim in PAPER_3)
    for row in rows:
        cells: list[str | None] = [row.point.sequence, f"{curve_of(row)}{_setting(row)}", f"{row.mbps:.3g}"]
        names = ("psnr", "ssim", "mbps", "per_frame_mbps", "own_psnr", "own_ssim")
        values = ((name, value(row, f"splats_{name}")) for name in names)
        known = {name: None if found is None else f"{found:.4g}" for name, found in values}
        here = f"{known['psnr']}, {known['ssim']}"
        if value(row, "splats_between_psnr") is None:  # no two frames share a base mesh
            cells += [here, known["mbps"], "", ""]
        else:
            own = "" if known["own_psnr"] is None else f"{known['own_psnr']}, {known['own_ssim']}"
            cells += [own, known["per_frame_mbps"], here, known["mbps"]]
        yield f"| {' | '.join(map(str, cells))} |"


def _tracker(rows: Sequence[Row]) -> Iterator[str]:
    yield "| sequence | tracker | RMS, mm | in the last frame | 95 % below | truth within | CPU s a frame |"
    yield "|---|---|---|---|---|---|---|"
    for row in rows:
        keys = ("center_rms_mm", "center_rms_last_mm", "center_95_mm", "truth_rms_mm", "track_s")
        cells = [f"{value(row, key) or 0.0:.1f}" for key in keys]
        yield f"| {row.point.sequence}, {row.frames} frames | {row.options['method']} | {' | '.join(cells)} |"


def _figure_9(rows: Sequence[Row]) -> Iterator[str]:
    heads = ("decoding a group, ms", "main thread a picture, ms", "99 % below, ms", "shown a second", "uploads, MB/s")
    yield f"| sequence, level | triangles | holds {FILM} at | {' | '.join(heads)} |"
    yield "|" + "---|" * (3 + len(heads))
    cases: dict[tuple[str, object], dict[object, Row]] = {}
    for row in sorted(rated(rows), key=lambda row: (row.point.sequence, str(row.options["level"]))):
        if row.options["rate"] == FILM:
            cases.setdefault((row.point.sequence, row.options["level"]), {})[row.options["throttle"]] = row
    for (sequence, level), found in cases.items():
        own = [found[each] for each in THROTTLES if each in found]
        keys = ("decode_group_ms", "main_ms", "main_99_ms", "fps", "upload_mb_s")
        cells = [" / ".join(f"{value(row, key) or 0.0:.3g}" for row in own) for key in keys]
        yield f"| {sequence}, {level} | {value(own[0], 'triangles'):.0f} | {_strongest(found)} | {' | '.join(cells)} |"


def _strongest(rows: Mapping[object, Row]) -> str:
    """Return the strongest throttle at which a browser still shows and decodes all in time."""
    holds = ""
    for throttle, row in sorted(rows.items(), key=lambda pair: float(str(pair[0]))):
        if (value(row, "shown_share") or 0.0) < HOLDS or (value(row, "decode_load") or 0.0) > 1:
            return holds or "none"
        holds = str(throttle)
    return f"{holds} or more"


def _published(system: Published | None) -> str:
    if system is None:
        return ""
    rate = "" if system.mbps is None else f"{system.mbps:.4g} Mbps, "
    return f"{rate}{system.d2_psnr:.2f} dB, SSIM {system.ssim:.3f}, {system.decode_ms:.1f} ms"


def _shown(row: Row | None) -> str:
    if row is None:
        return "not measured"
    ssim, decode = value(row, "ssim"), value(row, "decode_ms")
    parts = [f"{row.mbps:.3g} Mbps", f"{_d2(row):.2f} dB"]
    parts += [] if ssim is None else [f"SSIM {ssim:.3f}"]
    parts += [] if decode is None else [f"{decode:.1f} ms"]
    return ", ".join(parts) + _setting(row)


def _setting(row: Row) -> str:
    """Return the settings of TSMC, several of which choose the rate."""
    name = curve_of(row)
    if name in (TSMC, *WRITTEN):
        finest = f", {row.options['centers']} centers, {row.options['variant']}" if name == LITERAL_FINEST else ""
        return f" (m {row.options['basis_size']}{finest})"
    return f" (quality {row.options.get('quality', 50):g})" if name == TUNED else ""


def _of(rows: Sequence[Row], codec: str) -> list[Row]:
    """Return a codec's rows from the cheapest on."""
    return sorted((row for row in rows if curve_of(row) == codec), key=lambda row: row.mbps)


def _near_best(rows: Sequence[Row], codec: str, _system: Published | None) -> str:
    """Return the cheapest point of a codec that is as good in D2, but for `SLACK_DB`, as all of `best`; or its best."""
    best = [_d2(row) for row in _of(rows, BEST)]
    return _as_good(rows, codec, max(best) - SLACK_DB) if best else _shown(None)


def _as_published(rows: Sequence[Row], codec: str, system: Published | None) -> str:
    return _as_good(rows, codec, _wanted(system or TABLE_2[0]))


def _as_good(rows: Sequence[Row], codec: str, db: float) -> str:
    """Return the cheapest point that is as good; the best one, marked, where none is."""
    own = _of(rows, codec)
    good = [row for row in own if _d2(row) >= db]
    if good:
        return _shown(good[0])
    return _shown(max(own, key=_d2, default=None)) + SHORT * bool(own)


def _wanted(system: Published) -> float:
    return system.d2_psnr or 0.0


def _d2(row: Row) -> float:
    return value(row, "d2_psnr_paper") or 0.0
