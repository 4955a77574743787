"""Options of the recipe of layers, which preset `best` uses."""

from __future__ import annotations

from dataclasses import dataclass, field

from ...analysis.fit.surface_fit import FitOptions
from ...analysis.follow.embedded import EmbeddedOptions
from ...analysis.plan import PlanOptions
from ...coding.layers.coder import LayerCodingOptions
from ...errors import InputError
from ...geometry.strict import rounded
from ..group.forms import IntraOptions, Target
from ..group.interval import check_group_size

STEP = LayerCodingOptions().step
# Under noise, following a template is preferred to cutting the group (decision 16).
NOISY_PLAN = PlanOptions(limit=4.0, alone=6.0, keys=2)


def template_error(step: float) -> float:
    """Return the RMS distance of a key frame from its base mesh, diagonals, at a step of motion (decision 14)."""
    return rounded(0.00088 * (step / 0.0012) ** 0.55)


@dataclass(frozen=True, slots=True)
class LayersOptions:
    """Options of `LayersRecipe` (`recipe.py`); the defaults are those of quality 50."""

    group_size: int = 16  # most frames in a group
    target: Target = Target(0.2 * STEP + 0.00005, 7.0, STEP)  # that every frame should reach, of its own diagonal
    predict: bool = True  # groups from the one before, where its template still fits
    embedded: EmbeddedOptions = field(default_factory=EmbeddedOptions)
    template_error: float = template_error(STEP)  # RMS distance of a key frame from its base mesh, diagonals
    fit: FitOptions = FitOptions(strides=(4, 3, 2, 1), restart=False, pull=0.3, second_smoothing=0.7)
    plan: PlanOptions = PlanOptions()
    tolerance: float = 1.0  # of noise, times its RMS: nothing finer is coded
    errors: tuple[float, ...] = ()  # of a key's further templates, which are tried: times `template_error`
    layers: LayerCodingOptions = field(default_factory=LayerCodingOptions)
    tails: bool = True  # patches where they pay
    flat: float = 2.0  # times the wanted normal error beyond which edges are lost: frames are of Draco then (guess)
    measured: int | None = None  # frames of a group whose fidelity is measured, at most; None: all
    floor: bool = True  # Draco is tried in place of every group, not only where nothing else holds
    intra: IntraOptions = field(default_factory=IntraOptions)

    def plan_for(self, noise: float) -> PlanOptions:
        """Return the prices of a plan for frames at this RMS distance from the truth."""
        return NOISY_PLAN if noise > 0 else self.plan

    def __post_init__(self) -> None:
        check_group_size(self.group_size)
        if (self.measured is not None and self.measured < 1) or min(self.errors, default=1.0) <= 0:
            raise InputError(f"measured {self.measured}, errors {self.errors}: give frames >= 1, and factors > 0")
