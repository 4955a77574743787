"""Accuracy of a decoded scene and of its noisy input, measured against the truth of a simulated rig.

Two sequences of meshes, the clean frames and their cameras -> rows of means and of frames. `metrics.scene_accuracy`
defines the numbers.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Bool

from ..errors import InputError
from ..geometry.cameras import PinholeCamera
from ..types import Frames, Mesh
from .comparison import Row, finite
from .scene_accuracy import Scene, Sight, SightOptions, scene_means, scene_row


@runtime_checkable
class TrueCamera(Protocol):
    """A depth camera of a simulated rig."""

    @property
    def view(self) -> PinholeCamera:
        """Pinhole camera at the true pose."""
        ...

    @property
    def depth_range(self) -> tuple[float, float]:
        """Least and greatest depth that the camera measures, m."""
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
    """Clean frames by number, with the cameras that saw them."""

    @property
    def cameras(self) -> Sequence[TrueCamera]:
        """Cameras at their true poses."""
        ...

    def __len__(self) -> int: ...

    def __getitem__(self, index: int) -> TrueFrame: ...


def sights(cameras: Sequence[TrueCamera]) -> tuple[Sight, ...]:
    """Return a rig's cameras as Sights."""
    return tuple(Sight(camera.view, *camera.depth_range) for camera in cameras)


def true_scene(truth: TrueFrames, number: int, options: SightOptions = SightOptions()) -> Scene:
    """Prepare a clean frame. Raises InputError if it is empty, since then it cannot label other meshes."""
    frame = truth[number]
    if frame.mesh.is_empty:
        raise InputError(f"frame {number} of the truth has no faces; simulate the rig again")
    return Scene(frame.mesh, frame.dynamic, sights(truth.cameras), options, complete=True)


def compare_with_truth(
    originals: Frames,
    decoded: Frames,
    truth: TrueFrames,
    numbers: Sequence[int],
    progress: Callable[[int], None] = lambda _done: None,
) -> Row:
    """Measure the decoded meshes and the originals (noise floor) against the truth, in the frames `numbers`.

    Returns a JSON-ready row of means, and of each frame under `per_frame`; numbers that are not finite, or of a missing
    part, are None. `progress` gets the number of finished frames.
    """
    frames: list[Row] = []
    for done, number in enumerate(numbers, 1):
        clean = true_scene(truth, number)
        floor = scene_row(clean, clean.labelled(originals[number]))
        frames.append({"noise_floor": floor, "decoded": scene_row(clean, clean.labelled(decoded[number]))})
        progress(done)
    means = {name: finite(scene_means([frame[name] for frame in frames])) for name in ("noise_floor", "decoded")}
    rows = [{name: finite(row) for name, row in frame.items()} for frame in frames]
    return {"frames": list(numbers)} | means | {"per_frame": rows}
