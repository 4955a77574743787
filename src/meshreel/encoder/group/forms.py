"""Forms of a group: coded groups and the choice of the cheaper form.

In -> out: the frames of a group, and a reference that follows them or none -> an EncodedGroup with its fidelity.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from ...coding.intra import encode_empty
from ...container.writer import Companion, Stored
from ...errors import InputError
from ...format.budget import CostlyError
from ...format.layout import Form
from ...types import Mesh
from .draco import IntraOptions, cheapest_intra, finest_intra
from .target import NO_ERROR, Fidelity, Target

# Times the bytes that half the distance (6 dB) may cost: a finer template gains 4 dB for that (decision 7).
MOST_FOR_HALF = 2
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
    stored: Stored | None = None  # where the payload is, in place of `payload`, of a group whose interval has a file


def most_for(group: EncodedGroup) -> float:
    """Return the bytes a frame up to which `cheaper` takes Draco in place of a group."""
    return MOST_FOR_HALF * len(group.payload) / group.frame_count


def cheaper(frames: Sequence[Mesh], group: EncodedGroup, options: IntraOptions) -> EncodedGroup:
    """Return the group, or its `draco` form where that is the better bargain.

    That is where Draco is as good and smaller, or so much better that no finer template would reach it for the bytes,
    as on bodies of few, large faces.
    """
    size = len(group.payload)
    found = cheapest_intra(frames, group.fidelity, most_for(group) * len(frames), options)
    if found is None:
        return group
    payload, fidelity = found
    if len(payload) >= size and fidelity.distance > group.fidelity.distance / 2:
        return group
    return EncodedGroup(Form.DRACO, len(frames), payload, (), fidelity)


def intra_only(frames: Sequence[Mesh], target: Target, options: IntraOptions) -> EncodedGroup:
    """Encode frames in the `draco` form at the target's fidelity, or as finely as that form can.

    Where its bytes may not hold so many frames, the group has only the first of them. Raises InputError where they may
    not hold one.
    """
    found = cheapest_intra(frames, target, np.inf, options)
    try:
        payload, fidelity = found or finest_intra(frames, target.distance)
    except CostlyError as error:
        if len(frames) > 1:
            return intra_only(frames[: len(frames) // 2], target, options)
        raise InputError(
            f"a mesh of {len(frames[0].faces)} faces: {error}, which no reader takes; simplify it"
        ) from error
    return EncodedGroup(Form.DRACO, len(frames), payload, (), fidelity)


def empty_groups(count: int) -> Iterator[EncodedGroup]:
    """Yield the groups of `count` frames without surface."""
    for start in range(0, count, MOST_EMPTY):
        yield EncodedGroup(Form.EMPTY, min(MOST_EMPTY, count - start), encode_empty(), (), NO_ERROR)
