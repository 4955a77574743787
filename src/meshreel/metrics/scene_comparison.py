"""Accuracy of a decoded scene and of its noisy input, measured against the truth of a simulated rig.

In: two sequences of meshes, the clean frames, their cameras -> rows of means and of frames.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, Protocol, runtime_checkable

import numpy as np
from jaxtyping import Bool

from ..errors import InputError
from ..geometry.cameras import PinholeCamera
from ..types import Frames, Mesh
from .scene_accuracy import Scene, Sight, SightOptions, scene_means, scene_row

Row = dict[str, Any]


@runtime_checkable
class TrueCamera(Protocol):
    """A depth camera of a simulated rig."""

    @property
    def view(self) -> PinholeCamera:
        """Its pinhole, where it really stood."""
        ...

    @property
    def depth_range(self) -> tuple[float, float]:
        """The least and the greatest depth it measures, m."""
        ...


@runtime_checkable
class TrueFrame(Protocol):
    """A frame of a scene without noise."""

    @property
    def mesh(self) -> Mesh:
        """All surface, m."""
        ...

    @property
    def dynamic(self) -> Bool[np.ndarray, " F"]:
        """True for each face that moves."""
        ...


@runtime_checkable
class TrueFrames(Protocol):
    """Clean frames by number, and the cameras that saw them."""

    @property
    def cameras(self) -> Sequence[TrueCamera]:
        """Where they really stood."""
        ...

    def __len__(self) -> int: ...

    def __getitem__(self, index: int) -> TrueFrame: ...


def sights(cameras: Sequence[TrueCamera]) -> tuple[Sight, ...]:
    """A rig's cameras as metrics have them."""
    return tuple(Sight(camera.view, *camera.depth_range) for camera in cameras)


def true_scene(truth: TrueFrames, number: int, options: SightOptions = SightOptions()) -> Scene:
    """A clean frame, prepared. Raises InputError where it is empty: nothing can be told apart by it."""
    frame = truth[number]
    if frame.mesh.is_empty:
        raise InputError(f"frame {number} of the truth has no faces; simulate the rig again")
    return Scene(frame.mesh, frame.dynamic, sights(truth.cameras), options, complete=True)


def compare_with_truth(
    originals: Frames,
    decoded: Frames,
    truth: TrueFrames,
    numbers: Sequence[int],
    tell: Callable[[int], None] = lambda _done: None,
) -> Row:
    """Means over the frames `numbers`: of the decoded meshes against the truth, and of the originals (noise floor).

    JSON-ready; what is not finite, or is about a part that is not there, is None. `per_frame` has each of `frames`.
    """
    frames: list[Row] = []
    for done, number in enumerate(numbers, 1):
        clean = true_scene(truth, number)
        floor = scene_row(clean, clean.labelled(originals[number]))
        frames.append({"noise_floor": floor, "decoded": scene_row(clean, clean.labelled(decoded[number]))})
        tell(done)
    means = {name: finite(scene_means([frame[name] for frame in frames])) for name in ("noise_floor", "decoded")}
    told = [{name: finite(row) for name, row in frame.items()} for frame in frames]
    return {"frames": list(numbers)} | means | {"per_frame": told}


def finite(row: Row) -> Row:
    """The row as JSON may have it."""
    return {name: None if isinstance(v, float) and not math.isfinite(v) else v for name, v in row.items()}
