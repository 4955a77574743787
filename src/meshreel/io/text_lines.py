"""Lines of numbers in text files, parsed without a Python loop over the lines.

In: the bytes of a file. Out: flat values and their count in each line. Raises Unreadable with the line number of a word
that is no number.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int64

from .polygons import Unreadable

_IS_BLANK = np.isin(np.arange(256), list(b" \t\n\v\f"))


@dataclass(frozen=True, slots=True)
class Lines:
    """Text and the positions of its lines."""

    text: np.ndarray  # uint8, every line ended by a newline
    starts: Int64[np.ndarray, " L"]
    ends: Int64[np.ndarray, " L"]  # position of the newline

    @staticmethod
    def of(data: bytes, comment: bytes = b"#") -> Lines:
        """Return the lines of a text with any newlines, without comments and leading blanks; line numbers stay."""
        if b"\r" in data:
            data = data.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
        if comment in data:
            data = re.sub(re.escape(comment) + rb"[^\n]*", b"", data)
        if data[:1].isspace() or b"\n " in data or b"\n\t" in data:
            data = re.sub(rb"(?m)^[ \t\v\f]+", b"", data)
        text = np.frombuffer(data + b"\n", dtype=np.uint8)
        ends = np.flatnonzero(text == ord("\n"))
        return Lines(text, np.concatenate([[0], ends[:-1] + 1]), ends)

    def __len__(self) -> int:
        return len(self.starts)

    def line(self, number: int | np.integer) -> str:
        """Return one line, shortened for an error message."""
        shown = self.text[self.starts[number] : self.ends[number]].tobytes().decode("utf-8", "replace").strip()
        return shown if len(shown) <= 60 else shown[:57] + "..."

    def block(self, chosen: Int64[np.ndarray, " N"], skip: int = 0) -> np.ndarray:
        """Return the bytes (uint8) of the chosen lines with newlines, the first `skip` bytes of each blanked."""
        if len(chosen) == 0:
            return np.zeros(0, dtype=np.uint8)
        starts, sizes = self.starts[chosen], self.ends[chosen] + 1 - self.starts[chosen]
        if chosen[-1] - chosen[0] == len(chosen) - 1:  # consecutive lines, as nearly always, need no mask over the text
            block = self.text[starts[0] : starts[-1] + sizes[-1]].copy()
        else:
            wanted = np.zeros(len(self), dtype=bool)
            wanted[chosen] = True
            block = self.text[np.repeat(wanted, self.ends + 1 - self.starts)]
        begins = np.cumsum(sizes) - sizes
        for k in range(skip):
            block[begins + k] = ord(" ")
        return block

    def values(
        self, chosen: Int64[np.ndarray, " N"], block: np.ndarray
    ) -> tuple[Float64[np.ndarray, " M"], Int64[np.ndarray, " N"]]:
        """Return all numbers in a block of the chosen lines, and the count in each line."""
        counts = count_words(block)
        try:
            values = np.fromstring(block.tobytes(), dtype=np.float64, sep=" ")
        except ValueError:
            values = np.zeros(0)
        if len(values) != counts.sum():
            raise self._junk(chosen, block)
        return values, counts

    def _junk(self, chosen: Int64[np.ndarray, " N"], block: np.ndarray) -> Unreadable:
        for number, line in zip(chosen, block.tobytes().split(b"\n"), strict=False):
            for word in line.split():
                try:
                    float(word)
                except ValueError:
                    shown = word[:20].decode("utf-8", "replace")
                    return Unreadable(f"line {number + 1} ({self.line(number)!r}) has {shown!r} where a number must be")
        return Unreadable("a number is written in a way that cannot be read")


def count_words(block: np.ndarray) -> Int64[np.ndarray, " N"]:
    """Return the number of words in each line of a block (uint8, each line with its newline)."""
    if len(block) == 0:
        return np.zeros(0, dtype=np.int64)
    blank = _IS_BLANK[block]
    begins = ~blank
    begins[1:] &= blank[:-1]
    ends = np.flatnonzero(block == ord("\n"))
    return np.diff(np.searchsorted(np.flatnonzero(begins), ends), prepend=0)


def whole(values: np.ndarray, what: str) -> Int64[np.ndarray, "..."]:
    """Return the values as integers. Raises Unreadable for fractions, NaN, and magnitudes of 2^53 or more."""
    with np.errstate(invalid="ignore"):
        bad = np.flatnonzero(~((np.abs(values) < 2**53) & (values == np.floor(values))))
    if len(bad):
        raise Unreadable(f"{what} is {values.reshape(-1)[bad[0]]:g} where a whole number must be")
    return values.astype(np.int64)
