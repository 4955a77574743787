"""Rate-distortion curves made from rows: by codec, their hull, and Bjontegaard rates as lines of text.

In -> out: rows of one sequence -> curves, lines of Markdown. Quality may be anything `value` finds in a row.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from meshreel.metrics.bd_rate import BdRate, Curve, GainEnd, bd_rate, gain_end, hull

from .groups import without_keys
from .rows import Row

ANCHOR = "decimated_draco_subdivided"
ANCHORS = ("draco", "decimated_draco", ANCHOR)  # their hull is the strongest per-frame anchor
HULL = "hull of the anchors"
USUAL = {"centers": 2000, "group_size": 10}  # the paper's own
SSIM_WITHOUT_KEYS = "ssim_masked_without_keys"


@dataclass(frozen=True, slots=True)
class Measure:
    """A quality that curves are compared by."""

    key: str
    name: str
    unit: str
    sign: int = 1  # -1 where smaller is better
    least: float = 0.0  # an overlap of two curves below which nothing is said of them

    @property
    def label(self) -> str:
        """Its name with its unit."""
        return f"{self.name} ({self.unit.strip()})" if self.unit else self.name

    def shown(self, quality: float) -> str:
        """A quality of a curve, with its unit and its own sign."""
        return f"{self.sign * quality:.4g}{self.unit}"


D2_PAPER = Measure("d2_psnr_paper", "D2, paper form", " dB")
SYMMETRIC = Measure("symmetric_psnr", "symmetric D2", " dB")
NORMALS = Measure("normal_error_deg", "normal error", " degrees", -1)
SSIM = Measure(SSIM_WITHOUT_KEYS, "masked SSIM without keys", "")
JUDGED = (SYMMETRIC, NORMALS, SSIM)
MEASURES = (D2_PAPER, *JUDGED)


@dataclass(frozen=True, slots=True)
class Against:
    """A codec against another curve by one measure."""

    measure: Measure
    rate: BdRate
    end: GainEnd

    def __str__(self) -> str:
        if self.rate.percent is None:
            return f"{self.measure.name}: no BD-rate ({self.rate.reason})"
        overlap = f"{self.measure.shown(self.rate.low)} to {self.measure.shown(self.rate.high)}"
        ends = "" if self.end.quality is None else f", gain up to {self.measure.shown(self.end.quality)}"
        return f"{self.measure.name} {self.rate.percent:+.1f} % ({overlap}{ends}: {self.end.where})"


def value(row: Row, key: str) -> float | None:
    """What a row says of `key`; SSIM without key frames is made from its frames and groups."""
    found = without_keys(row, "ssim_masked") if key == SSIM_WITHOUT_KEYS else row.get(key)
    return None if found is None else float(found)


def curve(rows: Sequence[Row], name: str, measure: Measure) -> Curve:
    """The points of the rows that have the measure; larger is better."""
    found = [(row["mbps"], value(row, measure.key)) for row in rows]
    points = [(mbps, measure.sign * quality) for mbps, quality in found if quality is not None]
    return Curve(name, [p[0] for p in points], [p[1] for p in points])


def curve_of(row: Row) -> str:
    """The curve that a point belongs to: a codec, and where the basis is fixed, what else is not the preset's own."""
    options, name = row["options"], str(row["codec"])
    if options.get("basis_size") is None:
        return name
    quality = options.get("quality")
    told = [f"quality {quality:g}"] if isinstance(quality, (int, float)) else []  # codecs of others have other options
    for key, usual in USUAL.items():
        told += [f"{key} {options[key]}"] if options.get(key) not in (None, usual) else []
    return ", ".join([name, *told])


def repeated(rows: Sequence[Row]) -> dict[str, tuple[int, int]]:
    """Of the curves of one sequence that have a point twice: how many points are apart, and how many there are.

    An option that changes neither rate nor qualities does nothing there, or not what it should.
    """
    points: dict[str, list[tuple[float | None, ...]]] = {}
    for row in rows:
        found = (float(row["mbps"]), *(value(row, measure.key) for measure in MEASURES))
        points.setdefault(curve_of(row), []).append(found)
    return {name: (len(set(own)), len(own)) for name, own in points.items() if len(set(own)) < len(own)}


def anchor_hull(rows: Sequence[Row], measure: Measure) -> Curve:
    """The hull of all anchors among the rows of one sequence."""
    return hull(HULL, [curve([r for r in rows if r["codec"] == name], name, measure) for name in ANCHORS])


def against(anchor: Curve, test: Curve, measure: Measure) -> Against:
    """BD-rate of a curve against another, and where the gain ends."""
    return Against(measure, bd_rate(anchor, test), gain_end(anchor, test))


def against_hull(rows: Sequence[Row], codec: str, measure: Measure) -> Against:
    """A codec's rows against the hull of the anchors, on the rows of one sequence."""
    own = curve([row for row in rows if curve_of(row) == codec], codec, measure)
    return against(anchor_hull(rows, measure), own, measure)


def hull_lines(rows: Sequence[Row]) -> Iterator[str]:
    """Every codec that is no anchor against the hull of the anchors, by every measure."""
    for codec in dict.fromkeys(map(curve_of, rows)):
        if codec not in ANCHORS:
            for measure in MEASURES:
                yield f"- BD-rate of {codec} against the {HULL}: {against_hull(rows, codec, measure)}"


def bd_lines(rows: Sequence[Row]) -> Iterator[str]:
    """Every codec against the subdivided anchor, by distance and by normal error."""
    for measure in (D2_PAPER, SYMMETRIC, NORMALS):
        names = list(dict.fromkeys(map(curve_of, rows)))
        curves = {name: curve([r for r in rows if curve_of(r) == name], name, measure) for name in names}
        if ANCHOR in curves:
            for name in names:
                if name != ANCHOR:
                    yield f"- BD-rate of {name} against {ANCHOR}: {against(curves[ANCHOR], curves[name], measure)}"


def on_hull(rows: Sequence[Row]) -> list[Row]:
    """The anchors' rows that are on the hull by some measure, of the rows of one sequence."""
    anchors = [row for row in rows if row["codec"] in ANCHORS]
    hulls = [(measure, anchor_hull(anchors, measure)) for measure in MEASURES]
    return [row for row in anchors if any(_is_point(row, measure, points) for measure, points in hulls)]


def _is_point(row: Row, measure: Measure, points: Curve) -> bool:
    quality = value(row, measure.key)
    if quality is None:
        return False
    return (row["mbps"], measure.sign * quality) in zip(points.rates, points.qualities, strict=True)
