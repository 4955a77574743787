"""Pages of a report: first page, an appendix for each experiment, `reproducing.md`, the README's numbers."""

from __future__ import annotations

import hashlib
import json
import tempfile
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path

from meshreel.errors import InputError
from meshreel.io.write import make_folder, replacing

from ..datasets import is_scene
from ..experiments import EXPERIMENTS
from ..experiments.study import D2, MASKED, Study
from ..names import looks_of, title
from ..rows import Row, parted
from . import tables
from .bandwidth import anchor_rows
from .comparison import beyond_table, headline, losses, rate_table, winners_table
from .plots import drawable, plot_curves
from .reproducing import reproducing_page
from .values import curve_of, rated, sequences
from .verdicts import verdicts

FOLDER = "results"  # of appendices, plots and the README's numbers, beside the pages
OPEN = "figure6"  # the experiment that rows belong to which none declares, not in small: other codecs, other sequences
WITH_VDMC = (OPEN, "mpeg")  # experiments in whose plots V-DMC's points are
SHOWN = ("synthetic4-crane", "dancer", "room2")  # sequences whose curves are on the first page
TEXT = "results.md"  # package data: the first page, with a line {NAME} for each part that is made
BEYOND = "Other codecs go beyond the best measured point of `best`; the furthest of them:"
MISSED = "## Missed targets"
PAPER = "The paper's own numbers stand beside ours in [reproducing.md](reproducing.md)."
DOUBTS = "## Rows to measure again: their states differ, or are not recorded"


@dataclass(frozen=True, slots=True)
class Part:
    """An experiment and its rows."""

    name: str
    study: Study
    rows: list[Row]  # that were measured
    failed: list[Row]

    @property
    def is_drawn(self) -> bool:
        """True if the experiment has a plot."""
        return drawable(self.rows, self.study.measures[:2])

    @property
    def drawn(self) -> list[Row]:
        """Rows of the plots of this experiment; some have V-DMC's points, too."""
        there = sequences(self.rows) if self.name in WITH_VDMC else []
        return [*self.rows, *(row for row in anchor_rows() if row.point.sequence in there)]


def parts_of(rows: Sequence[Row]) -> list[Part]:
    """Return the experiments that have rows; a point of several experiments is in each of them."""
    declared = {name: {point.key for point in study.points()} for name, study in EXPERIMENTS.items()}
    others = {row.point.key for row in rows}.difference(*declared.values())
    homes = (name for name, study in EXPERIMENTS.items() if others <= {point.key for point in study.points(small=True)})
    home, parts = next(homes, OPEN), []
    for name, study in EXPERIMENTS.items():
        own = [row for row in rows if row.point.key in declared[name] | (others if name == home else set())]
        if own:
            parts.append(Part(name, study, *parted(own)))
    return parts


def write_report(rows: Sequence[Row], folder: Path) -> list[Path]:
    """Write the pages and their plots into a folder; return the paths."""
    make_folder(folder / FOLDER)
    with tempfile.TemporaryDirectory(prefix=".unfinished-", dir=folder) as name:
        written = _write(rows, Path(name))
        paths = [folder / path.relative_to(name) for path in written]
        if taken := [path for path in paths if path.is_dir()]:
            raise InputError(f"{taken[0]}: is a folder, where a file of the report belongs; move it")
        for source, path in zip(written, paths, strict=True):
            source.replace(path)
    return paths


def _write(rows: Sequence[Row], folder: Path) -> list[Path]:
    make_folder(folder / FOLDER)
    parts = parts_of(rows)
    # Colours tell the curves of a page apart.
    looks = {part.name: looks_of(map(curve_of, rated(part.drawn))) for part in parts}
    pages = {Path("results.md"): _first_page(parts)}
    plots = list[Path]()
    for part in parts:
        pages[Path(FOLDER, f"appendix-{part.name}.md")] = list(_appendix(part))
        if part.is_drawn:
            path = folder / FOLDER / f"{part.name}.png"
            x = part.study.rate, part.study.over
            plots.append(plot_curves(part.drawn, part.study.measures[:2], looks[part.name], path, x))
    for part, sequence in _shown(parts):
        own = [row for row in part.drawn if row.point.sequence == sequence]
        plots.append(plot_curves(own, (D2, MASKED), looks[part.name], folder / FOLDER / _plot_name(part, sequence)))
    studies = {part.name: part.rows for part in parts}
    if page := reproducing_page(studies):
        pages[Path("reproducing.md")] = page
    if numbers := headline(studies):
        pages[Path(FOLDER, "headline.json")] = json.dumps(numbers, indent=2).splitlines()
    for name, lines in pages.items():
        with replacing(folder / name) as file:
            file.write(("\n".join(lines) + "\n").encode(errors="backslashreplace"))
    return [*(folder / name for name in pages), *plots]


def _shown(parts: Sequence[Part]) -> list[tuple[Part, str]]:
    """Return the sequences whose curves are on the first page."""
    for part in parts:
        if part.name == OPEN:
            own = {name: [row for row in part.rows if row.point.sequence == name] for name in sequences(part.rows)}
            names = [name for name, several in own.items() if drawable(several, (D2, MASKED))]
            return [(part, name) for name in ([each for each in SHOWN if each in names] or names[:3])]
    return []


