"""Options of the encoder: a recipe with its own options, how a scene is taken apart, and the key interval.

`EncoderOptions()` is what `encode` uses by default; `presets.preset_options` makes options for a preset and a quality.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Literal

from ..analysis.appearance.calibrate import CalibrationOptions
from ..analysis.appearance.splat_fit import FitSplatsOptions
from ..analysis.fit.slide import SlideOptions
from ..analysis.fit.surface_fit import FitOptions
from ..analysis.follow.embedded import EmbeddedOptions
from ..analysis.follow.fused_template import FusedOptions
from ..analysis.follow.template import TemplateOptions
from ..analysis.groups import GroupOptions
from ..analysis.plan import PlanOptions
from ..analysis.reference.extraction import ReferenceOptions
from ..analysis.reference.track import TrackOptions
from ..analysis.scene.background import BackgroundOptions
from ..analysis.scene.bodies import BodyOptions
from ..analysis.scene.segmentation import SegmentOptions
from ..coding.appearance.colors import ColorCodingOptions
from ..coding.appearance.pictures import VideoOptions
from ..coding.appearance.splats import SplatCodingOptions
from ..coding.layers.coder import LayerCodingOptions
from ..coding.paper.displacements import DisplacementOptions
from ..errors import InputError
from .draco import IntraOptions
from .tails import TailOptions
from .target import Fidelity

MOST_FRAMES = 64  # in a group: the tracker's distances and the basis grow with it (guess)
MOST_SECONDS = 600  # of a key interval: viewers who join late decode that much before the first picture (guess)
STEP = LayerCodingOptions().step
TEXTURE_SIZES = (128, 256, 512, 1024, 2048)


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
        _check_group_size(self.group_size)
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
        """Whether all is done as the paper's words say."""
        chosen = (self.pose, self.fit, self.rounding, self.steps, self.cuts)
        return chosen == ("mds", "nearest", "plain", "uniform", False)


@dataclass(frozen=True, slots=True)
class LayersOptions:
    """Options of the recipe of layers (`layers.py`); the defaults are those of quality 50."""

    group_size: int = 16  # most frames in a group
    target: Fidelity = Fidelity(0.2 * STEP + 0.00005, 7.0, STEP)  # that every frame should reach, of its own diagonal
    predict: bool = True  # groups from the one before, where its template still fits
    embedded: EmbeddedOptions = field(default_factory=EmbeddedOptions)
    template: TemplateOptions = field(default_factory=TemplateOptions)
    fused: FusedOptions = field(default_factory=FusedOptions)
    fit: FitOptions = FitOptions(strides=(4, 3, 2, 1), restart=False, pull=0.3, second_smoothing=0.7)
    slide: SlideOptions | None = SlideOptions()  # of fits to frames with colours; None: shape alone tells
    plan: PlanOptions = PlanOptions()
    noisy_plan: PlanOptions = PlanOptions(limit=4.0, alone=6.0, keys=2)  # under noise: whoever can be followed is
    tolerance: float = 1.0  # of noise, times its RMS: nothing finer is coded
    errors: tuple[float, ...] = ()  # of a key's further templates, which are tried: times `template.error`
    layers: LayerCodingOptions = field(default_factory=LayerCodingOptions)
    tails: TailOptions | None = field(default_factory=TailOptions)  # None: no patches
    displacements: DisplacementOptions = field(default_factory=DisplacementOptions)  # where layers miss the target
    flat: float = 2.0  # times the wanted normal error beyond which edges are lost: frames are of Draco then (guess)
    measured: int | None = None  # frames of a group whose fidelity is measured, at most; None: all
    floor: bool = True  # Draco is tried in place of every group, not only where nothing else holds
    intra: IntraOptions = field(default_factory=IntraOptions)

    def plan_for(self, noise: float) -> PlanOptions:
        """Return the prices of a plan for frames at this RMS distance from the truth."""
        return self.noisy_plan if noise > 0 else self.plan

    def __post_init__(self) -> None:
        _check_group_size(self.group_size)
        if (self.measured is not None and self.measured < 1) or min(self.errors, default=1.0) <= 0:
            raise InputError(f"measured {self.measured}, errors {self.errors}: give frames >= 1, and factors > 0")


