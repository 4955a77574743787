"""Forms of a group: the fidelity to reach, the Draco floor that reaches it, and the choice of the cheaper form.

In -> out: the frames of a group, and a reference that follows them or none -> an EncodedGroup with its fidelity.
Decisions use the symmetric distance: the one-way form does not see surface that only the decoded frame has.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import repeat
from typing import TypeVar

import numpy as np

from ...coding.mesh import MAX_BITS, decode_intra, encode_empty, encode_intra
from ...container.writer import Companion, Stored
from ...errors import InputError
from ...format.budget import CostlyError
from ...format.layout import Form
from ...geometry.decimate import decimate
from ...geometry.threads import mapped
from ...metrics.distance import PSNR_CEILING, BothClosest, Original, surface_errors
from ...metrics.surface_samples import WORST_ANGLE
from ...types import Mesh

# Times the bytes that half the distance (6 dB) may cost: a finer template gains 4 dB for that (decision 7).
MOST_FOR_HALF = 2
NORMALISED = (1.0, (0.0, 0.0, 0.0))  # placement of a group that is decoded to be measured
MOST_EMPTY = 65_535  # frames of a group without surface: what its field in the index holds


@dataclass(frozen=True, slots=True)
class EncodedGroup:
    """The payload of a group and the fidelity measured on it."""

    form: Form
    frame_count: int
    payload: bytes
    layers: tuple[int, ...]  # k + 1 layers decode with k components, or to k levels
    fidelity: Fidelity
    predicted: bool = False  # from the group before
    key: int | None = None  # the frame, counted in the group, whose surface the others follow
    canonical: bool = field(default=False, kw_only=True)  # its reference lies in the pose of eq. 5
    companions: tuple[Companion, ...] = field(default=(), kw_only=True)  # its colours, an atlas, pictures
    lost_colors: bool = field(default=False, kw_only=True)  # its frames have colours that a reader would refuse
    mended: bool = field(default=False, kw_only=True)  # what was tried first did not hold
    stored: Stored | None = None  # where the payload is, in place of `payload`, of a group whose interval has a file


def most_for(group: EncodedGroup) -> float:
    """Return the bytes a frame up to which `cheaper` takes Draco in place of a group."""
    return MOST_FOR_HALF * len(group.payload) / group.frame_count


def cheaper(frames: Sequence[Mesh], group: EncodedGroup, options: IntraOptions) -> EncodedGroup:
    """Return the group, or its `draco` form where that is the better bargain.

    That is where Draco is as good and smaller, or so much better that no finer template would reach it for the bytes,
    as on bodies of few, large faces.
    """
    found = cheapest_intra(frames, group.fidelity, most_for(group) * len(frames), options)
    if found is None:
        return group
    is_better = len(found.payload) < len(group.payload) or found.fidelity.distance <= group.fidelity.distance / 2
    return found if is_better else group


def intra_only(frames: Sequence[Mesh], target: Target, options: IntraOptions) -> EncodedGroup:
    """Encode frames in the `draco` form at the target's fidelity, or as finely as that form can.

    Where its bytes may not hold so many frames, the group has only the first of them. Raises InputError where they may
    not hold one.
    """
    if (found := cheapest_intra(frames, target, np.inf, options)) is not None:
        return found
    try:
        payload = encode_intra(frames, coarse_enough(frames, target.distance), 0)  # every vertex: the last resort
        return EncodedGroup(Form.DRACO, len(frames), payload, (), measure(frames, decode_intra(payload)))
    except CostlyError as error:
        if len(frames) > 1:
            return intra_only(frames[: len(frames) // 2], target, options)
        raise InputError(
            f"a mesh of {len(frames[0].faces)} faces: {error}, which no reader takes; simplify it"
        ) from error


def empty_groups(count: int) -> Iterator[EncodedGroup]:
    """Yield the groups of `count` frames without surface."""
    for start in range(0, count, MOST_EMPTY):
        yield EncodedGroup(Form.EMPTY, min(MOST_EMPTY, count - start), encode_empty(), (), NO_ERROR)


LEVELS = (1, 0)  # midpoint subdivisions in the decoder, which are tried (guess)


@dataclass(frozen=True, slots=True)
class IntraOptions:
    """Candidates that are tried for the `draco` form."""

    fractions: tuple[float, ...] = (0.04, 0.08, 0.15, 0.25, 0.5, 1.0)  # of the vertices kept
    steps: tuple[float, ...] = (2.0, 1.4, 1.0, 0.7, 0.5, 0.35)  # lattice steps, in units of the distance to reach
    finer: bool = False  # where the step that one frame needs fails on others, finer ones are tried, which takes longer


def cheapest_intra(
    frames: Sequence[Mesh], target: Target, most_bytes: float, options: IntraOptions
) -> EncodedGroup | None:
    """Find a `draco` group under `most_bytes` that reaches the target in distance and angle.

    Candidates are tried on the middle frame and ordered by their size there; the first that holds on all is taken.
    """
    originals, middle = [Original(frame) for frame in frames], len(frames) // 2
    budget = most_bytes / len(frames)
    for _, fraction, step, levels in sorted(_on_one_frame(originals[middle], target, budget, options)):
        meshes = mapped(_reduced, frames, repeat(fraction))
        payload = encode_intra(meshes, step, levels)
        if len(payload) >= most_bytes:
            continue
        if (fidelity := _reaching(originals, payload, target)) is not None:
            return EncodedGroup(Form.DRACO, len(frames), payload, (), fidelity)
    return None


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
            if _reaching([original], encode_intra([reduced], affordable[-1][0], levels), target) is None:
                continue  # the finest step is the best one
            reached = False
            for step, size in affordable:
                reached = reached or step == affordable[-1][0]
                if reached or _reaching([original], encode_intra([reduced], step, levels), target) is not None:
                    reached = True  # finer ones do, too
                    yield size, fraction, step, levels
                    if not options.finer:
                        break


def _reaching(originals: Sequence[Original], payload: bytes, target: Target) -> Fidelity | None:
    """Return the fidelity of a payload, None where it misses the target or readers would refuse so few bytes."""
    try:
        fidelity = measure(originals, decode_intra(payload))
    except CostlyError:
        return None
    return fidelity if fidelity.reaches(target) else None


def _reduced(frame: Mesh, fraction: float) -> Mesh:
    return frame if fraction >= 1 else decimate(frame, max(4, round(fraction * len(frame.vertices))))


_T = TypeVar("_T", bound="Target")


@dataclass(frozen=True, slots=True)
class Target:
    """Errors that frames should not exceed; smaller is better."""

    distance: float  # RMS over the frames of the symmetric surface distance, normalised units
    angle: float  # mean normal error over the frames, degrees
    worst: float  # the largest symmetric distance of a frame, normalised units

    def scaled(self: _T, factor: float) -> _T:
        """Return the same with its distances multiplied by `factor`."""
        return replace(self, distance=self.distance * factor, worst=self.worst * factor)


@dataclass(frozen=True, slots=True)
class Fidelity(Target):
    """Error measures of decoded frames against the originals."""

    psnr: float = 0.0  # d2_psnr_paper, mean over the frames, dB; larger is better
    covered: float = math.inf  # share of the surface of its least covered frame; infinite: not judged
    least: float = 0.0  # the number of that frame

    def reaches(self, target: Target) -> bool:
        """True where neither the distance nor the normal error is larger than the target's."""
        return self.distance <= target.distance and self.angle <= target.angle


NO_ERROR = Fidelity(0.0, 0.0, 0.0, PSNR_CEILING)


def measure(
    originals: Sequence[Mesh | Original], decoded: Sequence[Mesh], closest: Sequence[BothClosest | None] = ()
) -> Fidelity:
    """Measure decoded frames; a frame with a surface on one side only has an infinite distance.

    `closest`: of each frame what `surface_errors` need not look for.
    """
    errors = mapped(surface_errors, originals, decoded, closest or repeat(None))
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
