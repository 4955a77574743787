"""Options of the paper's recipe, which the presets `paper` and `paper-literal` use."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Literal

from ...analysis.fit.surface_fit import FitOptions
from ...analysis.groups import GroupOptions
from ...analysis.reference.extraction import ReferenceOptions
from ...analysis.reference.track import TrackOptions
from ...coding.paper.displacements import DisplacementOptions
from ...errors import InputError
from ..group.draco import IntraOptions
from ..group.interval import check_group_size
from ..group.target import Fidelity


@dataclass(frozen=True, slots=True)
class PaperOptions:
    """Options of the paper's recipe (`paper.py`); the defaults are those of quality 50.

    The first five say where the recipe is better than the paper's words, or does as they say (preset `paper-literal`).
    """

    pose: Literal["fit", "mds"] = "fit"  # of the reference: whichever fits best (decision 6); that of eq. 5
    fit: Literal["surface", "nearest"] = "surface"  # of the reference: to the surface; to the frames' nearest vertices
    rounding: Literal["shaped", "plain"] = "shaped"  # of Laplacian coordinates (decision 5)
    steps: Literal["ladder", "uniform"] = "ladder"  # the best for each component; the same for all
    cuts: bool = True  # groups in two where a reference does not follow, then Draco; False: one group always

    group_size: int = 10  # most frames in a group, the paper's GoF
    reference_bits: int = 14  # of the reference's lattice (paper: qp = 14)
    levels: int = 1  # midpoint subdivisions of the decoded reference
    target: Fidelity = Fidelity(0.0005, 7.0, 0.0008)  # that every frame should reach, relative to its own diagonal
    track: TrackOptions = field(default_factory=TrackOptions)
    reference: ReferenceOptions = field(default_factory=ReferenceOptions)
    surface_fit: FitOptions = field(default_factory=FitOptions)
    groups: GroupOptions = field(default_factory=GroupOptions)
    displacements: DisplacementOptions = field(default_factory=DisplacementOptions)
    intra: IntraOptions = field(default_factory=IntraOptions)

    def __post_init__(self) -> None:
        check_group_size(self.group_size)
        if not 1 <= self.reference_bits <= 20 or not 0 <= self.levels <= 4:
            raise InputError(f"reference bits {self.reference_bits}, levels {self.levels}: give 1 to 20 and 0 to 4")

    @property
    def coded(self) -> DisplacementOptions:
        """Options of the displacements with the chosen rounding and steps."""
        zone = 0.5 if self.rounding == "plain" else self.displacements.dead_zone
        offsets = (0,) if self.steps == "uniform" else self.displacements.offsets
        return replace(self.displacements, dead_zone=zone, offsets=offsets)

    @property
    def is_literal(self) -> bool:
        """True if every step follows the paper's words."""
        chosen = (self.pose, self.fit, self.rounding, self.steps, self.cuts)
        return chosen == ("mds", "nearest", "plain", "uniform", False)
