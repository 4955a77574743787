"""Ablation: the preset `best` with one part switched off at a time, against the whole, at equal quality.

A part is a variant of `evaluation.variants`; PARTS names those that are run.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from ..curves import JUDGED, Measure, against, curve
from ..promises import Promise
from ..rows import Point, Row, curve_rows
from . import layers

BODIES = ("dancer",)
WHOLE = (20.0, 50.0, 80.0)  # qualities of the whole: its curve reaches around every variant's
QUALITIES = (35.0, 65.0)  # of the variants
PARTS = (
    "no shared detail",
    "middle key, no cuts",
    "flat midpoints",
    "plain rounding",
    "errors along the surface count",
    "no tails",
)
GROUPS = "groups alone"  # shows only where there are several groups
LONG = ("crane60", 32)  # frames
COMPARISON = layers.COMPARISON


def points(small: bool) -> Iterator[Point]:
    """The whole and every variant; on three frames of one body where `small`."""
    frames, bodies = (3, BODIES[:1]) if small else (None, BODIES)
    for body in bodies:
        for quality in WHOLE:
            yield _point(body, quality, frames)
        for part in PARTS:
            yield from (_point(body, quality, frames, part) for quality in QUALITIES)
    if not small:
        body, frames = LONG
        yield from (_point(body, quality, frames) for quality in QUALITIES)
        yield from (_point(body, quality, frames, GROUPS) for quality in QUALITIES)


def references(_sequence: str) -> dict[str, list[tuple[float, float]]]:
    """Curves that were not measured here: none."""
    return {}


def promises(_rows: Sequence[Row]) -> list[Promise]:
    """Nothing is promised of a part."""
    return []


def comparisons(_rows: Sequence[Row]) -> Iterator[str]:
    """Nothing a sequence: the table of all is in `sections`."""
    return iter(())


def shown(rows: Sequence[Row]) -> list[Row]:
    """The rows of one sequence that its table has: all."""
    return list(rows)


def sections(rows: Sequence[Row]) -> Iterator[str]:
    """The table: change of rate against the whole at equal distance, normals and SSIM, a line a part and body."""
    bodies = [body for body in BODIES if curve_rows(rows, body, _name(None))]
    if not bodies:
        return
    heads = [f"rate at equal {measure.name}" for measure in JUDGED]
    yield from ("", "## What each part is worth", "", "Positive: without the part more rate is needed.", "")
    yield f"| part | sequence | {' | '.join(heads)} |"
    yield "|" + "---|" * (2 + len(heads))
    for part in PARTS:
        for body in bodies:
            cells = [_change(rows, body, part, measure) for measure in JUDGED]
            yield f"| {part} | {body} | {' | '.join(cells)} |"
    cells = [_change(rows, LONG[0], GROUPS, measure) for measure in JUDGED]
    yield f"| {GROUPS} | {LONG[0]}, {LONG[1]} frames | {' | '.join(cells)} |"


def _change(rows: Sequence[Row], body: str, part: str, measure: Measure) -> str:
    whole, other = (curve(curve_rows(rows, body, _name(p)), p or "whole", measure) for p in (None, part))
    found = against(whole, other, measure).rate
    if found.percent is None:
        return "not measured" if not other.rates else found.reason
    return f"{found.percent:+.1f} % ({measure.shown(found.low)} to {measure.shown(found.high)})"


def _point(body: str, quality: float, frames: int | None, part: str | None = None) -> Point:
    options: dict[str, Any] = {"preset": layers.PRESET, "quality": quality}
    if part is not None:
        options["variant"] = part
    return Point(body, "meshreel", options, frames, "curve")


def _name(part: str | None) -> str:
    return f"meshreel {layers.PRESET}" + ("" if part is None else f", {part}")
