"""Recipes: how a method makes groups of an interval, and the colours that every method's groups get.

In -> out: an interval, a recipe -> groups, in order. An interval needs no other frames, so that intervals can be
encoded side by side.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Protocol, runtime_checkable

from ..types import evenly
from .appearance.colors import colored_groups, has_pictures
from .appearance.options import AppearanceOptions
from .group.digests import note
from .group.forms import EncodedGroup
from .group.interval import Interval
from .group.progress import Stages

LOOKED_AT = 3  # frames of an interval whose textures tell whether it has some (guess)


@runtime_checkable  # for the checks of arguments in tests
class Recipe(Protocol):
    """A method of encoding with its options: `LayersRecipe` or `PaperRecipe`."""

    @property
    def name(self) -> str:
        """The name of the preset that uses it."""
        ...

    @property
    def group_size(self) -> int:
        """The largest number of frames in a group."""
        ...

    @property
    def bodies_apart(self) -> bool:
        """True if bodies that never touch become separate tracks."""
        ...

    def longest(self, frame_rate: float) -> int:
        """Return the largest number of frames in an interval, at this rate (1/s)."""
        ...

    def encode(self, interval: Interval, stages: Stages | None = None) -> Iterator[EncodedGroup]:
        """Yield the groups of an interval, in order, without colours."""
        ...


def encode_interval(
    interval: Interval, recipe: Recipe, appearance: AppearanceOptions | None = None, stages: Stages | None = None
) -> Iterator[EncodedGroup]:
    """Yield the groups of an interval, in order, with colours by `appearance`; None leaves colours out."""
    count = len(interval.frames)
    sample = (interval.frames[number] for number in evenly(count, LOOKED_AT))
    splats = appearance is not None and appearance.splats is not None
    interval = replace(interval, pictured=splats or has_pictures(interval, sample, appearance))
    for group in colored_groups(recipe.encode(interval, stages), interval, appearance, stages):
        note("payload", group.form.name, group.payload, *(one.read() for one in group.companions))
        yield group
