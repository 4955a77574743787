"""What a coded group is worth, and the cheapest per-frame Draco form that is worth as much.

In -> out: originals and decoded frames -> Quality; originals and a Quality to reach -> a payload of the `draco` form or
nothing. Decisions use the symmetric distance: the one-way form does not see left-over surface.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..coding.intra import decode_intra, encode_intra
from ..coding.mesh import MAX_BITS
from ..geometry.decimate import decimate
from ..metrics.distance import PSNR_CEILING, surface_errors
from ..types import Mesh


@dataclass(frozen=True, slots=True)
class Quality:
    """How far decoded frames are from the originals; smaller is better."""

    distance: float  # RMS over the frames of the symmetric surface distance, normalised units
    angle: float  # mean normal error over the frames, degrees
    worst: float  # the largest symmetric distance of a frame, normalised units
    psnr: float = 0.0  # d2_psnr_paper, mean over the frames, dB; larger is better, unlike the others

    def scaled(self, factor: float) -> Quality:
        """The same with its distances multiplied by `factor`."""
        return replace(self, distance=self.distance * factor, worst=self.worst * factor)

    def reaches(self, other: Quality) -> bool:
        """True where neither distance nor normals are worse than the other's."""
        return self.distance <= other.distance and self.angle <= other.angle


NO_ERROR = Quality(0.0, 0.0, 0.0, PSNR_CEILING)


@dataclass(frozen=True, slots=True)
class IntraOptions:
    """What is tried for the `draco` form."""

    fractions: tuple[float, ...] = (0.04, 0.08, 0.15, 0.25, 0.5, 1.0)  # of the vertices kept
    steps: tuple[float, ...] = (2.0, 1.4, 1.0, 0.7, 0.5, 0.35)  # lattice steps, in units of the distance to reach
    levels: tuple[int, ...] = (1, 0)  # midpoint subdivisions in the decoder


def measure(originals: Sequence[Mesh], decoded: Sequence[Mesh]) -> Quality:
    """The quality of decoded frames; a frame without surface on one side only counts as infinitely far."""
    errors = [surface_errors(a, b) for a, b in zip(originals, decoded, strict=True)]
    distances = [e.symmetric_rms for e in errors]
    mean_square = sum(d * d for d in distances) / len(errors)
    angle = sum(e.angle for e in errors) / len(errors)
    psnr = sum(min(e.d2_psnr_paper, PSNR_CEILING) for e in errors) / len(errors)
    return Quality(math.sqrt(mean_square), angle, max(distances), psnr)


def cheapest_intra(
    frames: Sequence[Mesh], target: Quality, most_bytes: float, options: IntraOptions
) -> tuple[bytes, Quality] | None:
    """A `draco` payload under `most_bytes` that reaches the target in distance and angle, with its quality.

    Candidates are tried on the middle frame and ordered by their size there; the first that holds on all is taken.
    """
    middle = frames[len(frames) // 2]
    budget = most_bytes / len(frames)
    for _, fraction, step, levels in sorted(_on_one_frame(middle, target, budget, options)):
        meshes = [_reduced(frame, fraction) for frame in frames]
        payload = encode_intra(meshes, step, levels)
        if len(payload) >= most_bytes:
            continue
        quality = measure(frames, decode_intra(payload))
        if quality.reaches(target):
            return payload, quality
    return None


def finest_intra(frames: Sequence[Mesh], step: float) -> tuple[bytes, Quality]:
    """The `draco` payload with every vertex kept: what remains when nothing cheaper reaches a target."""
    payload = encode_intra(frames, coarse_enough(frames, step), 0)
    return payload, measure(frames, decode_intra(payload))


def coarse_enough(frames: Sequence[Mesh], step: float) -> float:
    """The lattice step, or the finest one that these frames' extent allows Draco."""
    extent = max((float(np.ptp(f.vertices, axis=0).max()) for f in frames if not f.is_empty), default=0.0)
    return max(step, extent / 2 ** (MAX_BITS - 1))


def _on_one_frame(
    frame: Mesh, target: Quality, budget: float, options: IntraOptions
) -> Iterator[tuple[int, float, float, int]]:
    """Bytes, fraction, step and levels of what reaches the target on one frame and is below the budget."""
    for fraction in sorted(options.fractions):
        reduced = _reduced(frame, fraction)
        steps = [coarse_enough([frame], step * target.distance) for step in options.steps]
        sizes = [len(encode_intra([reduced], step, 0)) for step in steps]
        if min(sizes) > budget:
            return  # more vertices cost more
        affordable = [(step, size) for step, size in zip(steps, sizes, strict=True) if size <= budget]
        for levels in options.levels:
            if not _reaches(frame, reduced, affordable[-1][0], levels, target):
                continue  # the finest step is the best one
            for step, size in affordable:
                if step == affordable[-1][0] or _reaches(frame, reduced, step, levels, target):
                    yield size, fraction, step, levels
                    break


def _reaches(frame: Mesh, reduced: Mesh, step: float, levels: int, target: Quality) -> bool:
    return measure([frame], decode_intra(encode_intra([reduced], step, levels))).reaches(target)


def _reduced(frame: Mesh, fraction: float) -> Mesh:
    return frame if fraction >= 1 else decimate(frame, max(4, round(fraction * len(frame.vertices))))
