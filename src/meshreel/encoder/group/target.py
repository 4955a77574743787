"""Fidelity of decoded frames, and the fidelity that frames should reach.

In -> out: original and decoded frames -> Fidelity; frames, options and noise -> the target in normalised units.
Decisions use the symmetric distance: the one-way form does not see surface that only the decoded frame has.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

from ...metrics.distance import PSNR_CEILING, Original, surface_errors
from ...metrics.surface_samples import WORST_ANGLE
from ...types import Mesh


@dataclass(frozen=True, slots=True)
class Target:
    """Errors that frames should not exceed; smaller is better."""

    distance: float  # RMS over the frames of the symmetric surface distance, normalised units
    angle: float  # mean normal error over the frames, degrees
    worst: float  # the largest symmetric distance of a frame, normalised units

    def scaled(self, factor: float) -> Target:
        """Return the same target with its distances multiplied by `factor`."""
        return replace(self, distance=self.distance * factor, worst=self.worst * factor)


@dataclass(frozen=True, slots=True)
class Fidelity(Target):
    """Error measures of decoded frames against the originals."""

    psnr: float = 0.0  # d2_psnr_paper, mean over the frames, dB; larger is better

    def scaled(self, factor: float) -> Fidelity:
        """Return the same fidelity with its distances multiplied by `factor`."""
        return replace(self, distance=self.distance * factor, worst=self.worst * factor)

    def reaches(self, target: Target) -> bool:
        """True where neither the distance nor the normal error is larger than the target's."""
        return self.distance <= target.distance and self.angle <= target.angle


NO_ERROR = Fidelity(0.0, 0.0, 0.0, PSNR_CEILING)


def measure(originals: Sequence[Mesh | Original], decoded: Sequence[Mesh]) -> Fidelity:
    """Measure decoded frames; a frame with a surface on one side only has an infinite distance."""
    errors = [surface_errors(a, b) for a, b in zip(originals, decoded, strict=True)]
    distances = [e.symmetric_rms for e in errors]
    mean_square = sum(d * d for d in distances) / len(errors)
    angle = sum(e.angle for e in errors) / len(errors)
    psnr = sum(min(e.d2_psnr_paper, PSNR_CEILING) for e in errors) / len(errors)
    return Fidelity(math.sqrt(mean_square), angle, max(distances), psnr)


def target_of(frames: Sequence[Mesh], relative: Target, noise: float) -> Target:
    """Return the fidelity that these frames should reach, normalised.

    `relative` is in units of a frame's diagonal and counts for the smallest frame, so that none is lost. Frames with
    noise should be reached as nearly as the truth is; their normals say nothing.
    """
    target = relative.scaled(min(frame.diagonal for frame in frames) or 1.0)
    if noise == 0:
        return target
    distance, worst = math.hypot(target.distance, noise), math.hypot(target.worst, noise)
    return replace(target, distance=distance, worst=worst, angle=WORST_ANGLE)
