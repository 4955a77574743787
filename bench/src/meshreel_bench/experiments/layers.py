"""Layers: meshreel's preset `best` against the hull of all per-frame anchors, and all that was promised of it.

Ten frames each of captured performers, sixty of two bodies that are remeshed in every frame, and sixty of two shapes
that collide; 30 frames a second, every byte counted, metrics over all frames.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import chain
from typing import Any

from meshreel.metrics.comparison import ComparisonOptions
from meshreel.metrics.viewpoints import ParallelViewOptions

from ..curves import ANCHOR, ANCHORS, HULL, JUDGED, MEASURES, SYMMETRIC, Against, against_hull, hull_lines, on_hull
from ..datasets import REMESHED
from ..groups import at_borders, by_distance
from ..promises import Promise, flat_memory
from ..rows import Point, Row, curve_rows, select
from . import targets
from .layers_goals import GOALS, goal, halves, no_bridges, no_loser, place, quick_decode, quick_encode

PRESET = "best"
COMPARISON = ComparisonOptions(views=ParallelViewOptions())  # four parallel views of 512 x 512 pixels
QUALITIES: dict[str, tuple[float, ...]] = {
    "dancer": (5, 20, 35, 45, 50, 65, 80, 95),
    "basketball_player": (5, 20, 35, 50, 65, 80, 95),
    "mitch": (50, 65, 67.5, 69, 80),
    "crane60": (25, 50, 75),
    "samba60": (25, 50, 75),
}
PAPER = (50.0,)  # qualities of the preset that the curves are shown beside
PAPER_ON = ("dancer", "basketball_player")
COLLISION = 50.0
BACKWARDS = 50.0  # quality at which the remeshed bodies are played in reverse, too
DECODED = (35.0, 50.0, 65.0)  # qualities at which decoding is timed, on dancer
# Fraction of the vertices and bits of the anchors: those on or next to the hull of a full sweep on one frame. Free
# subdivision changes neither rate nor distance, and normals for the better below half of the vertices: A2 needs few
# points. QEM leaves 5 % of a remeshed body at least.
DRACO = (9, 10, 11)
DECIMATED = ((0.06, 9), (0.12, 10), (0.3, 11), (0.5, 11), (0.75, 12))
SUBDIVIDED = (
    *((0.015, 8), (0.02, 8), (0.03, 8), (0.03, 9), (0.04, 8), (0.04, 9), (0.06, 8), (0.06, 9), (0.08, 9), (0.08, 10)),
    *((0.12, 10), (0.2, 10), (0.2, 11), (0.3, 11), (0.3, 12), (0.5, 11), (0.5, 12), (0.75, 12)),
)
SUBDIVIDED_REMESHED = ((0.05, 7), (0.08, 8), (0.12, 9), (0.2, 10), (0.3, 11), (0.5, 11))
SUBDIVIDED_SOME = ((0.03, 8), (0.12, 10), (0.75, 12))  # for the eye: nothing is judged by it
FEW = ("mitch", "crane60", "samba60")  # one point each of Draco and of A2, which are off the hull there
SWEEPS = {"mitch": SUBDIVIDED_SOME, "crane60": SUBDIVIDED_REMESHED, "samba60": SUBDIVIDED_REMESHED[1::2]}
LEAST_GAIN = -60.0  # % of the anchors' rate, on the performers
PROUD = -70.0  # the figure to be proud of, and the bound on the remeshed bodies
GAIN_ENDS = 70.0  # dB


def points(small: bool) -> Iterator[Point]:
    """All operating points; a handful on three frames where `small`."""
    if small:
        yield from _small_points()
        return
    for body, qualities in QUALITIES.items():
        yield from (_best(body, quality) for quality in qualities)
    yield _best("collision", COLLISION, kind="floor")
    for body in REMESHED:
        yield _best(body, BACKWARDS, kind="backwards")
    for body in PAPER_ON:
        yield from (Point(body, "meshreel", {"preset": "paper", "quality": quality}) for quality in PAPER)
    for body in QUALITIES:
        yield from anchors(body)
    for frames in (20, 60):
        yield _best("collision", COLLISION, frames, "memory")
    for quality in DECODED:
        yield _best("dancer", quality, kind="decode")


def anchors(body: str, frames: int | None = None) -> Iterator[Point]:
    """The points that make the hull on a sequence."""
    for qp in DRACO[:1] if body in FEW else DRACO:
        yield Point(body, "draco", {"qp": qp}, frames, "curve")
    for levels, sweep in ((1, SWEEPS.get(body, SUBDIVIDED)), (0, DECIMATED[2:3] if body in FEW else DECIMATED)):
        for fraction, qp in sweep:
            yield Point(body, "decimated_draco", {"fraction": fraction, "qp": qp, "levels": levels}, frames, "curve")


def references(sequence: str) -> dict[str, list[tuple[float, float]]]:
    """Curves that were not measured here: the authors' released code."""
    return targets.references(sequence)


