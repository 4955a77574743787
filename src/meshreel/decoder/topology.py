"""Vertices that frames in a row share: where they change, and the positions of a run of frames in one array.

In: the parts of each frame, without patches, which are other vertices in each frame. Out: runs of frames, and arrays.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import accumulate

import numpy as np

from ..errors import InputError
from ..shapes import Float, Float64, Int32


@dataclass(frozen=True, slots=True)
class FramePart:
    """Track or background in one frame, without patches."""

    name: str
    vertices: Float64[np.ndarray, "V 3"]  # m
    chunk: int  # number of the chunk that it was decoded from; -1: of none
    same: tuple[int, ...]  # numbers of chunks whose frames all have these vertices and faces, if they have as many
    faces: Callable[[], Int32[np.ndarray, "F 3"]]  # those that some frame hides included; may decode a group again

    def continues(self, before: FramePart) -> bool:
        """Return whether vertices and faces are those of the part `before`, in other places."""
        if len(self.vertices) != len(before.vertices):
            return False
        return before.chunk in self.same or np.array_equal(self.faces(), before.faces())


PartsOf = Callable[[int], list[FramePart]]  # of a frame; in each frame of a video as many, in the same order


@dataclass(frozen=True, slots=True)
class Topology:
    """Frames in a row whose vertices and faces are the same, apart from patches and from faces that a frame hides.

    They are frames `first` to `last` - 1, as arguments of `vertices`. The slices `parts` are the rows of the vertices
    of each part: "background", if there is one, "track 0", "track 1" ...
    """

    first: int
    last: int
    parts: dict[str, slice]
    _parts_of: PartsOf = field(repr=False, compare=False)

    @property
    def faces(self) -> Int32[np.ndarray, "F 3"]:
        """Faces as rows of the vertices, those that some frame hides included; decoded into a new array."""
        parts = zip(self._parts_of(self.first), self.parts.values(), strict=True)
        return np.concatenate([part.faces() + np.int32(rows.start) for part, rows in parts])


def topologies(parts_of: PartsOf, count: int) -> tuple[Topology, ...]:
    """Return the longest runs of `count` frames that share vertices and faces. Every group is decoded."""
    starts, before = list[tuple[int, dict[str, slice]]](), list[FramePart]()
    for frame in range(count):
        parts = parts_of(frame)
        if not before or not all(map(FramePart.continues, parts, before)):
            ends = list(accumulate(len(part.vertices) for part in parts))
            rows = map(slice, [0, *ends], ends)
            starts.append((frame, dict(zip([part.name for part in parts], rows, strict=True))))
        before = parts
    lasts = [first for first, _ in starts[1:]] + [count]
    return tuple(Topology(first, last, rows, parts_of) for (first, rows), last in zip(starts, lasts, strict=True))


def positions(
    parts_of: PartsOf, first: int, last: int, count: int, out: np.ndarray | None
) -> Float[np.ndarray, "T V 3"]:
    """Write the positions (m) of the vertices of frames `first` to `last` - 1 of `count` to `out` or a new array.

    Raises IndexError out of range, and InputError if vertices or faces change, or do not fit the array.
    """
    if not 0 <= first < last <= count:
        raise IndexError(f"frames {first} to {last} of a video of {count} frames")
    if out is not None and (out.ndim != 3 or len(out) != last - first or out.dtype.char not in "df"):
        text = f"an array of {out.dtype} {out.shape} for {last - first} frames"
        raise InputError(f"{text}: give one of float64 or float32, frames x vertices x 3")
    before = parts_of(first)
    rows = sum(len(part.vertices) for part in before)
    if out is None:
        out = np.empty((last - first, rows, 3))
    elif out.shape[1:] != (rows, 3):
        raise InputError(f"frame {first} has {rows} vertices: the array has room for {out.shape[1:]}")
    for row, frame in zip(out, range(first, last), strict=True):
        parts = parts_of(frame)
        for part, earlier in zip(parts, before, strict=True):
            if not part.continues(earlier):
                numbers = f"({len(part.vertices)} after {len(earlier.vertices)})"
                change = f"frame {frame}: {part.name} has other vertices than in frame {frame - 1} {numbers}"
                alone = ", and each of `tracks` has vertices and a topology of its own" if len(parts) > 1 else ""
                raise InputError(f"{change}: ask for the frames before it; `topology` tells where they change{alone}")
        np.concatenate([part.vertices for part in parts], out=row, casting="same_kind")
        before = parts
    return out
