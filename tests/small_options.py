"""Encoder options that are quick on small procedural bodies: few centers and nodes, coarse templates, few trials."""

from __future__ import annotations

from dataclasses import replace

from meshreel.analysis.follow.embedded import EmbeddedOptions, Stage
from meshreel.analysis.scene.segmentation import SegmentOptions
from meshreel.analysis.scene.views import ViewsOptions
from meshreel.encoder.group.draco import IntraOptions
from meshreel.encoder.group.target import Fidelity
from meshreel.encoder.layers.options import LayersOptions
from meshreel.encoder.paper.options import PaperOptions
from meshreel.encoder.settings.options import EncoderOptions, SceneOptions
from meshreel.encoder.settings.presets import preset_options

VIEWS = ViewsOptions(count=6, width=120, height=90, places=4, samples=500)
TRIALS = IntraOptions(fractions=(1.0,), steps=(1.4, 0.7), levels=(0,))


def quick(
    preset: str = "best",
    quality: float = 50.0,
    basis_size: int | None = None,
    group_size: int | None = None,
    centers: int | None = None,
    key_interval: float | None = None,
    effort: str = "normal",
    color: str = "auto",
    color_quality: float | None = None,
    texture: int | None = None,
    compatible: bool = False,
    splats: int | None = None,
) -> EncoderOptions:
    """The preset's options made small; takes what `preset_options` takes."""
    colors = {
        "color": color,
        "color_quality": color_quality,
        "texture": texture,
        "compatible": compatible,
        "splats": splats,
    }
    options = preset_options(preset, quality, basis_size, group_size, centers, key_interval, effort, **colors)  # type: ignore[arg-type]
    method = options.method
    method = _quick_layers(method) if isinstance(method, LayersOptions) else _quick_paper(method)
    return replace(options, method=method, scene=SceneOptions(SegmentOptions(views=VIEWS)))


def with_method(options: EncoderOptions, **changes: object) -> EncoderOptions:
    """The options with other values of the recipe's own."""
    return replace(options, method=replace(options.method, **changes))  # type: ignore[arg-type]


def _quick_layers(options: LayersOptions) -> LayersOptions:
    coarse = Stage(40, (0.1, 0.06, 0.03), (10.0, 1.0, 0.1))
    fine = Stage(120, (0.024, 0.012), (0.3, 0.1))
    fit = replace(options.fit, gates=(0.024, 0.012), smoothing=(2.0, 0.4), strides=(2, 1))
    return replace(options, embedded=EmbeddedOptions(coarse, fine, samples=800), fit=fit, intra=TRIALS)


def _quick_paper(options: PaperOptions) -> PaperOptions:
    fuse = replace(options.reference.fuse, voxel=1.0)
    return replace(
        options,
        intra=TRIALS,
        target=Fidelity(distance=0.003, angle=15.0, worst=0.006),
        track=replace(options.track, centers=min(options.track.centers, 150), samples=3000),
        reference=replace(options.reference, vertices=150, keys=1, trial_vertices=150, fuse=fuse),
    )