MethodOptions = PaperOptions | LayersOptions  # the class names the recipe


@dataclass(frozen=True, slots=True)
class SceneOptions:
    """Options of the separation of a scene into a background and moving bodies."""

    segment: SegmentOptions = field(default_factory=SegmentOptions)
    background: BackgroundOptions = field(default_factory=BackgroundOptions)
    bodies: BodyOptions = field(default_factory=BodyOptions)


@dataclass(frozen=True, slots=True)
class TextureOptions:
    """Options of textures, which need the extra `color`."""

    size: int | None = None  # width of a texture, and its height at most, texels; None: as the pictures have detail
    video: VideoOptions = VideoOptions()
    always: bool = False  # also where frames have colours of their vertices only
    compatible: bool = False  # also as H.264, for devices that cannot play AV1

    def __post_init__(self) -> None:
        if self.size is not None and self.size not in TEXTURE_SIZES:
            raise InputError(f"texture {self.size}: give {', '.join(map(str, TEXTURE_SIZES))} texels")


@dataclass(frozen=True, slots=True)
class SplatOptions:
    """Options of splats, which need the extra `splats`."""

    fit: FitSplatsOptions = FitSplatsOptions()
    coding: SplatCodingOptions = SplatCodingOptions()
    frames: int = 16  # of a chain, whose pictures are looked at, at most
    views: int = 6  # of each, where there are no colour cameras
    size: int = 256  # pixels, of the longer side of the body in a picture

    def __post_init__(self) -> None:
        if self.frames < 1 or self.views < 1 or not 16 <= self.size <= 4096:
            text = f"splats of {self.frames} frames, {self.views} views, {self.size} pixels"
            raise InputError(f"{text}: give at least 1, 1 and 16 to 4096")


@dataclass(frozen=True, slots=True)
class AppearanceOptions:
    """Options of what surfaces look like; a sequence without colours has none."""

    colors: ColorCodingOptions = ColorCodingOptions()  # of the vertices, which every coloured group has
    texture: TextureOptions | None = TextureOptions()  # None: no textures
    calibration: CalibrationOptions | None = CalibrationOptions()  # of colour cameras; None: they are as they are said
    splats: SplatOptions | None = None  # None: no splats


@dataclass(frozen=True, slots=True)
class EncoderOptions:
    """Options of the encoder: a recipe, and for scenes how they are taken apart."""

    method: MethodOptions = field(default_factory=LayersOptions)
    scene: SceneOptions | None = field(default_factory=SceneOptions)  # None: no background is looked for
    appearance: AppearanceOptions | None = AppearanceOptions()  # None: colours are left out
    key_interval: float = 4.0  # s, at most, from one random-access point to the next; of a scene in both recipes
    quality: float = 50.0  # 0 to 100, which the other options were made from; a file records it

    def __post_init__(self) -> None:
        if not 0 <= self.quality <= 100:
            raise InputError(f"quality must be in 0 to 100, got {self.quality:g}")
        if not isinstance(self.method, MethodOptions):
            raise InputError(f"method {self.method!r}: give PaperOptions or LayersOptions, or use preset_options")
        if self.scene is not None and not isinstance(self.scene, SceneOptions):
            raise InputError(f"scene {self.scene!r}: give SceneOptions, or None where nothing stands still")
        if not 0 < self.key_interval <= MOST_SECONDS:
            raise InputError(f"key interval {self.key_interval:g}: give seconds, above 0 and at most {MOST_SECONDS}")

    @property
    def preset(self) -> str:
        """Name of the recipe: `best`, `paper` or `paper-literal`; a file records it."""
        if isinstance(self.method, LayersOptions):
            return "best"
        return "paper-literal" if self.method.is_literal else "paper"


def _check_group_size(size: int) -> None:
    if not 1 <= size <= MOST_FRAMES:
        raise InputError(f"group size must be in 1 to {MOST_FRAMES}, got {size}")
