"""Presets with one part switched off or replaced, by name: what an ablation compares with the whole."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TypeVar

from meshreel.encoder.layers.options import LayersOptions
from meshreel.encoder.paper.options import PaperOptions
from meshreel.encoder.settings.options import EncoderOptions, SceneOptions
from meshreel.encoder.settings.presets import plain_displacements
from meshreel.encoder.settings.settings import Settings
from meshreel.errors import InputError

UNIFORM, IN_MDS_POSE, BOTH = "one step, plain rounding", "MDS pose, no cuts", "MDS pose, no cuts, one step"
RELEASED, LARGER = "the release's step", "reference of 5000 vertices"
TOGETHER, FROM_MESHES = "one sequence", "background from meshes"  # of a scene
RELEASED_STEP = 5e-5  # of a diagonal: the release has 1e-4 m, and people's diagonals are about 2 m
Change = Callable[[EncoderOptions], EncoderOptions]
Method = TypeVar("Method", LayersOptions, PaperOptions)


def _method(kind: type[Method], change: Callable[[Method], Method], text: str) -> Change:
    """Return a change of one method; `text` names the method and its presets in errors."""

    def changed(options: EncoderOptions) -> EncoderOptions:
        if not isinstance(options.method, kind):
            raise InputError(f"this variant changes {text}")
        return replace(options, method=change(options.method))

    return changed


def _layers(change: Callable[[LayersOptions], LayersOptions]) -> Change:
    return _method(LayersOptions, change, "the recipe of layers; use preset `best`")


def _paper(change: Callable[[PaperOptions], PaperOptions]) -> Change:
    return _method(PaperOptions, change, "the paper's recipe; use preset `paper` or `paper-literal`")


def _plain(options: PaperOptions) -> PaperOptions:
    """One step, plain rounding, and as many anchors as `paper-literal` has."""
    return replace(options, displacements=plain_displacements(options.displacements))


def _scene(change: Callable[[SceneOptions], SceneOptions]) -> Change:
    return lambda options: replace(options, scene=change(options.scene or SceneOptions()))


VARIANTS: dict[str, Change] = {
    "fast": lambda options: Settings(options.preset, options.quality, "fast").resolved(),  # type: ignore[arg-type]
    "no shared detail": _layers(lambda o: replace(o, fit=replace(o.fit, components=0))),
    "middle key, no cuts": _layers(lambda o: replace(o, plan=replace(o.plan, keys=1, limit=1e9, worth=1e9))),
    "flat midpoints": _layers(lambda o: replace(o, layers=replace(o.layers, curvatures=(0,)))),
    "plain rounding": _layers(lambda o: replace(o, layers=replace(o.layers, price=0.0))),
    "errors along the surface count": _layers(lambda o: replace(o, layers=replace(o.layers, tangential=1.0))),
    "groups alone": _layers(lambda o: replace(o, predict=False)),
    "no tails": _layers(lambda o: replace(o, tails=False)),
    UNIFORM: _paper(_plain),
    IN_MDS_POSE: _paper(lambda o: replace(o, pose="mds", cuts=False)),
    BOTH: _paper(lambda o: replace(_plain(o), pose="mds", cuts=False)),
    RELEASED: _paper(lambda o: replace(o, displacements=replace(o.displacements, step=RELEASED_STEP))),
    LARGER: _paper(lambda o: replace(o, reference=replace(o.reference, vertices=5000))),
    FROM_MESHES: _scene(lambda o: replace(o, from_depth=False)),
    TOGETHER: _scene(lambda o: replace(o, near=1e4)),  # all pieces are near each other
}


def find_variant(name: str | None) -> Change:
    """The change called `name`; None changes nothing. Raises InputError for an unknown one."""
    if name is None:
        return lambda options: options
    if name not in VARIANTS:
        raise InputError(f"no variant is called {name!r}; known: {', '.join(sorted(VARIANTS))}")
    return VARIANTS[name]
