"""Encoder options that are quick on small procedural bodies: few centers and nodes, coarse templates, few trials."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from meshreel.analysis.follow.embedded import EmbeddedOptions, Stage
from meshreel.analysis.scene import places, segmentation, views
from meshreel.encoder.group.forms import Fidelity, IntraOptions
from meshreel.encoder.layers.options import LayersOptions
from meshreel.encoder.paper.recipe import PaperOptions
from meshreel.encoder.scene import parts
from meshreel.encoder.settings.options import EncoderOptions
from meshreel.encoder.settings.settings import Settings

VIEWS = (6, 120, 90)  # number and size of views, pixels
TRIALS = IntraOptions(fractions=(1.0,), steps=(1.4, 0.7))


def quick(*chosen: Any, **named: Any) -> EncoderOptions:
    """The options of `Settings(*chosen, **named)` made small."""
    return small(Settings(*chosen, **named).resolved())


def small(options: EncoderOptions) -> EncoderOptions:
    """The same options for small bodies."""
    method = options.method
    method = _quick_layers(method) if isinstance(method, LayersOptions) else _quick_paper(method)
    return replace(options, method=method)


def resolve_small(patch: Callable[[Any, str, Any], None] = setattr) -> None:
    """Let all settings resolve to small options."""
    resolved = Settings.resolved
    patch(Settings, "resolved", lambda settings: small(resolved(settings)))


def look_quickly(patch: Callable[[Any, str, Any], None] = setattr) -> None:
    """Let scenes be looked at in few frames, by few, small views, which few samples place."""
    for module, name, value in (
        (views, "_PLACES", 4),
        (views, "_FRAMES", 2),
        (views, "_SAMPLES", 256),
        (places, "_FRAMES", 6),
        (parts, "FRAMES", 4),
        (segmentation, "place_views", lambda meshes, up: views.place_views(meshes, up, *VIEWS)),
    ):
        patch(module, name, value)


def with_method(options: EncoderOptions, **changes: object) -> EncoderOptions:
    """The options with other values of the recipe's own."""
    return replace(options, method=replace(options.method, **changes))  # type: ignore[arg-type]


def _quick_layers(options: LayersOptions) -> LayersOptions:
    coarse = Stage(40, (0.1, 0.06, 0.03), (10.0, 1.0, 0.1))
    fine = Stage(120, (0.024, 0.012), (0.3, 0.1))
    fit = replace(options.fit, gates=(0.024, 0.012), smoothing=(2.0, 0.4), strides=(2, 1))
    return replace(options, embedded=EmbeddedOptions(coarse, fine, samples=800), fit=fit, intra=TRIALS)


def _quick_paper(options: PaperOptions) -> PaperOptions:
    return replace(
        options,
        intra=TRIALS,
        target=Fidelity(distance=0.003, angle=15.0, worst=0.006),
        track=replace(options.track, centers=min(options.track.centers, 150), samples=3000),
        reference=replace(options.reference, vertices=150),
    )
