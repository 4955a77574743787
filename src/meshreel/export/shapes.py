"""Surfaces over time, as the writers of animated files take them.

In: what all shapes of a file share, and shapes one by one, whose frames are computed when they are written. Out: to one
file that other programs play; `animated_glb` and `animated_usd` say how.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np
from jaxtyping import Float32, Float64, Int32

from ..errors import InputError
from ..types import Up

_TURNS: dict[Up, list[list[int]]] = {  # what turns an axis upwards, to +y
    "y": [[1, 0, 0], [0, 1, 0], [0, 0, 1]],
    "z": [[1, 0, 0], [0, 0, 1], [0, -1, 0]],
    "-y": [[1, 0, 0], [0, -1, 0], [0, 0, -1]],
    "-z": [[1, 0, 0], [0, 0, -1], [0, 1, 0]],
}


@dataclass(frozen=True, slots=True)
class Points:
    """The vertices of a shape in one frame."""

    vertices: Float64[np.ndarray, "V 3"]  # m
    normals: Float64[np.ndarray, "V 3"]  # of length 1, or 0 where there is none


@dataclass(frozen=True, slots=True)
class Shape:
    """A surface whose faces stay as they are: still where it has one frame, else moving from frame to frame."""

    part: str  # of the scene: shapes of one part lie together
    name: str
    faces: Int32[np.ndarray, "F 3"]  # at least one
    first: int  # number of its first frame
    count: int  # of its frames, which follow one another
    frames: Iterable[Points]  # so many
    spans: tuple[tuple[int, int], ...]  # frames in which it is shown, the last excluded; apart, rising

    def __str__(self) -> str:
        return f"{self.part}, {self.name}"


@dataclass(frozen=True, slots=True)
class Animation:
    """What the shapes of a file share."""

    times: Float64[np.ndarray, " T"]  # s, when each frame is shown: from 0, rising
    frame_rate: float  # 1/s
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0)  # m: float32 coordinates are counted from it
    up: Up = "y"  # axis of the vertices; files have +y

    @property
    def ends(self) -> Float64[np.ndarray, " N"]:
        """When each frame is shown and, as one more, when the last one ends, s."""
        return np.append(self.times, self.times[-1] + 1 / self.frame_rate)

    @property
    def root(self) -> Float64[np.ndarray, "4 4"]:
        """What takes coordinates that count from `origin` to the file's world, in which +y is up."""
        matrix = np.eye(4)
        matrix[:3, :3] = _TURNS[self.up]
        matrix[:3, 3] = matrix[:3, :3] @ np.asarray(self.origin)
        return matrix

    def local(self, shape: Shape, vertices: Float64[np.ndarray, "V 3"]) -> Float32[np.ndarray, "V 3"]:
        """Coordinates as files hold them. Raises InputError where float32 cannot."""
        with np.errstate(over="ignore", invalid="ignore"):
            local = (vertices - np.asarray(self.origin)).astype(np.float32)
        if not np.isfinite(local).all():
            raise InputError(f"{shape}: a vertex {np.abs(vertices).max():g} m away, which float32 does not hold")
        return local


class AnimationWriter(Protocol):
    """What writes a file of shapes."""

    def add(self, shape: Shape) -> None:
        """Writes a shape, and computes its frames on the way. Raises InputError where the file cannot hold it."""
        ...


def changes(shape: Shape, count: int) -> Iterator[tuple[int, bool]]:
    """Frames of `count` from which a shape is shown, or no more is; the first is frame 0."""
    if shape.spans[0][0] > 0:
        yield 0, False
    for first, end in shape.spans:
        yield first, True
        if end < count:
            yield end, False


def unit_normals(points: Points) -> Float32[np.ndarray, "V 3"]:
    """Normals that all have length 1, as files want them: up where a vertex has none."""
    normals = points.normals.astype(np.float32)
    normals[~points.normals.any(axis=1)] = (0, 1, 0)
    return normals


def check_target(path: Path) -> None:
    """Raises InputError where a file of this name cannot be written, before minutes are spent on it."""
    if path.is_dir():
        raise InputError(f"{path}: is a folder, name a file")
    if not path.parent.is_dir():
        raise InputError(f"{path}: there is no folder {path.parent}; make it, or choose another")
