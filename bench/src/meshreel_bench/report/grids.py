"""Where pictures, captions and the scale of a sheet are on its page.

In -> out: names of columns, the shape of a picture -> places as shares of the figure, as matplotlib has them.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

from .plots import WIDTH

LETTERS = 6.4  # points
_COLUMNS = 6  # side by side at most: more are in bands, one below the other
_WIDEST = 1.7  # inches of a column
_GAP = 0.05  # inches
_LINE = 1.3 * LETTERS / 72  # inches from one line to the next
_LETTER = 0.65 * LETTERS / 72  # inches that a letter is wide, at most on average
_SCALE = 0.5  # inches that the scale is high, with its numbers and words
_BAR = 0.08  # inches that it is high without

Place = tuple[float, float, float, float]  # left, bottom, width, height


@dataclass(frozen=True, slots=True)
class Grid:
    """Bands of columns; a column is a picture, another one, the lines of its name and lines of numbers."""

    names: tuple[list[str], ...]  # of the columns, in lines
    across: int  # columns side by side
    width: float  # of a picture, inches
    height: float
    numbers: int  # lines of a caption below the name

    @classmethod
    def of(cls, names: Sequence[str], shape: tuple[int, int], numbers: int) -> Grid:
        """As wide as a page, or less where there are few columns; `shape` is the pictures' height and width."""
        bands = -(-len(names) // _COLUMNS)
        across = -(-len(names) // bands)
        width = min(_WIDEST, (WIDTH - (across - 1) * _GAP) / across)
        wrapped = tuple(_wrapped(name, int(width / _LETTER)) for name in names)
        return cls(wrapped, across, width, width * shape[0] / shape[1], numbers)

    @property
    def size(self) -> tuple[float, float]:
        """Width and height of all, inches."""
        bands = -(-len(self.names) // self.across)
        return self.across * (self.width + _GAP) - _GAP, bands * self._band

    @property
    def name_lines(self) -> int:
        """Of the longest name: numbers of all columns are below it."""
        return max(map(len, self.names))

    def picture(self, column: int, row: int) -> Place:
        """One of the two pictures of a column."""
        left, top = self._corner(column)
        return self._place(left, top + row * (self.height + _GAP), self.width, self.height)

    def line(self, column: int, number: int, row: int = 1) -> tuple[float, float]:
        """The top middle of a line of text below a picture."""
        left, top = self._corner(column)
        top += (row + 1) * (self.height + _GAP) + number * _LINE
        return (left + self.width / 2) / self.size[0], 1 - top / self.size[1]

    def bar(self, lines: int) -> Place:
        """The scale: below so many lines below the first picture, in the middle of what is left there."""
        above = self.height + _GAP + lines * _LINE
        top = above + max(0.0, (self._band - _GAP - above - _SCALE) / 2)
        return self._place(0.12 * self.width, top, 0.76 * self.width, _BAR)

    @property
    def _band(self) -> float:
        return 2 * (self.height + _GAP) + (self.name_lines + self.numbers + 1) * _LINE

    def _corner(self, column: int) -> tuple[float, float]:
        return column % self.across * (self.width + _GAP), column // self.across * self._band

    def _place(self, left: float, top: float, width: float, height: float) -> Place:
        wide, high = self.size
        return left / wide, 1 - (top + height) / high, width / wide, height / high


def _wrapped(name: str, letters: int) -> list[str]:
    """A name in lines of so many letters, broken behind spaces and underscores where it can be."""
    lines = [""]
    for part in re.findall(r"[^ _]*[ _]?", name)[:-1]:
        if lines[-1] and len(lines[-1]) + len(part.rstrip()) > letters:
            lines.append("")
        lines[-1] += part
    return lines
