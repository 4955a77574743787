"""An encoder with a stage that is broken on purpose: what it makes first of frames is of others than it says.

The encoder's judge of groups must catch each, and what is delivered must cover the frames.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, fields, replace

import numpy as np

from meshreel.encoder.group.forms import EncodedGroup
from meshreel.encoder.group.interval import Interval
from meshreel.encoder.layers.recipe import LayersRecipe
from meshreel.encoder.paper.recipe import find_groups
from meshreel.encoder.settings.options import EncoderOptions, FindGroups, Recipe
from meshreel.types import Mesh, MeshList


def without_a_limb(mesh: Mesh) -> Mesh:
    """Without the last 15 % of its longest extent."""
    axis = int(np.ptp(mesh.vertices, axis=0).argmax())
    low, high = mesh.vertices[:, axis].min(), mesh.vertices[:, axis].max()
    beyond = mesh.vertices[:, axis] > low + 0.85 * (high - low)
    return Mesh(mesh.vertices, mesh.faces[~beyond[mesh.faces].any(axis=1)])


def shifted(mesh: Mesh) -> Mesh:
    """A tenth of the diagonal away."""
    return mesh.at(mesh.vertices + [0.1 * mesh.diagonal, 0, 0])


STAGES: dict[str, Callable[[list[Mesh]], list[Mesh]]] = {
    "freezes": lambda frames: [frames[0]] * len(frames),
    "drops a limb": lambda frames: [*frames[:-1], without_a_limb(frames[-1])],
    "drops a limb in all": lambda frames: [without_a_limb(frame) for frame in frames],
    "doubles a frame": lambda frames: [frames[0], *frames[:-1]],
    "moves one away": lambda frames: [*frames[:-1], shifted(frames[-1])],
}


@dataclass(frozen=True)
class Broken(LayersRecipe):
    """A recipe that breaks each interval so many times, counted by its first frame and track."""

    stage: str = "freezes"
    times: int = 1
    _broken: dict[tuple[int, int], int] = field(default_factory=dict, compare=False, repr=False)

    def encode(self, interval: Interval) -> Iterator[EncodedGroup]:
        place = interval.first_frame, interval.track
        self._broken[place] = self._broken.get(place, 0) + 1
        if self._broken[place] <= self.times and not interval.frames[0].is_empty:
            frames = STAGES[self.stage](list(interval.frames))
            interval = replace(interval, frames=MeshList(tuple(frames), interval.frame_rate))
        yield from super().encode(interval)


@dataclass(frozen=True, slots=True)
class BrokenOptions(EncoderOptions):
    """Options of an encoder one of whose stages is broken."""

    stage: str = "freezes"

    @classmethod
    def of(cls, options: EncoderOptions, stage: str) -> BrokenOptions:
        return cls(**{each.name: getattr(options, each.name) for each in fields(EncoderOptions)}, stage=stage)

    def recipe(self, find: FindGroups = find_groups) -> Recipe:
        whole = EncoderOptions.recipe(self, find)
        assert isinstance(whole, LayersRecipe), "only templates are judged"
        return Broken(whole.options, whole.key_interval, whole.colored, stage=self.stage)
