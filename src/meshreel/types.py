"""The vocabulary: values that every layer passes to the next.

Coordinates are float64 in memory, so that geo-referenced captures (around 1e6) keep their millimetres.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal, Protocol, get_args, runtime_checkable

import numpy as np
from jaxtyping import Float64, Int32

from .errors import InputError

Up = Literal["y", "z", "-y", "-z"]  # the axis of a recording that points up
UPS: tuple[Up, ...] = get_args(Up)
UP_AXES = {
    "y": (0.0, 1.0, 0.0),
    "z": (0.0, 0.0, 1.0),
    "-y": (0.0, -1.0, 0.0),
    "-z": (0.0, 0.0, -1.0),
}


@dataclass(frozen=True, slots=True)
class Mesh:
    """A triangle mesh. Legal without faces and without vertices (an empty frame)."""

    vertices: Float64[np.ndarray, "V 3"]  # m, right-handed
    faces: Int32[np.ndarray, "F 3"]  # counter-clockwise from outside

    @staticmethod
    def of(vertices: object, faces: object) -> Mesh:
        """The mesh of any array-likes, converted to the promised dtypes and made contiguous."""
        v = np.ascontiguousarray(np.asarray(vertices, dtype=np.float64).reshape(-1, 3))
        f = np.ascontiguousarray(np.asarray(faces, dtype=np.int32).reshape(-1, 3))
        return Mesh(v, f)

    @staticmethod
    def empty() -> Mesh:
        """A mesh with no vertices and no faces."""
        return Mesh.of(np.zeros((0, 3)), np.zeros((0, 3)))

    @property
    def is_empty(self) -> bool:
        """True where there is no surface."""
        return len(self.faces) == 0

    @property
    def diagonal(self) -> float:
        """Length of the bounding box's diagonal, m; 0 for an empty mesh."""
        if len(self.vertices) == 0:
            return 0.0
        return float(np.linalg.norm(self.vertices.max(axis=0) - self.vertices.min(axis=0)))


@dataclass(frozen=True, slots=True)
class Placement:
    """Where normalised coordinates lie in the world: each at origin + scale x coordinate."""

    scale: float  # m
    origin: tuple[float, ...]  # m, three

    def of(self, mesh: Mesh) -> Mesh:
        """A mesh of normalised coordinates in metres."""
        return Mesh(np.asarray(self.origin) + self.scale * mesh.vertices, mesh.faces)

    @property
    def numbers(self) -> tuple[float, tuple[float, ...]]:
        """Scale and origin, as the core takes them."""
        return self.scale, self.origin


@runtime_checkable
class Frames(Protocol):
    """Meshes by number: `len`, `frames[i]` and iteration; a list, or what reads them when they are asked for.

    A class that inherits from it need not say how to iterate.
    """

    def __len__(self) -> int: ...

    def __getitem__(self, index: int) -> Mesh: ...

    def __iter__(self) -> Iterator[Mesh]:
        return (self[index] for index in range(len(self)))


def evenly(count: int, most: int) -> list[int]:
    """Numbers of some of `count` frames, rising: at most so many, evenly spread from the first to the last."""
    return sorted({round(k) for k in np.linspace(0, count - 1, min(count, most))})


@runtime_checkable
class MeshSequence(Frames, Protocol):
    """Frames read one at a time, with a frame rate; never all in memory."""

    @property
    def frame_rate(self) -> float:
        """Frames per second, 1/s."""
        ...


@dataclass(frozen=True, slots=True)
class MeshList:
    """Frames that are in memory already, as a MeshSequence."""

    meshes: tuple[Mesh, ...]
    frame_rate: float = 30.0  # 1/s

    def __len__(self) -> int:
        return len(self.meshes)

    def __getitem__(self, index: int) -> Mesh:
        return self.meshes[index]

    def __iter__(self) -> Iterator[Mesh]:
        return iter(self.meshes)


@dataclass(frozen=True, slots=True)
class Centers:
    """Tracked volume centers of a run of frames (paper, section 3.1)."""

    positions: Float64[np.ndarray, "T K 3"]  # in units of the sequence's bounding-box diagonal
    bodies: Int32[np.ndarray, " K"]  # which connected body of the first frame each center belongs to

    def __len__(self) -> int:
        return len(self.positions)


def check_up(axis: str) -> None:
    """Raise InputError where `axis` is not one of the axes that can point up."""
    if axis not in UP_AXES:
        raise InputError(f"up axis {axis!r}: give {', '.join(UP_AXES)}")


def known_up(axis: object) -> Up:
    """The up axis that a file names, or y where it names none that is known."""
    return next((known for known in UPS if known == axis), "y")
