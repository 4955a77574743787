"""Lines of numbers in text files, parsed by the core.

In: the bytes of a file. Out: flat values and their count in each line. Raises Unreadable, with the line's number, for a
word that is no number.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int64, UInt8

from .. import _core
from .polygons import Unreadable


@dataclass(frozen=True, slots=True)
class Lines:
    """Text and the positions of its lines."""

    text: UInt8[np.ndarray, " B"]
    starts: Int64[np.ndarray, " L"]  # behind leading blanks
    ends: Int64[np.ndarray, " L"]  # before comments and newlines: text goes on behind each of them

    @staticmethod
    def of(data: bytes, comment: str = "#") -> Lines:
        """Return the lines of a text with any newlines, without comments and leading blanks."""
        text = np.frombuffer(data + b"\n", dtype=np.uint8)
        starts, ends = _core.split_lines(text[:-1], comment)
        return Lines(text, starts.view(np.int64), ends.view(np.int64))  # of the same size, by its usual name

    def __len__(self) -> int:
        return len(self.starts)

    def whole(self, number: int | np.integer) -> str:
        """Return one line."""
        return self.text[self.starts[number] : self.ends[number]].tobytes().decode("utf-8", "replace").strip()

    def line(self, number: int | np.integer) -> str:
        """Return one line, shortened for an error message."""
        text = self.whole(number)
        return text if len(text) <= 60 else text[:57] + "..."

    def values(
        self, chosen: Int64[np.ndarray, " N"], skip: int = 0, stop: str = "", field: int = 0
    ) -> tuple[Float64[np.ndarray, " M"], Int64[np.ndarray, " N"]]:
        """Return all numbers of the chosen lines, without their first `skip` bytes, and the count in each line.

        A number ends at the letter `stop` in a word. A `field` above 0 selects the text behind this many of these
        letters, NaN if that is no number.
        """
        starts, ends = self.starts[chosen] + skip, self.ends[chosen]
        values, counts, bad = _core.read_numbers(self.text, starts, ends, stop or "\0", field)
        if bad >= 0:
            number = int(np.searchsorted(self.starts, bad, side="right")) - 1
            word = self.text[bad : self.ends[number]].tobytes().split()[0]
            start = (word.split(stop.encode())[0] if stop else word)[:20].decode("utf-8", "replace")
            raise Unreadable(f"line {number + 1} ({self.line(number)!r}) has {start!r} where a number must be")
        return values, counts.astype(np.int64)


def whole(values: np.ndarray, what: str) -> Int64[np.ndarray, "..."]:
    """Return the values as integers. Raises Unreadable for fractions, NaN, and magnitudes of 2^53 or more."""
    if np.can_cast(values.dtype, np.int64):
        return values.astype(np.int64)
    with np.errstate(invalid="ignore"):
        bad = np.flatnonzero(~((np.abs(values) < 2**53) & (values == np.floor(values))))
    if len(bad):
        raise Unreadable(f"{what} is {values.reshape(-1)[bad[0]]:g} where a whole number must be")
    return values.astype(np.int64)
