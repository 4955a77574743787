"""Options of the paper's recipe, which the presets `paper` and `paper-literal` use."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

from ...analysis.reference.extraction import ReferenceOptions
from ...analysis.reference.track import TrackOptions
from ...coding.paper.displacements import DisplacementOptions
from ..group.draco import IntraOptions
from ..group.interval import check_group_size
from ..group.target import Target

PLAIN_ZONE = 0.5  # of a step: rounding to the nearest symbol, as the paper has it
PLAIN_OFFSETS = (0,)  # the same step for all components, as the paper has it


@dataclass(frozen=True, slots=True)
class PaperOptions:
    """Options of the paper's recipe (`paper.py`); the defaults are those of quality 50.

    The first three, and the offsets and dead zone of `displacements`, say where the recipe is better than the paper's
    words, or does as they say (preset `paper-literal`).
    """

    pose: Literal["fit", "mds"] = "fit"  # of the reference: whichever fits best (decision 6); that of eq. 5
    fit: Literal["surface", "nearest"] = "surface"  # of the reference: to the surface; to the frames' nearest vertices
    cuts: bool = True  # groups in two where a reference does not follow, then Draco; False: one group always

    group_size: int = 10  # most frames in a group, the paper's GoF
    target: Target = Target(0.0005, 7.0, 0.0008)  # that every frame should reach, relative to its own diagonal
    track: TrackOptions = field(default_factory=TrackOptions)
    reference: ReferenceOptions = field(default_factory=ReferenceOptions)
    displacements: DisplacementOptions = field(default_factory=DisplacementOptions)
    intra: IntraOptions = field(default_factory=IntraOptions)

    def __post_init__(self) -> None:
        check_group_size(self.group_size)

    @property
    def is_literal(self) -> bool:
        """True if every step follows the paper's words."""
        plain = (self.displacements.dead_zone, self.displacements.offsets) == (PLAIN_ZONE, PLAIN_OFFSETS)
        return plain and (self.pose, self.fit, self.cuts) == ("mds", "nearest", False)
