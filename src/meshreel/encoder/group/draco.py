"""The Draco floor: the cheapest per-frame Draco form of some frames that reaches a fidelity.

In -> out: frames and the fidelity to reach -> a payload of the `draco` form with its fidelity, or None.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from ...coding.intra import decode_intra, encode_intra
from ...coding.mesh import MAX_BITS
from ...format.budget import CostlyError
from ...geometry.decimate import decimate
from ...metrics.distance import Original
from ...types import Mesh
from .target import Fidelity, Target, measure

LEVELS = (1, 0)  # midpoint subdivisions in the decoder, which are tried (guess)


@dataclass(frozen=True, slots=True)
class IntraOptions:
    """Candidates that are tried for the `draco` form."""

    fractions: tuple[float, ...] = (0.04, 0.08, 0.15, 0.25, 0.5, 1.0)  # of the vertices kept
    steps: tuple[float, ...] = (2.0, 1.4, 1.0, 0.7, 0.5, 0.35)  # lattice steps, in units of the distance to reach
    finer: bool = False  # where the step that one frame needs fails on others, finer ones are tried, which takes longer


def cheapest_intra(
    frames: Sequence[Mesh], target: Target, most_bytes: float, options: IntraOptions
) -> tuple[bytes, Fidelity] | None:
    """Find a `draco` payload under `most_bytes` that reaches the target in distance and angle, with its fidelity.

    Candidates are tried on the middle frame and ordered by their size there; the first that holds on all is taken.
    """
    originals, middle = [Original(frame) for frame in frames], len(frames) // 2
    budget = most_bytes / len(frames)
    for _, fraction, step, levels in sorted(_on_one_frame(originals[middle], target, budget, options)):
        meshes = [_reduced(frame, fraction) for frame in frames]
        payload = encode_intra(meshes, step, levels)
        if len(payload) >= most_bytes:
            continue
        fidelity = _fidelity(originals, payload)
        if fidelity is not None and fidelity.reaches(target):
            return payload, fidelity
    return None


def finest_intra(frames: Sequence[Mesh], step: float) -> tuple[bytes, Fidelity]:
    """Encode every vertex in the `draco` form: the last resort where nothing cheaper reaches a target.

    Raises CostlyError where readers would refuse so few bytes for the frames.
    """
    payload = encode_intra(frames, coarse_enough(frames, step), 0)
    return payload, measure(frames, decode_intra(payload))


def coarse_enough(frames: Sequence[Mesh], step: float) -> float:
    """Return the lattice step, or the finest one that Draco has bits for over these frames' extent."""
    extent = max((float(np.ptp(f.vertices, axis=0).max()) for f in frames if not f.is_empty), default=0.0)
    return max(step, extent / 2 ** (MAX_BITS - 1))


def _on_one_frame(
    original: Original, target: Target, budget: float, options: IntraOptions
) -> Iterator[tuple[int, float, float, int]]:
    """Yield bytes, fraction, step and levels of candidates that reach the target on one frame within the budget."""
    frame = original.mesh
    for fraction in sorted(options.fractions):
        reduced = _reduced(frame, fraction)
        steps = [coarse_enough([frame], step * target.distance) for step in options.steps]
        sizes = [len(encode_intra([reduced], step, 0)) for step in steps]
        if min(sizes) > budget:
            return  # more vertices cost more
        affordable = [(step, size) for step, size in zip(steps, sizes, strict=True) if size <= budget]
        for levels in LEVELS:
            if not _reaches(original, reduced, affordable[-1][0], levels, target):
                continue  # the finest step is the best one
            reached = False
            for step, size in affordable:
                reached = reached or step == affordable[-1][0] or _reaches(original, reduced, step, levels, target)
                if reached:  # finer ones do, too
                    yield size, fraction, step, levels
                    if not options.finer:
                        break


def _reaches(original: Original, reduced: Mesh, step: float, levels: int, target: Target) -> bool:
    fidelity = _fidelity([original], encode_intra([reduced], step, levels))
    return fidelity is not None and fidelity.reaches(target)


def _fidelity(originals: Sequence[Original], payload: bytes) -> Fidelity | None:
    """Return the fidelity of a payload, None where readers would refuse so few bytes for it."""
    try:
        return measure(originals, decode_intra(payload))
    except CostlyError:
        return None


def _reduced(frame: Mesh, fraction: float) -> Mesh:
    return frame if fraction >= 1 else decimate(frame, max(4, round(fraction * len(frame.vertices))))
