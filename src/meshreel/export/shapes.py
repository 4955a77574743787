"""Shapes: surfaces over time, the input of the writers of animated files (`animated_glb`, `animated_usd`)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Bool, Float32, Float64, Int32

from ..errors import InputError
from ..format.view import View
from ..geometry.cameras import looking_at, matrix_of
from ..geometry.topology import vertex_normals
from ..types import UPRIGHT, Mesh, Up


@dataclass(frozen=True, slots=True)
class Shape:
    """A surface whose faces do not change: still if it has one frame, otherwise moving from frame to frame."""

    part: str  # of the scene: the writers put the shapes of one part under one node
    name: str
    faces: Int32[np.ndarray, "F 3"]  # at least one
    first: int  # number of its first frame
    frames: Sequence[Mesh]  # consecutive, m; all have colours, or none has
    shown: tuple[tuple[int, int], ...]  # ranges of frames that show it: end excluded, in order, with gaps between
    # Texture coordinates of the faces' corners in all frames, as `Mesh.uv`: all of a face's are NaN, or none is.
    uv: Float32[np.ndarray, "F 3 2"] | None = None

    def __str__(self) -> str:
        return f"{self.part}, {self.name}"

    @property
    def pictured(self) -> Bool[np.ndarray, " F"]:
        """Mask of the faces with a place in the textures."""
        return np.zeros(len(self.faces), bool) if self.uv is None else np.isfinite(self.uv[:, 0, 0])


@dataclass(frozen=True, slots=True)
class Animation:
    """Times and coordinate system of all shapes of a file."""

    times: Float64[np.ndarray, " T"]  # s, at which each frame is shown: from 0, increasing
    frame_rate: float  # 1/s
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0)  # m; float32 coordinates are relative to it
    up: Up = "y"  # axis of the vertices that points up; in files it is +y
    view: View | None = None  # the first view, m; None: it is not known

    @property
    def ends(self) -> Float64[np.ndarray, " N"]:
        """Times at which frames are shown, followed by the end of the last frame, s."""
        return np.append(self.times, self.times[-1] + 1 / self.frame_rate)

    @property
    def root(self) -> Float64[np.ndarray, "4 4"]:
        """Matrix from coordinates relative to `origin` to the coordinates of the file, in which +y is up."""
        turn = np.array(UPRIGHT[self.up], np.float64)
        return matrix_of(turn, turn @ np.asarray(self.origin))

    @property
    def camera(self) -> Float64[np.ndarray, "4 4"] | None:
        """Matrix from the frame of the first view's camera, which looks along -z with y up, to the file's; or None."""
        if self.view is None:
            return None
        eye, target = np.array([self.view.position, self.view.target]) @ np.array(UPRIGHT[self.up], np.float64).T
        if not (eye - target)[[0, 2]].any():  # straight down or up: as if from a little in front
            eye = eye + [0.0, 0.0, 1e-6 * abs(eye[1] - target[1])]
        return looking_at(eye, target) * [1, -1, -1, 1]

    def local(self, shape: Shape, vertices: Float64[np.ndarray, "V 3"]) -> Float32[np.ndarray, "V 3"]:
        """Return coordinates relative to the origin. Raises InputError if float32 cannot hold them."""
        with np.errstate(over="ignore", invalid="ignore"):
            local = (vertices - np.asarray(self.origin)).astype(np.float32)
        if not np.isfinite(local).all():
            raise InputError(f"{shape}: a vertex {np.abs(vertices).max():g} m away, which float32 does not hold")
        return local


def changes(shape: Shape, count: int) -> Iterator[tuple[int, bool]]:
    """Yield the frames below `count`, from 0 on, at which visibility changes, with True where the shape appears."""
    if shape.shown[0][0] > 0:
        yield 0, False
    for first, end in shape.shown:
        yield first, True
        if end < count:
            yield end, False


def unit_normals(frame: Mesh) -> Float32[np.ndarray, "V 3"]:
    """Return normals that all have length 1, as files require; vertices without a normal get +y."""
    normals = vertex_normals(frame)
    normals[~normals.any(axis=1)] = (0, 1, 0)
    return normals.astype(np.float32)


def check_output(path: Path) -> None:
    """Raise InputError if a file of this name cannot be written, before minutes of work."""
    if path.is_dir():
        raise InputError(f"{path}: is a folder, name a file")
    if not path.parent.is_dir():
        raise InputError(f"{path}: there is no folder {path.parent}; make it, or choose another")
