"""Options of the encoder, and presets: a quality from 0 to 100 sets every option of a recipe, a scene and colours.

`EncoderOptions()` is what `encode` uses by default; `Settings.resolved` makes options of what a user chooses. The
curves of the presets were fitted to rate-distortion points of a captured dancer (decision 9).
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from importlib.util import find_spec

import numpy as np

from ...analysis.follow.embedded import Stage
from ...analysis.reference.extraction import ReferenceOptions
from ...analysis.reference.track import TrackOptions
from ...analysis.scene.bodies import NEAR
from ...analysis.scene.segmentation import Cameras
from ...coding.layers.coder import LayerCodingOptions
from ...coding.paper.displacements import DisplacementOptions
from ...errors import InputError
from ...geometry.strict import rounded
from ..appearance.videos import AppearanceOptions, TextureOptions
from ..group.forms import IntraOptions, Target
from ..layers.options import LayersOptions, template_error
from ..layers.recipe import LayersRecipe
from ..paper.recipe import PLAIN_OFFSETS, PLAIN_ZONE, FindGroups, PaperOptions, PaperRecipe, find_groups

QUALITY = 50.0  # unless another is given (decision 9)
MOST_SECONDS = 600  # of a key interval: viewers who join late decode that much before the first picture (guess)
LITERAL_DEPTH = 9  # of Poisson reconstruction (paper, section 3.3.2)
KNEE = 85.0  # quality above which steps are halved every 8 points: the curve ended for want of steps (decision 33)
DENSEST = 95.0  # quality from which the template is as it is: a denser one's normals are worse (decision 33)
EXACT = 99.0  # quality from which layers that miss the target give way to Draco in every frame (decision 33)
EXACT_DISTANCE = (0.5, 0.43)  # of the motion's step, RMS, that such frames have at most, at EXACT and at 100
EXACT_ANGLE = (1.95, 1.85)  # degrees that they have at most: pictures show normals more than distances
# Candidates of these frames: where few vertices are lost, a coarser lattice costs less than it spoils.
EXACT_INTRA = IntraOptions(
    fractions=(0.04, 0.08, 0.15, 0.25, 0.35, 0.4, 0.45, 0.475, 0.5, 0.525, 0.55, 0.575, 0.6, 0.65, 0.7, 1.0),
    steps=(4.5, 3.7, 3.0, 2.4, 2.0, 1.7, 1.4, 1.2, 1.0, 0.8, 0.5),
    finer=True,
)
LITERAL_ANCHORS = 400  # anchors of a reference in `paper-literal`: the paper gives no number (guess)

MethodOptions = PaperOptions | LayersOptions  # the class names the recipe
Recipe = LayersRecipe | PaperRecipe  # a method of encoding with its options


@dataclass(frozen=True, slots=True)
class SceneOptions:
    """Options of the separation of a scene into a background and moving bodies."""

    cameras: Cameras = ()  # that look at the scene, of one size; none: they are placed
    from_depth: bool = True  # fuse the background from depth pictures where the sequence has them
    coarse: float = 0.5  # RMS distance that decimation may cost the background, in RMS noise (decision 19)
    lattice: float = 0.3  # spacing of the background's lattice, in RMS noise (decision 19)
    refresh: float | None = None  # s between two copies of the background in the file; None: one copy
    close_planes: bool = False  # let planes go on through holes of the background that nobody saw into
    near: float = NEAR  # cells of the scene: pieces of consecutive frames nearer than this are one body


@dataclass(frozen=True, slots=True)
class EncoderOptions:
    """Options of the encoder: a recipe, and for scenes how they are taken apart."""

    method: MethodOptions = field(default_factory=LayersOptions)
    scene: SceneOptions | None = field(default_factory=SceneOptions)  # None: no background is looked for
    appearance: AppearanceOptions | None = AppearanceOptions()  # None: colours are left out
    key_interval: float = 4.0  # s, at most, from one random-access point to the next; of a scene in both recipes
    quality: float = QUALITY  # 0 to 100, which the other options were made from; a file records it

    def __post_init__(self) -> None:
        if not 0 <= self.quality <= 100:
            raise InputError(f"quality must be in 0 to 100, got {self.quality:g}")
        if not isinstance(self.method, MethodOptions):
            raise InputError(f"method {self.method!r}: give PaperOptions or LayersOptions, or use Settings")
        if self.scene is not None and not isinstance(self.scene, SceneOptions):
            raise InputError(f"scene {self.scene!r}: give SceneOptions, or None where nothing stands still")
        if not 0 < self.key_interval <= MOST_SECONDS:
            raise InputError(f"key interval {self.key_interval:g}: give seconds, above 0 and at most {MOST_SECONDS}")

    def recipe(self, find: FindGroups = find_groups) -> Recipe:
        """Return the method with its options; `find` finds the groups of the paper's."""
        if isinstance(self.method, LayersOptions):
            return LayersRecipe(self.method, self.key_interval, self.appearance is not None)
        return PaperRecipe(self.method, find)

    @property
    def preset(self) -> str:
        """Name of the recipe: `best`, `paper` or `paper-literal`; a file records it."""
        return self.recipe().name


