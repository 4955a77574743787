"""Which frame is the key of a group, how far its surface is followed, and where a template is in these frames.

In: the frames of a group to be, prepared for matching. Out: the key, the number of frames that follow, and the motion
(docs/decisions/0011-correspondence). A key is judged by what the embedded deformation leaves over, before any fit.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from ...geometry.topology import vertex_normals
from ...types import Mesh
from ..fit.match import Target
from .embedded import EmbeddedOptions, Motion, Tracker

PLACES = (0.5, 0.7, 0.85, 0.25, 0.0)  # of the keys, in parts of the group; tried until one is not in doubt


@dataclass(frozen=True, slots=True)
class KeyMotion:
    """How the key frame's surface moves through the frames that follow it."""

    key: int
    count: int  # frames, from the first, that are followed
    motion: Motion  # through all frames

    def move(self, template: Mesh) -> Float64[np.ndarray, "T V 3"]:
        """The positions, in the frames that are followed, of a template that lies on the key frame."""
        return self.motion.move(template.vertices, vertex_normals(template))[: self.count]


def choose_key(targets: Sequence[Target], options: EmbeddedOptions, most: int = len(PLACES)) -> KeyMotion:
    """The motion that is followed for longest; of equally long ones that which leaves least over.

    At most so many keys are tried.
    """
    motions = list[KeyMotion]()
    for key in dict.fromkeys(int(place * len(targets)) for place in PLACES[:most]):
        motions.append(_follow(targets, key, options))
        residuals = motions[-1].motion.residuals
        usual = max(float(np.median(residuals)), options.settled)
        if residuals.max() <= min(options.rekeyed, options.uneven * usual):
            break
    return max(motions, key=lambda motion: (motion.count, -float(np.sum(motion.motion.residuals[: motion.count] ** 2))))


def from_last(template: Mesh, targets: Sequence[Target], options: EmbeddedOptions) -> Float64[np.ndarray, "T V 3"]:
    """The positions of a template as it lies on the frame before, in those of these frames that are followed."""
    tracker = Tracker(template, -1, options)
    count = 0
    for target in targets:
        if tracker.step(count, target) > options.lost:
            break
        count += 1
    if count == 0:
        return np.zeros((0, *template.vertices.shape))
    return tracker.motion(range(count)).move(template.vertices, vertex_normals(template))


def _follow(targets: Sequence[Target], key: int, options: EmbeddedOptions) -> KeyMotion:
    tracker = Tracker(targets[key].mesh, key, options)
    for frame in [*range(key + 1, len(targets)), *reversed(range(key))]:
        tracker.step(frame, targets[frame])
    motion = tracker.motion(range(len(targets)))
    lost = np.flatnonzero(motion.residuals > options.lost)
    count = int(lost[0]) if len(lost) else len(targets)
    return KeyMotion(key, count if count > key else 0, motion)
