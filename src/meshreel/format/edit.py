"""Edits of a file: the ranges of its coded frames that are shown, and their rotation.

In: metadata, whose item `edit` is valid if the preamble has the flag EDITED. Out: an Edit. Older readers refuse a file
with the flag, rather than show hidden frames or a wrong position.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterable
from dataclasses import dataclass
from itertools import accumulate, pairwise
from typing import Any

import numpy as np

from ..errors import FormatError
from ..types import offset
from .layout import EDITED

ITEM = "edit"  # of the metadata
_CLOSE = 1e-6  # largest error of a rotation: far above the rounding of products of rotations, far below visible


@dataclass(frozen=True, slots=True)
class Edit:
    """Ranges of coded frames that are shown, with hidden ones between, and a rotation about the header's origin."""

    shown: tuple[range, ...]
    rotation: tuple[float, ...] = ()  # nine numbers, row by row; none: not turned

    @property
    def frame_count(self) -> int:
        """Number of frames shown."""
        return sum(map(len, self.shown))

    def coded(self, frame: int) -> int:
        """Return the number that a shown frame has among the coded ones. Raises IndexError for others."""
        ends = [*accumulate(map(len, self.shown))]
        at = bisect_right(ends, offset(frame, range(self.frame_count)))
        return self.shown[at].stop - (ends[at] - frame)

    def item(self, frames: int) -> dict[str, Any]:
        """Return the metadata of a file of `frames` coded frames: the item `edit`, or nothing if nothing is edited."""
        ends = [number for run in self.shown for number in (run.start, run.stop)]
        edit: dict[str, Any] = {} if ends == [0, frames] else {"frames": ends}
        edit |= {"rotation": list(self.rotation)} if self.rotation else {}
        return {ITEM: edit} if edit else {}


def parse_edit(metadata: dict[str, Any], flags: int, frames: int) -> Edit:
    """Return the edit of a file of `frames` coded frames. Raises FormatError if it is invalid."""
    item = metadata.get(ITEM) if flags & EDITED else {}
    if not isinstance(item, dict) or item.keys() - {"frames", "rotation"}:
        raise FormatError(f"Header.metadata: edit {item!r:.80} is none that this reader knows, update meshreel")
    ends, rotation = item.get("frames", [0, frames]), item.get("rotation", [])
    if not isinstance(ends, list) or not all(map(_is_whole, ends)) or len(ends) % 2 or not ends:
        raise FormatError(f"Header.metadata: edit.frames {ends!r:.80} are no pairs of numbers of frames")
    if any(a >= b for a, b in pairwise([-1, *ends, frames + 1])):
        raise FormatError(f"Header.metadata: edit.frames {ends!r:.80} of {frames} frames")
    if not isinstance(rotation, list) or not (rotation == [] or is_rotation(rotation)):
        raise FormatError(f"Header.metadata: edit.rotation {rotation!r:.80} is no rotation of nine numbers")
    ends = [int(end) for end in ends]
    return Edit(tuple(map(range, ends[::2], ends[1::2])), tuple(map(float, rotation)))


def _is_whole(number: Any) -> bool:
    return type(number) in (int, float) and number == int(number)  # 3.0 is 3 in JSON


def joined(runs: Iterable[range]) -> tuple[range, ...]:
    """Return the ranges that are not empty; those with nothing between are one."""
    found = list[range]()
    for run in filter(len, runs):
        start = found.pop().start if found and found[-1].stop == run.start else run.start
        found.append(range(start, run.stop))
    return tuple(found)


def nearest_rotation(matrix: np.ndarray) -> np.ndarray:
    """Return the rotation nearest to a 3 x 3 matrix that is almost one, so that products of rotations do not drift."""
    left, _, right = np.linalg.svd(matrix)
    rotation: np.ndarray = left @ right
    return rotation


def is_rotation(numbers: list[Any]) -> bool:
    """Return whether nine numbers, row by row, are a rotation matrix."""
    if len(numbers) != 9 or not all(type(number) in (int, float) and abs(number) <= 2 for number in numbers):
        return False
    matrix = np.array(numbers, np.float64).reshape(3, 3)
    return bool(np.abs(matrix @ matrix.T - np.eye(3)).max() <= _CLOSE and np.linalg.det(matrix) > 0)
