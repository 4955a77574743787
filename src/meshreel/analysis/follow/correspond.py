"""Choose the key frame of a group, the number of frames through which it is tracked, and its motion (decisions 11, 15).

In: the next frames, prepared for matching. Out: the key, the number of tracked frames, and the motion. A key is judged
by the residuals of the embedded deformation, before any surface fit.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from ...geometry.topology import vertex_normals
from ...types import Mesh
from ..fit.frame import FrameSurface
from .embedded import EmbeddedOptions, Motion, Tracker

NOISY_KEYS = 2  # keys tried at most under noise: the fused template completes them (decision 16)
PLACES = (0.5, 0.7, 0.85, 0.25, 0.0)  # places of the keys to try, in shares of the group: guesses (decision 15)


@dataclass(frozen=True, slots=True)
class KeyMotion:
    """Motion of a key frame's surface through the frames of a group."""

    key: int
    count: int  # number of frames, from the first, through which the surface is tracked
    motion: Motion  # through all frames

    def move(self, template: Mesh) -> Float64[np.ndarray, "T V 3"]:
        """Move a template that lies on the key frame to each of the tracked frames."""
        return self.motion.move(template.vertices, vertex_normals(template))[: self.count]


def choose_key(
    surfaces: Sequence[FrameSurface], options: EmbeddedOptions, most: int = len(PLACES), noise: float = 0.0
) -> KeyMotion:
    """Return the motion that is tracked through most frames, and of equally long ones that with the least residuals.

    At most `most` keys are tried, none after one whose residuals are small and even.
    """
    motions, limits = list[KeyMotion](), options.limits(noise)
    for key in dict.fromkeys(
        int(place * len(surfaces)) for place in PLACES[: min(most, NOISY_KEYS) if noise else most]
    ):
        motions.append(_follow(surfaces, key, options, noise))
        residuals = motions[-1].motion.residuals
        usual = max(float(np.median(residuals)), limits.settled)
        if residuals.max() <= min(limits.rekeyed, limits.uneven * usual):
            break
    return max(motions, key=lambda motion: (motion.count, -float(np.sum(motion.motion.residuals[: motion.count] ** 2))))


def from_last(
    template: Mesh, surfaces: Sequence[FrameSurface], options: EmbeddedOptions, noise: float = 0.0
) -> Float64[np.ndarray, "T V 3"]:
    """Track a template that lies on the previous frame; return its positions in the frames before it is lost."""
    tracker = Tracker(template, -1, options, noise)
    count = 0
    for surface in surfaces:
        if tracker.step(count, surface) > tracker.limits.lost:
            break
        count += 1
    if count == 0:
        return np.zeros((0, *template.vertices.shape))
    return tracker.motion(range(count)).move(template.vertices, vertex_normals(template))


def _follow(surfaces: Sequence[FrameSurface], key: int, options: EmbeddedOptions, noise: float) -> KeyMotion:
    tracker = Tracker(surfaces[key].mesh, key, options, noise)
    for frame in [*range(key + 1, len(surfaces)), *reversed(range(key))]:
        tracker.step(frame, surfaces[frame])
    motion = tracker.motion(range(len(surfaces)))
    lost = np.flatnonzero(motion.residuals > tracker.limits.lost)
    count = int(lost[0]) if len(lost) else len(surfaces)
    return KeyMotion(key, count if count > key else 0, motion)