def as_installed(options: EncoderOptions) -> tuple[EncoderOptions, tuple[str, ...]]:
    """Return options without textures where the packages for these are missing, unless they are asked for; a warning.

    Raises InputError where they are asked for.
    """
    appearance = options.appearance
    if appearance is not None and appearance.splats is not None and find_spec("torch") is None:
        raise InputError("splats are fitted by torch: pip install 'meshreel[splats]'")
    if appearance is None or appearance.texture is None:
        return options, ()
    missing = [name for name in ("av", "xatlas") if find_spec(name) is None]
    if not missing:
        return options, ()
    text = f"no textures: {' and '.join(missing)} missing; pip install 'meshreel[color]'"
    if appearance.texture.always:
        raise InputError(f"{text}, or give --color vertices")
    return replace(options, appearance=replace(appearance, texture=None)), (f"{text}; colours of vertices are kept",)


def paper_options(quality: float, centers: int | None, basis_size: int | None, literal: bool) -> PaperOptions:
    """Return the options of the paper's recipe at a quality; `literal`: without what is better than the paper's words.

    What the paper leaves open is then as in its release: vertices are displaced to the nearest of a frame's.
    """
    step = displacement_step(quality)
    centers = 2000 if centers is None else centers
    options = PaperOptions(
        track=TrackOptions(centers=centers, samples=max(45_000, 4 * centers)),
        target=Target(distance=0.5 * step + 0.0001, angle=7.0, worst=step),
        reference=ReferenceOptions(vertices=reference_vertices(quality)),
        displacements=DisplacementOptions(step=step, basis_size=basis_size),
    )
    if not literal:
        return options
    plain = plain_displacements(options.displacements)
    reference = replace(options.reference, poisson=LITERAL_DEPTH)
    return replace(options, reference=reference, pose="mds", fit="nearest", cuts=False, displacements=plain)


def plain_displacements(options: DisplacementOptions) -> DisplacementOptions:
    """Return the options with one step, plain rounding and as many anchors as `paper-literal` has."""
    return replace(options, offsets=PLAIN_OFFSETS, dead_zone=PLAIN_ZONE, anchor_count=LITERAL_ANCHORS)


def layers_options(quality: float, effort: str) -> LayersOptions:
    """Return the options of the recipe of layers at a quality."""
    step, coarser = motion_step(quality), rounded(0.0018 * 2 ** ((50 - quality) / 25))  # the latter without a knee
    options = LayersOptions(
        target=Target(distance=0.2 * coarser + 0.00005, angle=7.0, worst=coarser),  # what templates reach
        template_error=template_error(motion_step(min(quality, DENSEST))),
        layers=LayerCodingOptions(step=step),
        tolerance=tolerance(quality),
    )
    if quality >= EXACT:
        share, angle = (rounded(np.interp(quality, (EXACT, 100.0), ends)) for ends in (EXACT_DISTANCE, EXACT_ANGLE))
        target = Target(distance=share * step, angle=angle, worst=step)
        options = replace(options, target=target, flat=1.0, intra=EXACT_INTRA)
    if effort == "fast":
        return _fast(options)
    if effort == "thorough":  # more keys, tried also where a plan is good already, and more templates (decision 24)
        plan = replace(options.plan, keys=8, misses=3, settled=0.25, gain=0.05)
        return replace(options, plan=plan, errors=(0.8, 1.25))
    return options


def tolerance(quality: float) -> float:
    """RMS noise of a recording, times which nothing is coded: 1 at 50, halved every 32 points (decision 28)."""
    return rounded(2 ** ((50 - quality) / 32))


def scene_options(quality: float) -> SceneOptions:
    """Return the options of a scene at a quality: its background is as near to the truth as the bodies."""
    usual, times = SceneOptions(), tolerance(quality)
    return replace(usual, coarse=rounded(usual.coarse * times), lattice=rounded(usual.lattice * times))


def _fast(options: LayersOptions) -> LayersOptions:
    """Return options with fewer keys, rounds, nodes and samples, and without patches (decision 24)."""
    coarse = Stage(150, (0.1, 0.045, 0.024), (10.0, 1.0, 0.1))
    fine = Stage(600, (0.024, 0.012), (0.3, 0.05))
    rounds = replace(options.fit, gates=(0.018, 0.012), smoothing=(2.0, 0.4), strides=(4, 1))
    return replace(
        options,
        embedded=replace(options.embedded, coarse=coarse, fine=fine, samples=3000),
        fit=replace(rounds, iterations=20, tolerance=3e-3),
        plan=replace(options.plan, keys=2, misses=1),
        tails=False,
        measured=4,
        floor=False,
    )


def motion_step(quality: float) -> float:
    """Quantiser step of the base's motion as a fraction of the diagonal: .0018 at 50, halved every 25 points.

    Above the knee every 8 points.
    """
    return rounded(0.0018 * 2 ** ((50 - min(quality, KNEE)) / 25 - max(quality - KNEE, 0.0) / 8))


def appearance_options(
    quality: float, color: str, texture: int | None, compatible: bool, splats: int | None
) -> AppearanceOptions | None:
    """Return the options of colours at a quality; None for no colours."""
    if color == "none":
        return None
    crf = round(62 - 0.4 * quality)  # 42 at 50, 54 at 20, 30 at 80
    step = rounded(0.0909 * 2 ** ((50 - quality) / 35))  # as a share of the colours' range; halved every 35 points
    textures = None if color == "vertices" else TextureOptions(texture, crf, color == "texture", compatible)
    return AppearanceOptions(step, textures, splats=splats)


def displacement_step(quality: float) -> float:
    """Quantiser step of the displacements as a fraction of the diagonal: .0008 at 50, halved every 25 points."""
    return rounded(0.0008 * 2 ** ((50 - quality) / 25))


def reference_vertices(quality: float) -> int:
    """Number of vertices of the reference mesh: 800 at 0, 2000 at 50, 5000 at 100."""
    return round(2000 * 2.5 ** ((quality - 50) / 50))