def promises(rows: Sequence[Row]) -> list[Promise]:
    """The targets, with what the rows say."""
    codec = _codec()
    own = {body: curve_rows(rows, body, codec) for body in (*QUALITIES, "collision")}
    found = [goal(wanted, own[wanted.sequence]) for wanted in GOALS]
    for body in REMESHED:
        back = select(rows, body, codec, "backwards")
        found += [_gain(rows, body, PROUD), halves(body, own[body]), place(body, own[body], back)]
    found += [no_loser(own["collision"]), no_bridges(own["collision"])]
    for body in ("dancer", "basketball_player"):
        found += [_gain(rows, body, LEAST_GAIN), _end(rows, body)]
    decoded = select(rows, "dancer", codec, "decode")
    return [
        *found,
        quick_encode(own["dancer"]),
        flat_memory(select(rows, "collision", "meshreel", "memory")),
        *quick_decode(decoded),
    ]


def comparisons(rows: Sequence[Row]) -> Iterator[str]:
    """Lines of Markdown on the rows of one sequence: BD-rates against the hull, and where each gain ends."""
    if any(row["codec"] in ANCHORS for row in rows):
        yield from hull_lines(rows)


def shown(rows: Sequence[Row]) -> list[Row]:
    """The rows of one sequence that its table has: of the anchors, those on the hull."""
    kept = on_hull(rows)
    return [row for row in rows if row["codec"] not in ANCHORS] + sorted(kept, key=lambda row: row["mbps"])


def sections(rows: Sequence[Row]) -> Iterator[str]:
    """How quality falls with the distance from the key frame, and what a border of groups shows."""
    codec = _codec()
    lines = []
    for row in chain.from_iterable(curve_rows(rows, body, codec) for body in (*QUALITIES, "collision")):
        if not row.get("groups") or "ssim_masked" not in row["per_frame"][0]:
            continue
        told = ", ".join(f"{away}: {mean:.3f}" for away, mean, _ in by_distance(row, "ssim_masked"))
        border = at_borders(row, "ssim_masked")
        sizes = "+".join(str(group["frames"]) for group in row["groups"])
        step = "" if border is None else f"{border:.4f}"
        lines.append(f"| {row['sequence']} | {row['options']['quality']:g} | {sizes} | {told} | {step} |")
    if lines:
        text = "A key frame that the file does not name is taken to be the best of its group."
        yield from ("", "## Masked SSIM by the distance from the key frame", "", text, "")
        yield from (
            "| sequence | quality | groups | frames from the key: SSIM | mean step at a border |",
            "|---|---|---|---|---|",
        )
        yield from lines


def _codec() -> str:
    return f"meshreel {PRESET}"


def _best(body: str, quality: float, frames: int | None = None, kind: str = "quality") -> Point:
    options: dict[str, Any] = {"preset": PRESET, "quality": float(quality)}
    return Point(body, "meshreel", options, frames, kind)


def _small_points() -> Iterator[Point]:
    for quality in (30.0, 70.0):
        yield _best("dancer", quality, 3)
    yield _best("crane60", 50.0, 4)
    yield _best("collision", COLLISION, 4, "floor")
    for fraction, qp in ((0.02, 8), (0.04, 9), (0.12, 10), (0.5, 11), (1.0, 12)):
        yield Point("dancer", "decimated_draco", {"fraction": fraction, "qp": qp, "levels": 1}, 3, "curve")
    for frames in (4, 8):
        yield _best("collision", COLLISION, frames, "memory")
    yield _best("dancer", 30.0, 3, "decode")


def _gain(rows: Sequence[Row], body: str, most: float) -> Promise:
    """BD-rate against the hull by distance, normals and pictures; all have to keep the bound."""
    text = f"{body}: BD-rate against the {HULL}"
    bound = f"<= {most:g} % each" + ("" if most == PROUD else f" (aim {PROUD:g} %)")
    found = _against(rows, body)
    if not found:
        return Promise(text, bound)
    met = all(one.rate.percent is not None and one.rate.percent <= most for one in found if one.measure in JUDGED)
    return Promise(text, bound, "; ".join(map(str, found)), met)


def _end(rows: Sequence[Row], body: str) -> Promise:
    """Up to which quality there is a gain."""
    text, bound = f"{body}: the gain in symmetric D2 ends past", f">= {GAIN_ENDS:g} dB"
    found = [one for one in _against(rows, body) if one.measure == SYMMETRIC]
    if not found:
        return Promise(text, bound)
    [one] = found
    if one.end.quality is None:
        return Promise(text, bound, one.end.where, False)
    return Promise(text, bound, f"{one.end.quality:.2f} dB ({one.end.where})", one.end.quality >= GAIN_ENDS)


def _against(rows: Sequence[Row], body: str) -> list[Against]:
    """Every measure against the hull; empty where the codec or the anchors were not measured."""
    own = curve_rows(rows, body)
    if {_codec(), ANCHOR} <= {row["codec"] for row in own}:
        return [against_hull(own, _codec(), measure) for measure in MEASURES]
    return []
