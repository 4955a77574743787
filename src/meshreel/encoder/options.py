"""Options of the encoder; `presets.preset_options` makes them from a preset's name and a quality."""

from __future__ import annotations

from dataclasses import dataclass, field

from ..analysis.fit.surface_fit import FitOptions
from ..analysis.follow.correspond import PLACES
from ..analysis.follow.embedded import EmbeddedOptions
from ..analysis.follow.fused_template import FusedOptions
from ..analysis.follow.template import TemplateOptions
from ..analysis.groups import GroupOptions
from ..analysis.reference.extraction import ReferenceOptions
from ..analysis.reference.track import TrackOptions
from ..analysis.scene.background import BackgroundOptions
from ..analysis.scene.bodies import BodyOptions
from ..analysis.scene.segmentation import SegmentOptions
from ..coding.layers.coder import LayerCodingOptions
from ..coding.paper.displacements import DisplacementOptions
from ..errors import InputError
from ..format.layout import Form
from .draco import IntraOptions
from .tails import TailOptions
from .target import Fidelity

MOST_FRAMES = 64  # in a group: the tracker's distances and the basis grow with it
MOST_NOISE = 0.05  # RMS, of the diagonal: beyond, nothing is left of a hand
MOST_SECONDS = 600  # of a key interval: whoever joins late decodes as much before a picture is there


@dataclass(frozen=True, slots=True)
class EncoderOptions:
    """How to encode; `presets.preset_options` fills it from a preset's name and a quality."""

    preset: str = "paper"
    quality: float = 50.0  # 0 to 100; what the other fields were made from, recorded in the file
    group_size: int = 10  # most frames in a group, the paper's GoF
    reference_bits: int = 14  # of the reference's lattice (paper: qp = 14)
    levels: int = 1  # midpoint subdivisions of the decoded reference
    target: Fidelity = Fidelity(0.0005, 7.0, 0.0008)  # what every frame should be worth, relative to its own diagonal
    track: TrackOptions = field(default_factory=TrackOptions)
    reference: ReferenceOptions = field(default_factory=ReferenceOptions)
    fit: FitOptions = field(default_factory=FitOptions)
    groups: GroupOptions = field(default_factory=GroupOptions)
    displacements: DisplacementOptions = field(default_factory=DisplacementOptions)
    intra: IntraOptions = field(default_factory=IntraOptions)
    form: Form = Form.LAPLACIAN  # of the groups that a template follows; or LAYERS
    keys: int = 5  # frames tried as the key of a group, at most (form LAYERS)
    predict: bool = True  # groups from the one before, where its template still fits (form LAYERS)
    key_interval: float = 4.0  # s, at most, from one random-access point to the next (form LAYERS)
    embedded: EmbeddedOptions = field(default_factory=EmbeddedOptions)
    template: TemplateOptions = field(default_factory=TemplateOptions)
    layers: LayerCodingOptions = field(default_factory=LayerCodingOptions)
    tails: TailOptions | None = field(default_factory=TailOptions)  # None: no patches (form LAYERS)
    noise: float = 0.0  # RMS distance of the frames from the truth, normalised; 0: a clean capture
    fused: FusedOptions = field(default_factory=FusedOptions)
    dynamic_only: bool = False  # True: no background is looked for, everything may move
    segment: SegmentOptions = field(default_factory=SegmentOptions)
    background: BackgroundOptions = field(default_factory=BackgroundOptions)
    bodies: BodyOptions = field(default_factory=BodyOptions)

    def __post_init__(self) -> None:
        if not 0 <= self.quality <= 100:
            raise InputError(f"quality must be in 0 to 100, got {self.quality:g}")
        if not 1 <= self.group_size <= MOST_FRAMES:
            raise InputError(f"group size must be in 1 to {MOST_FRAMES}, got {self.group_size}")
        if self.form not in (Form.LAPLACIAN, Form.LAYERS):
            raise InputError(f"form {self.form}: give LAPLACIAN or LAYERS; the others are taken where these cost more")
        if not 1 <= self.keys <= len(PLACES):
            raise InputError(f"{self.keys} keys: give 1 to {len(PLACES)}")
        if not 0 < self.key_interval <= MOST_SECONDS:
            raise InputError(f"key interval {self.key_interval:g}: give seconds, above 0 and at most {MOST_SECONDS}")
        if not 1 <= self.reference_bits <= 20 or not 0 <= self.levels <= 4:
            raise InputError(f"reference bits {self.reference_bits}, levels {self.levels}: give 1 to 20 and 0 to 4")
        if not 0 <= self.noise <= MOST_NOISE:
            raise InputError(f"noise {self.noise:g}: give it in units of the diagonal, 0 to {MOST_NOISE:g}")
