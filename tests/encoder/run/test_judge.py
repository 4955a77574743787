"""The judge of groups: what is broken on purpose is caught and mended, and what is whole is left as it is."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace

import numpy as np
import pytest

from meshreel.encoder.group.forms import EncodedGroup
from meshreel.encoder.group.interval import Interval
from meshreel.encoder.group.progress import Stages
from meshreel.encoder.layers.recipe import LayersRecipe
from meshreel.encoder.run.judge import judged
from meshreel.errors import InputError
from meshreel.types import Mesh, MeshList
from tests.crossed_arms import arms
from tests.small_bodies import body
from tests.small_options import quick

BODIES = {
    "bends": lambda: body(0, 6),
    "bends, finer": lambda: body(1, 6),
    "bends, noise": lambda: body(2, 6),
    "arms": lambda: [arms(number, 0.03) for number in range(10, 22, 2)],
}
Breaks = Callable[[list[Mesh]], list[Mesh]]


def without_a_limb(mesh: Mesh) -> Mesh:
    """Without the surface beyond nine tenths of its longest extent."""
    axis = int(np.ptp(mesh.vertices, axis=0).argmax())
    low, high = mesh.vertices[:, axis].min(), mesh.vertices[:, axis].max()
    beyond = mesh.vertices[:, axis] > low + 0.85 * (high - low)
    return Mesh(mesh.vertices, mesh.faces[~beyond[mesh.faces].any(axis=1)])


def shifted(mesh: Mesh) -> Mesh:
    return Mesh(mesh.vertices + [0.1 * mesh.diagonal, 0, 0], mesh.faces)


BREAKS: dict[str, Breaks] = {
    "freezes": lambda frames: [frames[0]] * len(frames),
    "drops a limb": lambda frames: [*frames[:-1], without_a_limb(frames[-1])],
    "drops a limb in all": lambda frames: [without_a_limb(frame) for frame in frames],
    "doubles a frame": lambda frames: [frames[0], frames[0], *frames[2:]],
    "moves one away": lambda frames: [*frames[:2], shifted(frames[2]), *frames[3:]],
}


def frames_of(meshes: list[Mesh]) -> MeshList:
    return MeshList(tuple(meshes), 30.0)


def recipe() -> LayersRecipe:
    found = quick().recipe(lambda *_: iter(()))
    assert isinstance(found, LayersRecipe)
    return found


@dataclass(frozen=True)
class Broken(LayersRecipe):
    """A recipe whose first groups are of other frames than they say."""

    breaks: Breaks = list
    times: list[int] = field(default_factory=lambda: [1])  # how often it still breaks

    def encode(self, interval: Interval, stages: Stages | None = None) -> Iterator[EncodedGroup]:
        if self.times[0] > 0:
            self.times[0] -= 1
            interval = replace(interval, frames=frames_of(self.breaks(list(interval.frames))))
        yield from super().encode(interval, stages)


def groups_of(interval: Interval, by: LayersRecipe) -> list[EncodedGroup]:
    found = list(judged(interval, by, None))
    assert sum(group.frame_count for group in found) == len(interval.frames)
    return found


@pytest.mark.parametrize("breaks", BREAKS)
@pytest.mark.parametrize("name", BODIES)
def test_what_a_stage_breaks_is_caught_and_encoded_again(name: str, breaks: str):
    interval = Interval(frames_of(BODIES[name]()), first_frame=7)
    whole = groups_of(interval, recipe())
    assert not any(group.mended for group in whole) and all(group.fidelity.covered > 0.98 for group in whole)
    again = groups_of(interval, Broken(recipe().options, breaks=BREAKS[breaks]))
    assert any(group.mended for group in again)
    assert all(group.fidelity.covered > 0.98 for group in again)
    assert all(7 <= group.fidelity.least < 13 for group in again)


def test_where_every_template_is_broken_each_frame_gets_a_mesh_of_its_own():
    interval = Interval(frames_of(body(1, 4)))
    groups = groups_of(interval, Broken(recipe().options, breaks=BREAKS["freezes"], times=[99]))
    assert {group.form.name for group in groups} == {"DRACO"} and all(group.mended for group in groups)


def test_where_nothing_holds_there_is_an_error_and_no_file(monkeypatch):
    monkeypatch.setattr("meshreel.encoder.run.judge.NEAR", (0.0, 0.0))
    with pytest.raises(InputError, match=r"frames 3 to \d of track 0: neither a template nor a mesh"):
        groups_of(Interval(frames_of(body(1, 3)), first_frame=3), recipe())


def test_groups_that_hold_are_those_of_the_recipe():
    interval = Interval(frames_of(body(0, 6)))
    assert [g.payload for g in judged(interval, recipe(), None)] == [g.payload for g in recipe().encode(interval)]
