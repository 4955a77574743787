"""Where to look from: views that all frames share and that together see nearly every face (paper, section 3.2).

In: a few frames of a scene. Out: cameras, placed greedily: each next one sees the most area that none before it saw.

Differs from the paper: it does not say where its viewpoints are; ours are found.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from ...errors import InputError
from ...geometry.cameras import PinholeCamera
from ...geometry.raycast import Rays
from ...geometry.topology import face_normals
from ...types import Mesh


@dataclass(frozen=True, slots=True)
class ViewsOptions:
    """How many views, of what size, and among how many places they are chosen."""

    count: int = 14
    width: int = 320  # pixels
    height: int = 240  # pixels
    fov: float = 75.0  # degrees, horizontal
    places: int = 4  # grid points along the longest side of the box
    directions: int = 8  # ways to look at each place, around the vertical and as many again downwards

    def __post_init__(self) -> None:
        if not 1 <= self.count <= 1000:
            raise InputError(f"{self.count} views: give 1 to 1000")
        if not (8 <= self.width <= 4096 and 8 <= self.height <= 4096):
            raise InputError(f"views of {self.width} x {self.height} pixels: give 8 to 4096 a side")
        if not 10 <= self.fov <= 150:
            raise InputError(f"field of view {self.fov:g}: give 10 to 150 degrees")
        if not (2 <= self.places <= 32 and 2 <= self.directions <= 64):
            raise InputError(f"{self.places} places, {self.directions} directions: give 2 to 32 and 2 to 64")


def place_views(meshes: Sequence[Mesh], options: ViewsOptions = ViewsOptions()) -> tuple[PinholeCamera, ...]:
    """Views that see as much of the meshes as so many can; the same for the same meshes.

    Raises InputError where no mesh has a surface.
    """
    meshes = [mesh for mesh in meshes if not mesh.is_empty]
    if not meshes:
        raise InputError("views of frames without surface: give frames that have some")
    low, high = _box(meshes)
    candidates = [view for place in _grid(low, high, options.places) for view in _around(place, options)]
    areas = np.concatenate([face_normals(mesh)[1] for mesh in meshes])
    sees = [_seen(meshes, view) for view in candidates]
    unseen = np.ones(len(areas), bool)
    chosen: list[PinholeCamera] = []
    for _ in range(min(options.count, len(candidates))):
        gains = [float(areas[ids[unseen[ids]]].sum()) for ids in sees]
        best = int(np.argmax(gains))
        chosen.append(candidates[best])
        unseen[sees[best]] = False
    return tuple(chosen)


def _box(meshes: Sequence[Mesh]) -> tuple[np.ndarray, np.ndarray]:
    used = [mesh.vertices[mesh.faces.reshape(-1)] for mesh in meshes]
    return np.min([v.min(axis=0) for v in used], axis=0), np.max([v.max(axis=0) for v in used], axis=0)


def _grid(low: np.ndarray, high: np.ndarray, count: int) -> list[np.ndarray]:
    step = float((high - low).max()) / count or 1.0
    axes = [_spread(a, b, step) for a, b in zip(low, high, strict=True)]
    return [np.array(place) for place in np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)]


def _spread(low: float, high: float, step: float) -> np.ndarray:
    """The middles of as many equal parts of an interval as steps fit, one at least."""
    parts = max(1, round((high - low) / step))
    return low + (high - low) * (np.arange(parts) + 0.5) / parts


def _around(place: Float64[np.ndarray, " 3"], options: ViewsOptions) -> list[PinholeCamera]:
    focal = options.width / 2 / math.tan(math.radians(options.fov) / 2)
    intrinsic = np.array([[focal, 0, options.width / 2], [0, focal, options.height / 2], [0, 0, 1.0]])
    views = []
    for axis in np.concatenate([np.eye(3), -np.eye(3)]):
        up = np.eye(3)[(int(np.abs(axis).argmax()) + 1) % 3]
        right = np.cross(axis, up)
        turn = np.stack([right, np.cross(axis, right), axis])
        extrinsic = np.eye(4)
        extrinsic[:3, :3], extrinsic[:3, 3] = turn, -turn @ place
        views.append(PinholeCamera(options.width, options.height, intrinsic, extrinsic))
    return views


def _seen(meshes: Sequence[Mesh], view: PinholeCamera) -> np.ndarray:
    """The faces of all meshes, numbered through, that a view sees."""
    starts = np.cumsum([0, *(len(mesh.faces) for mesh in meshes)])
    found = []
    for mesh, start in zip(meshes, starts, strict=False):
        ids = np.unique(Rays(mesh).look(view).faces)
        found.append(ids[ids >= 0].astype(np.int64) + start)
    return np.concatenate(found)
