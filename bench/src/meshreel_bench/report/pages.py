"""The pages of a report: results.md, and the same as one HTML file.

In -> out: rows, and the folders of pictures beside them -> files. A part an experiment, a section a sequence; then
what failed, and how all of it was made. No clock is asked.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from meshreel.io.write import make_folder, replacing

from ..curves import curve_of, repeated
from ..experiment import Experiment
from ..filenames import file_name
from ..provenance import makers
from ..reproducing import reproducing_page
from ..rows import Row, curve_rows, experiment_of, failed_rows, measured_rows
from .html import html_page
from .looks import Look, looks_of
from .plots import METRICS, plot_curves
from .sheets import Shots, draw_sheet, find_shots
from .tables import (
    DAGGER,
    NEAR,
    failure_table,
    is_near,
    maker_table,
    point_table,
    promise_table,
    sequences,
    text,
    without_html,
)

FOLDER = "results"  # of plots and sheets, beside the pages
TITLE = "meshreel: results"
SHEET = "-sheet"  # ends the names of sheets


@dataclass(frozen=True, slots=True)
class Part:
    """One experiment's rows, and where its plots and sheets go."""

    name: str
    chosen: Experiment
    rows: Sequence[Row]  # that were measured
    folder: Path

    def path(self, sequence: str, kind: str = "") -> Path:
        """Of a plot, or of a sheet by its ending."""
        return self.folder / FOLDER / f"{file_name(f'{self.name}-{sequence}')}{kind}.png"

    def link(self, sequence: str, told: str, kind: str = "") -> str:
        """The same in Markdown."""
        return f"![{text(sequence)}: {told}]({FOLDER}/{self.path(sequence, kind).name})"


def write_report(
    rows: Sequence[Row], experiments: Mapping[str, Experiment], folder: Path, pictures: Sequence[Path] = ()
) -> list[Path]:
    """Writes `results.md`, `index.html` and, per experiment and sequence, a plot as PNG and SVG; the paths.

    With rows of the paper's experiments, also `reproducing.md`.

    `experiments` are those that the rows may be of, by name, in the order of the page. `rows` may have some that
    failed. `pictures` are folders with the pictures that rows name, of which sheets are made: a file a sequence.
    """
    make_folder(folder / FOLDER)
    measured = measured_rows(rows)
    looks = looks_of(curve_of(row) for row in measured)
    files, lines = list[Path](), list[str]()
    for name, chosen in experiments.items():
        own = [row for row in measured if experiment_of(row) == name]
        if own:
            part = Part(name, chosen, own, folder)
            shots = {sequence: find_shots(curve_rows(own, sequence), pictures) for sequence in sequences(own)}
            files += _draw(part, looks, {sequence: found for sequence, found in shots.items() if found})
            lines += [*([""] if lines else []), *map(without_html, _part(part, shots))]
    lines += [*_failures(failed_rows(rows)), *_origin(rows, experiments)]
    # The page has the PNG of each plot; its SVG twin comes after it, and takes its place in HTML.
    inlined = {f"{FOLDER}/{path.with_suffix('.png').name}": path.read_bytes() for path in files}
    lines = [line for line, last in zip(lines, ["", *lines], strict=False) if line or last]  # no two empty ones
    pages = {"results.md": "\n".join(lines) + "\n", "index.html": html_page(TITLE, lines, inlined)}
    if told := reproducing_page(measured):
        pages["reproducing.md"] = "\n".join(told) + "\n"
    for page, content in pages.items():
        with replacing(folder / page) as file:
            file.write(content.encode(errors="backslashreplace"))
    return [*(folder / page for page in pages), *files]


def _draw(part: Part, looks: Mapping[str, Look], shots: Mapping[str, Shots]) -> Iterator[Path]:
    """Plots and sheets; their paths."""
    for sequence in sequences(part.rows):
        own = [row for row in part.rows if row["sequence"] == sequence]
        names = set(map(curve_of, own))
        here = {name: look for name, look in looks.items() if name in names}
        yield from plot_curves(own, part.chosen, here, part.path(sequence))
        if sequence in shots:
            yield draw_sheet(shots[sequence], part.path(sequence, SHEET))


def _part(part: Part, shots: Mapping[str, Shots | None]) -> Iterator[str]:
    """The Markdown of one experiment."""
    yield from (f"# Results of `{part.name}`", "")
    promises = part.chosen.promises(part.rows)
    if promises:
        yield from promise_table(promises)
    for sequence in sequences(part.rows):
        own = curve_rows(part.rows, sequence)
        yield from ("", f"## {text(sequence)}, {own[0]['frames']} frames", "")
        yield from (part.link(sequence, "quality against rate"), "")
        yield from _doubts(own)
        shown, metrics = part.chosen.shown(own), getattr(part.chosen, "METRICS", METRICS)
        yield from (*part.chosen.comparisons(own), "", *(point_table(shown, metrics) if shown else ()))
        if (found := shots[sequence]) is not None:
            yield from ("", *_sheet(part, found))
    yield from part.chosen.sections(part.rows)


def _doubts(rows: Sequence[Row]) -> Iterator[str]:
    """What a reader must know of the rows of a sequence before believing them."""
    if len(made := makers(rows)) > 1:
        yield from (f"Rows of more than one version: {text(', '.join(made))}.", "")
    for name, (apart, count) in repeated(rows).items():
        yield from (f"**{text(name)}: points apart: {apart} of {count}.** What is varied does nothing here.", "")


def _sheet(part: Part, shots: Shots) -> Iterator[str]:
    """The sheet and what it shows."""
    yield from (f"### {text(shots.sequence)} in pictures", "", part.link(shots.sequence, "pictures", SHEET), "")
    yield f"Frame {shots.frame} of the original and of each codec's point nearest to {shots.mbps:.3g} Mbps. Colors are"
    yield "normals; the solid red box magnifies the dotted one. Below: the error, in % of the diagonal."
    yield "Rates and qualities are those of all frames that were coded, and of those that were measured."
    if any(not is_near(files.row, shots.mbps) for files in shots.columns):
        yield f"{DAGGER} not within a factor of {NEAR:g} of that rate."
    if shots.left_out:
        yield f"Not shown, as their pictures are of another frame, scale or size: {text(', '.join(shots.left_out))}."


def _failures(rows: Sequence[Row]) -> Iterator[str]:
    if rows:
        yield from ("", "# What failed", "", "Of these points nothing was measured.", "", *failure_table(rows))


def _origin(rows: Sequence[Row], experiments: Mapping[str, Experiment]) -> Iterator[str]:
    """Command lines, and what made the rows."""
    found = {experiment_of(row) for row in rows}
    names = [name for name in experiments if name in found]
    if not names:
        return
    yield from ("", "# How this was made", "")
    told = "Of rows, of the pictures that these name, and of nothing else; the names of their files are free:"
    yield from (told, "", "```")
    for name in names:
        measured = sequences([row for row in rows if experiment_of(row) == name])
        declared = {point.sequence for point in experiments[name].points(False)}
        some = [] if declared <= set(measured) else ["--on", *measured]  # the others of what it declares have no rows
        yield " ".join(["meshreel bench run", name, f"-o {name}.jsonl --data DATA", *map(text, some)])
    yield from (f"meshreel bench report {' '.join(f'{name}.jsonl' for name in names)} -o FOLDER", "```", "")
    yield "Lines of plots join a codec's points in the order of their rates."
    yield from ("", *maker_table([row for row in rows if experiment_of(row) in names]))