def _plot_name(part: Part, sequence: str) -> str:
    safe = "".join(sign if sign.isalnum() or sign in "._-" else "_" for sign in sequence)[-80:]
    other = "" if safe == sequence else f"-{hashlib.sha256(sequence.encode()).hexdigest()[:8]}"
    return f"{part.name}-{safe}{other}.png"


def _first_page(parts: Sequence[Part]) -> list[str]:
    """Return the lines of `results.md`: a comparison on one screen, then plots, BD-rates and what is missed."""
    rows = {part.name: part.rows for part in parts}
    open_rows, points = rows.get(OPEN, []), [row for name in WITH_VDMC for row in rows.get(name, ())]
    every = [verdict for part in parts for verdict in verdicts(part.study, part.rows) if verdict.met is not None]
    missed = [verdict for verdict in every if not verdict.met]
    kept = f"All {len(every)} targets that were measured are met." if every else "No target was measured."
    if missed:
        met = len(every) - len(missed)
        kept = f"Of {len(every)} targets, {met} are met; [the others](#missed-targets) are listed at the end."
    shown = ((tables.text(name), _plot_name(part, name)) for part, name in _shown(parts))
    images = [f"![{name}: quality against rate]({FOLDER}/{file})" for name, file in shown]
    made = {
        "{winners}": winners_table(open_rows, points) or ["No codec was measured beside `best`."],
        "{losses}": list(losses(open_rows, points)),
        "{beyond}": _section(BEYOND, beyond_table(open_rows)),
        "{verdicts}": [kept],
        "{reproducing}": [PAPER] if reproducing_page({OPEN: open_rows}) else [],
        "{plots}": [line for image in images for line in (image, "")],
        "{table}": tables.summary_table(open_rows, EXPERIMENTS[OPEN].best or "", D2),
        "{appendices}": [
            f"- [{p.study.title}]({FOLDER}/appendix-{p.name}.md), {len(p.rows) + len(p.failed)} points"
            + (f", {len(p.failed)} of them failed" if p.failed else "")
            for p in parts
        ],
        "{missed}": _section(MISSED, [f"- {tables.text(v.text)} ({v.bound}): {tables.text(v.value)}" for v in missed]),
        "{doubts}": _section(DOUBTS, [f"- {tables.text(line)}" for line in _doubts(parts)]),
    }
    page = (files(__package__) / TEXT).read_text(encoding="utf-8")
    lines = [line for text in page.splitlines() for line in made.get(text, [text])]
    return [line for number, line in enumerate(lines) if line or lines[number - 1]]  # no two blank lines together


def _section(head: str, lines: Sequence[str]) -> list[str]:
    """Return lines under a heading or a sentence; nothing without lines."""
    return ["", head, "", *lines] if lines else []


def _doubts(parts: Sequence[Part]) -> Iterator[str]:
    rows = [row for part in parts for row in part.rows]
    yield from mixtures(rows)
    if unknown := sum(row.encoder is None for row in rows):
        yield f"{unknown} of {len(rows)} rows do not say of which encoder and data they are."


def mixtures(rows: Iterable[Row]) -> list[str]:
    """Return the methods and sequences of which some rows were measured in another state than others."""
    found: dict[str, set[str | None]] = {}
    for row in rows:
        sequence = row.point.sequence
        kind, data = "scenes" if is_scene(sequence) else "bodies", f"data of {sequence}"
        method = " ".join([row.point.codec, *map(str, row.point.method.values())])
        length = "" if row.point.frames is None else f", {row.point.frames} frames"
        found_in = ((f"{method}, {kind}", row.encoder), (f"files of {sequence}", row.source), (data + length, row.data))
        for name, state in found_in:
            found.setdefault(name, set()).add(state)
    return [name for name, states in found.items() if len(states) > 1]


def _appendix(part: Part) -> Iterator[str]:
    study = part.study
    yield from (f"# {study.title}", "")
    yield from ("```", f"meshreel-bench run {part.name} -o {part.name}.jsonl --data DATA", "```", "")
    yield from (*study.notes, "") if study.notes else ()
    found = verdicts(study, part.rows)
    if any(verdict.value is not None for verdict in found):
        yield from ("## Targets", "", *tables.verdict_table(found), "")
    if part.is_drawn:
        yield from (f"![{title(part.name)}: quality against {study.over.split(' (')[0]}]({part.name}.png)", "")
    for name in sequences(part.rows):
        own = rated(part.rows, name)
        yield from (f"## {tables.text(name)}", "")
        for table in (*_comparisons(study, own), tables.point_table(own, study.measures)):
            yield from (*table, "") if table else ()
    if others := [row for row in part.rows if not (row.stream and row.metrics)]:
        yield from ("## Without rate or quality", "", *tables.value_table(others), "")
    if part.failed:
        yield from ("## Failed", "", "Nothing was measured of these points.", "")
        yield from (*tables.failure_table(part.failed), "")
    yield from ("## Machines and versions", "", *tables.maker_table([*part.rows, *part.failed]))


def _comparisons(study: Study, rows: Sequence[Row]) -> Iterator[list[str]]:
    """Yield tables of rates at equal quality."""
    if study.best:
        yield rate_table(rows, study.best, study.measures[:2])
        yield tables.bd_table(rows, study.best, study.measures)
    if study.anchor:
        yield tables.bd_table(rows, study.anchor, study.measures, is_anchor=True)
