"""Presets with one part switched off or replaced, by name: what an ablation compares with the whole."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from meshreel.encoder.options import EncoderOptions, LayersOptions, SceneOptions
from meshreel.encoder.presets import preset_options
from meshreel.errors import InputError

Change = Callable[[EncoderOptions], EncoderOptions]


def _layers(change: Callable[[LayersOptions], LayersOptions]) -> Change:
    """A change of the recipe of layers."""

    def changed(options: EncoderOptions) -> EncoderOptions:
        if not isinstance(options.method, LayersOptions):
            raise InputError("this variant changes the recipe of layers; use preset `best`")
        return replace(options, method=change(options.method))

    return changed


def _background_from_meshes(options: EncoderOptions) -> EncoderOptions:
    scene = options.scene or SceneOptions()
    return replace(options, scene=replace(scene, background=replace(scene.background, depth=False)))


VARIANTS: dict[str, Change] = {
    "fast": lambda options: preset_options(options.preset, options.quality, effort="fast"),
    "no shared detail": _layers(lambda o: replace(o, fit=replace(o.fit, components=0))),
    "middle key, no cuts": _layers(lambda o: replace(o, plan=replace(o.plan, keys=1, limit=1e9, worth=1e9))),
    "flat midpoints": _layers(lambda o: replace(o, layers=replace(o.layers, curvatures=(0,)))),
    "plain rounding": _layers(lambda o: replace(o, layers=replace(o.layers, price=0.0))),
    "errors along the surface count": _layers(lambda o: replace(o, layers=replace(o.layers, tangential=1.0))),
    "groups alone": _layers(lambda o: replace(o, predict=False)),
    "no tails": _layers(lambda o: replace(o, tails=None)),
    "background from meshes": _background_from_meshes,
}


def find_variant(name: str | None) -> Change:
    """The change called `name`; None changes nothing. Raises InputError for an unknown one."""
    if name is None:
        return lambda options: options
    if name not in VARIANTS:
        raise InputError(f"no variant is called {name!r}; known: {', '.join(sorted(VARIANTS))}")
    return VARIANTS[name]
