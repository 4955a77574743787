"""A promise: something the project set out to reach, and what was measured. `bench run` prints it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from .rows import Row

FRAMES = 10  # of a sequence, that targets are about


@dataclass(frozen=True, slots=True)
class Promise:
    """A target and its measured value; `value` and `met` are None where no row tells."""

    text: str
    bound: str
    value: str | None = None
    met: bool | None = None

    @property
    def verdict(self) -> str:
        """One word."""
        return {None: "not measured", True: "met", False: "MISSED"}[self.met]


Reading = Callable[[Row], tuple[str, bool]]


def of_row(text: str, bound: str, row: Row | None, measure: Reading) -> Promise:
    """The promise as `measure` finds it in a row: the value as text, and whether it holds."""
    return Promise(text, bound) if row is None else Promise(text, bound, *_told(measure(row), [row]))


def of_rows(
    text: str, bound: str, rows: Sequence[Row], measure: Callable[[Sequence[Row]], tuple[str, bool]]
) -> Promise:
    """The same over several rows; not measured where there are none."""
    return Promise(text, bound, *_told(measure(rows), rows)) if rows else Promise(text, bound)


def _told(measured: tuple[str, bool], rows: Sequence[Row]) -> tuple[str, bool]:
    """The same; a run on fewer frames than the target's says so."""
    frames = min(row["frames"] for row in rows)
    return (measured[0] if frames >= FRAMES else f"{measured[0]} ({frames} frames only)"), measured[1]


def flat_memory(rows: Sequence[Row], sequence: str = "collision") -> Promise:
    """Whether the longest of some encodes needs no more memory than the shortest."""
    text = f"memory of an encode does not grow with the number of frames ({sequence})"
    if len(rows) < 2:
        return Promise(text, "within 10 %")
    few, many = (pick(rows, key=lambda r: r["frames"]) for pick in (min, max))
    growth = many["peak_rss_mb"] / few["peak_rss_mb"] - 1
    value = f"{few['peak_rss_mb']:.0f} MB at {few['frames']} frames, {many['peak_rss_mb']:.0f} at {many['frames']}"
    return Promise(text, "within 10 %", f"{value}: {100 * growth:+.1f} %", growth <= 0.1)
