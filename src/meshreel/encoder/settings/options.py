"""Options of the encoder: a recipe with its own options, how a scene is taken apart, and the key interval.

`EncoderOptions()` is what `encode` uses by default; `Settings.resolved` makes options of what a user chooses.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from importlib.util import find_spec

from ...analysis.scene.bodies import NEAR
from ...analysis.scene.segmentation import Cameras
from ...errors import InputError
from ..appearance.options import AppearanceOptions
from ..layers.options import LayersOptions
from ..layers.recipe import LayersRecipe
from ..paper.options import PaperOptions
from ..paper.recipe import FindGroups, PaperRecipe, find_groups

MOST_SECONDS = 600  # of a key interval: viewers who join late decode that much before the first picture (guess)


MethodOptions = PaperOptions | LayersOptions  # the class names the recipe


@dataclass(frozen=True, slots=True)
class SceneOptions:
    """Options of the separation of a scene into a background and moving bodies."""

    cameras: Cameras = ()  # that look at the scene, of one size; none: they are placed
    from_depth: bool = True  # fuse the background from depth pictures where the sequence has them
    coarse: float = 0.5  # RMS distance that decimation may cost the background, in RMS noise (decision 19)
    lattice: float = 0.3  # spacing of the background's lattice, in RMS noise (decision 19)
    refresh: float | None = None  # s between two copies of the background in the file; None: one copy
    near: float = NEAR  # cells of the scene: pieces of consecutive frames nearer than this are one body


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
            raise InputError(f"method {self.method!r}: give PaperOptions or LayersOptions, or use Settings")
        if self.scene is not None and not isinstance(self.scene, SceneOptions):
            raise InputError(f"scene {self.scene!r}: give SceneOptions, or None where nothing stands still")
        if not 0 < self.key_interval <= MOST_SECONDS:
            raise InputError(f"key interval {self.key_interval:g}: give seconds, above 0 and at most {MOST_SECONDS}")

    def recipe(self, find: FindGroups = find_groups) -> LayersRecipe | PaperRecipe:
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
