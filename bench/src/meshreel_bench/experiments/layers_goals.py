"""The targets of the experiment `layers` that a codec's own rows decide: points, groups, times.

In -> out: rows of one codec on one sequence -> a Promise each.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from ..bounds import Bound, bounds_text, judge
from ..curves import ANCHOR, SSIM_WITHOUT_KEYS
from ..groups import bytes_between
from ..names import title
from ..promises import Promise, of_row, of_rows
from ..rows import Row

HALF = 30  # frames
VERTICES = 16_000  # of a decoded frame, that the decoding target is about


@dataclass(frozen=True, slots=True)
class Goal:
    """Bounds that one point of a sequence has to keep together."""

    sequence: str
    text: str
    bounds: tuple[Bound, ...]


def _rate(limit: float) -> Bound:
    return Bound("mbps", limit, "Mbps", least=False)


def _distance(limit: float) -> Bound:
    return Bound("d2_psnr_paper", limit, "dB")


def _normals(limit: float) -> Bound:
    return Bound("normal_error_deg", limit, "degrees", least=False)


GOALS = (
    Goal(
        "dancer",
        "dancer: rate, D2 in the paper's form, normals, SSIM without key frames (released code 5.8 Mbps at 56.4 dB)",
        (_rate(0.34), _distance(64.0), _normals(5.3), Bound(SSIM_WITHOUT_KEYS, 0.86, "SSIM")),
    ),
    Goal("dancer", "dancer, high: rate, D2, normals", (_rate(1.0), _distance(67.9), _normals(4.1))),
    Goal(
        "basketball_player",
        "basketball_player: rate, D2, normals, worst frame's D2",
        (_rate(0.39), _distance(65.0), _normals(4.3), Bound("d2_psnr_paper_worst", 62.0, "dB")),
    ),
    Goal("mitch", "mitch: rate, D2, normals", (_rate(0.27), _distance(70.0), _normals(3.4))),
)


def goal(wanted: Goal, rows: Sequence[Row]) -> Promise:
    """Whether some point keeps all bounds; the nearest is told where none does."""
    return of_rows(wanted.text, bounds_text(wanted.bounds), rows, lambda found: judge(found, wanted.bounds))


def halves(body: str, rows: Sequence[Row]) -> Promise:
    """Whether a long sequence costs no more in its second half, at every point."""

    def measure(rows: Sequence[Row]) -> tuple[str, bool]:
        ratios = {r["options"]["quality"]: _second_over_first(r) for r in rows}
        told = ", ".join(f"{ratio:.3f} at quality {quality:g}" for quality, ratio in sorted(ratios.items()))
        return told, max(ratios.values()) <= 1

    text = f"{body}: bytes of frames {HALF + 1} to {2 * HALF} over those of 1 to {HALF}"
    return of_rows(text, "<= 1 at every point", [row for row in rows if row["frames"] >= 2 * HALF], measure)


def place(body: str, forth: Sequence[Row], back: Sequence[Row]) -> Promise:
    """Whether frames cost more because they come later: what moves more costs more wherever it is, so both ways count.

    A half coded second over the same half coded first, the geometric mean of both halves.
    """
    text = f"{body}: bytes of a half that comes second over those of the same half coming first (played both ways)"
    first = {row["options"]["quality"]: row for row in forth if row["frames"] >= 2 * HALF}
    pairs = [(first[row["options"]["quality"]], row) for row in back if row["options"]["quality"] in first]
    if not pairs:
        return Promise(text, "<= 1")
    ratios = {a["options"]["quality"]: (_second_over_first(a) * _second_over_first(b)) ** 0.5 for a, b in pairs}
    told = ", ".join(f"{ratio:.3f} at quality {quality:g}" for quality, ratio in sorted(ratios.items()))
    return Promise(text, "<= 1", told, max(ratios.values()) <= 1)


def no_loser(rows: Sequence[Row]) -> Promise:
    """Whether no group costs more than the cheapest per-frame Draco form of its quality."""
    known = [row for row in rows if all("draco_bytes" in group for group in row["groups"])]

    def measure(rows: Sequence[Row]) -> tuple[str, bool]:
        groups = [group for row in rows for group in row["groups"]]
        lost = [g for g in groups if g["draco_bytes"] is not None and g["draco_bytes"] < g["bytes"]]
        return f"{len(lost)} of {len(groups)}", not lost

    return of_rows("collision: groups that the `draco` form of equal quality would make smaller", "0", known, measure)


def no_bridges(rows: Sequence[Row]) -> Promise:
    """Whether no decoded triangle joins bodies that are apart."""

    def measure(rows: Sequence[Row]) -> tuple[str, bool]:
        count = sum(sum(row["bridges"]) for row in rows)
        return str(count), count == 0

    return of_rows("collision: decoded triangles that bridge the bodies once they are apart", "0", rows, measure)


def quick_encode(rows: Sequence[Row]) -> Promise:
    """CPU seconds a frame of the slowest point."""

    def measure(rows: Sequence[Row]) -> tuple[str, bool]:
        slow = max(rows, key=lambda r: r["encode_s"])
        least = min(row["encode_s"] for row in rows)
        return f"{least:.2f} to {slow['encode_s']:.2f} (quality {slow['options']['quality']:g})", slow["encode_s"] <= 4

    return of_rows("encode, dancer, slowest point", "<= 4 CPU s/frame", rows, measure)


def quick_decode(rows: Sequence[Row]) -> list[Promise]:
    """Decoding from bytes, steady state, one thread: ms a frame, and over the anchor's of equal quality."""
    row = min(rows, key=lambda r: abs(r["vertices"] - VERTICES), default=None)

    def time(row: Row) -> tuple[str, bool]:
        at = f"for {row['vertices']:.0f} vertices at quality {row['options']['quality']:g}"
        return f"{row['frame_ms']:.2f} ms {at}", row["frame_ms"] <= 1.5

    def ratio(row: Row) -> tuple[str, bool]:
        plain, free = row["frame_ms"] / row["draco_ms"], row["frame_ms"] / row["subdivided_ms"]
        anchor = row["anchor"]
        told = f"{plain:.2f} (of {row['draco_ms']:.2f} ms), with free subdivision {free:.2f}"
        equal = f"{title(ANCHOR)} at {anchor['mbps']:.3f} Mbps, {anchor['d2_psnr_paper']:.2f} dB"
        return f"{told} (of {row['subdivided_ms']:.2f} ms); {equal}", plain <= 1

    return [
        of_row("decode, dancer, steady state, one thread", "<= 1.5 ms/frame at 16k vertices", row, time),
        of_row(
            "the same over DracoPy on the stream of the subdivided anchor of equal D2, same run", "<= 1", row, ratio
        ),
    ]


def _second_over_first(row: Row) -> float:
    return bytes_between(row, HALF, 2 * HALF) / bytes_between(row, 0, HALF)
