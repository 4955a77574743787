"""Where a sheet's pictures are cut, and what of them is magnified where.

In -> out: normal-colored pictures of one view, white where nothing is -> rectangles in their pixels. All columns of a
sheet have the same ones.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float64, Shaped, UInt8

from meshreel.metrics.render import Window

WHITE = 255  # of all channels: `render.BACKGROUND` in a file
SHARE = 5  # the box is a fifth of the picture's height and width
COVERED = 0.7  # least share of the box's pixels that the surface covers
_SMALLEST = 8  # pixels of a side of a box
_INSET = 0.4  # of the picture's height and width, at most
_INSET_OF_CUT = 0.5  # of the longer side of what is shown, at most
_MARGIN = 0.02  # of the longer side, around what is shown
_DENSE = 0.8  # share of covered pixels from which on there is no room for an inset beside the surface
_STEPS = 20  # widths of white that are tried beside the surface
_PADDING = 0.5  # what white as wide as the longer side costs, in insets that hide surface alone


@dataclass(frozen=True, slots=True)
class Layout:
    """Rectangles in the pixels of the pictures; they may reach beyond these, where all is white."""

    cut: Window  # what is shown
    box: Window | None  # what is magnified; None where no part is covered enough
    inset: Window | None  # where it is shown magnified


def layout_of(original: UInt8[np.ndarray, "H W 3"], others: Sequence[UInt8[np.ndarray, "H W 3"]]) -> Layout:
    """What is shown of the original and of the other pictures, so that nothing that any has is cut off."""
    covered = np.any([is_covered(picture) for picture in (original, *others)], axis=0)
    cut, box = _around(covered), detail_box(original)
    if box is None:
        return Layout(cut, None, None)
    cut = Window(min(cut.top, box.top), max(cut.bottom, box.bottom), min(cut.left, box.left), max(cut.right, box.right))
    return Layout(*_place_inset(covered, cut, box))


def is_covered(picture: UInt8[np.ndarray, "H W 3"]) -> Bool[np.ndarray, "H W"]:
    """The pixels where there is a surface: no unit normal is white."""
    return np.asarray((picture != WHITE).any(axis=2))


def detail_box(picture: UInt8[np.ndarray, "H W 3"]) -> Window | None:
    """The window with the largest variance of color among those that the surface covers; the first of equal ones.

    A fifth of the picture's size, or half of that and so on where no such window is covered enough. White is no
    color: else the outline would always be the most detailed.
    """
    height, width = (max(side // SHARE, 1) for side in picture.shape[:2])
    smallest = min(_SMALLEST, height, width)
    covered = is_covered(picture)
    colors = np.where(covered[..., None], picture, 0).astype(np.int64)
    while min(height, width) >= smallest:
        count = _sums(covered.astype(np.int64), height, width)
        enough = count >= COVERED * height * width
        if enough.any():
            variance = np.where(enough, _variance(colors, count, height, width), -1.0)
            top, left = np.unravel_index(int(variance.argmax()), variance.shape)
            return Window(int(top), int(top) + height, int(left), int(left) + width)
        height, width = height // 2, width // 2
    return None


def cut_out(picture: UInt8[np.ndarray, "H W 3"], window: Window) -> UInt8[np.ndarray, "h w 3"]:
    """The pixels of a window; white beyond the picture."""
    found = np.full((*window.shape, 3), WHITE, dtype=np.uint8)
    top, left = max(window.top, 0), max(window.left, 0)
    inside = picture[top : max(window.bottom, 0), left : max(window.right, 0)]
    rows, columns = top - window.top, left - window.left
    found[rows : rows + inside.shape[0], columns : columns + inside.shape[1]] = inside
    return found


def _variance(colors: np.ndarray, count: np.ndarray, height: int, width: int) -> Float64[np.ndarray, "h w"]:
    """Of every window, all channels together; what is not covered counts as the mean of the rest."""
    total = np.zeros(count.shape)
    for channel in np.moveaxis(colors, 2, 0):
        total += _sums(channel**2, height, width) - _sums(channel, height, width) ** 2 / np.maximum(count, 1)
    return total / (height * width)


def _sums(values: Shaped[np.ndarray, "H W"], height: int, width: int) -> Shaped[np.ndarray, "h w"]:
    """Of every window of that size, by its first row and column; integers, so that they are exact."""
    up = np.pad(values, ((1, 0), (1, 0))).cumsum(axis=0).cumsum(axis=1)
    return np.asarray(up[height:, width:] - up[:-height, width:] - up[height:, :-width] + up[:-height, :-width])


def _around(covered: Bool[np.ndarray, "H W"]) -> Window:
    """What is covered, with a margin, inside the picture; all of it where nothing is."""
    rows, columns = np.flatnonzero(covered.any(axis=1)), np.flatnonzero(covered.any(axis=0))
    if len(rows) == 0:
        return Window(0, covered.shape[0], 0, covered.shape[1])
    margin = max(1, round(_MARGIN * max(np.ptp(rows), np.ptp(columns))))
    top, left = max(int(rows[0]) - margin, 0), max(int(columns[0]) - margin, 0)
    bottom, right = (int(ends[-1]) + 1 + margin for ends in (rows, columns))
    return Window(top, min(bottom, covered.shape[0]), left, min(right, covered.shape[1]))


def _place_inset(covered: Bool[np.ndarray, "H W"], cut: Window, box: Window) -> tuple[Window, Window, Window]:
    """What is shown, the box and the inset: in the corner where it hides least, with white added beside the surface
    where that hides less. The box itself is never hidden."""
    longer = max(cut.shape)
    gap = max(1, round(_MARGIN * longer))
    times = min(_INSET * covered.shape[0], _INSET_OF_CUT * longer) / box.shape[0]
    size = round(times * box.shape[0]), round(times * box.shape[1])
    inside = covered[cut.top : cut.bottom, cut.left : cut.right]
    dense = inside.mean() > _DENSE
    found = []
    for wider, inset in _candidates(cut, size, gap):
        if _apart(inset, box, gap):
            added = wider.shape[1] - cut.shape[1] + wider.shape[0] - cut.shape[0]
            hidden = (cut_out(covered[..., None].repeat(3, 2).astype(np.uint8), inset) == 1).mean()
            found.append((_PADDING * added / longer + float(hidden), added > 0 and dense, wider, inset))
    _, _, wider, inset = min(found, key=lambda each: (each[1], each[0]))
    return wider, box, inset


def _candidates(cut: Window, size: tuple[int, int], gap: int) -> Iterator[tuple[Window, Window]]:
    """What is shown, wider by more and more white to one side, and the inset in its two corners there.

    The last ones have the inset beside all that was shown. What is lower than the inset is higher by the difference.
    """
    high, wide = size
    bottom = max(cut.bottom, cut.top + high)
    for step in range(_STEPS + 1):
        white = -(-(wide + gap) * step // _STEPS)
        for left, right in ((cut.left, cut.right + white), (cut.left - white, cut.right)):
            shown = Window(cut.top, bottom, left, max(right, left + wide))
            for edge in (shown.left, shown.right - wide):
                yield shown, Window(shown.top, shown.top + high, edge, edge + wide)
                yield shown, Window(shown.bottom - high, shown.bottom, edge, edge + wide)


def _apart(a: Window, b: Window, gap: int) -> bool:
    return max(b.top - a.bottom, a.top - b.bottom, b.left - a.right, a.left - b.right) >= gap
