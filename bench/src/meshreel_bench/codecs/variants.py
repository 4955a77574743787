"""Presets with one part switched off or replaced, by name: what an ablation compares with the whole.

In -> out: EncoderOptions -> EncoderOptions. A variant is one line of VARIANTS; `experiments.ablation` runs them.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

from meshreel.encoder.options import EncoderOptions
from meshreel.errors import InputError

Change = Callable[[EncoderOptions], EncoderOptions]

VARIANTS: dict[str, Change] = {
    "no shared detail": lambda o: replace(o, fit=replace(o.fit, components=0)),
    "middle key, no cuts": lambda o: replace(
        o, keys=1, groups=replace(o.groups, limit=1e9, tolerance=1e9, worth=math.inf)
    ),
    "flat midpoints": lambda o: replace(o, layers=replace(o.layers, curvatures=(0,))),
    "plain rounding": lambda o: replace(o, layers=replace(o.layers, price=0.0)),
    "errors along the surface count": lambda o: replace(o, layers=replace(o.layers, tangential=1.0)),
    "groups alone": lambda o: replace(o, predict=False),
    "no tails": lambda o: replace(o, tails=None),
    "background from meshes": lambda o: replace(o, background=replace(o.background, depth=False)),
}


def find_variant(name: str | None) -> Change:
    """The change called `name`; None changes nothing. Raises InputError for an unknown one."""
    if name is None:
        return _as_it_is
    if name not in VARIANTS:
        raise InputError(f"no variant is called {name!r}; known: {', '.join(sorted(VARIANTS))}")
    return VARIANTS[name]


def _as_it_is(options: EncoderOptions) -> EncoderOptions:
    return options
