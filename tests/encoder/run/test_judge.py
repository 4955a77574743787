"""The judge of groups: what is whole is left as it is. What is broken on purpose is in the tests of the bench."""

from collections.abc import Callable

import pytest

from meshreel.encoder.group.forms import EncodedGroup
from meshreel.encoder.group.interval import Interval
from meshreel.encoder.layers.recipe import LayersRecipe
from meshreel.encoder.run.judge import judged
from meshreel.errors import InputError
from meshreel.types import Mesh, MeshList
from tests.crossed_arms import arms
from tests.small_bodies import body
from tests.small_options import quick

BODIES: dict[str, Callable[[], list[Mesh]]] = {
    "bends": lambda: body(0, 6),
    "bends, finer": lambda: body(1, 6),
    "bends, noise": lambda: body(2, 6),
    "arms": lambda: [arms(number, 0.03) for number in range(10, 22, 2)],
}


def frames_of(meshes: list[Mesh]) -> MeshList:
    return MeshList(tuple(meshes), 30.0)


def recipe() -> LayersRecipe:
    found = quick().recipe(lambda *_: iter(()))
    assert isinstance(found, LayersRecipe)
    return found


def groups_of(interval: Interval, by: LayersRecipe) -> list[EncodedGroup]:
    found = list(judged(interval, by, None))
    assert sum(group.frame_count for group in found) == len(interval.frames)
    return found


@pytest.mark.parametrize("name", BODIES)
def test_groups_that_hold_are_those_of_the_recipe(name: str):
    interval = Interval(frames_of(BODIES[name]()), first_frame=7)
    groups = groups_of(interval, recipe())
    assert [group.payload for group in groups] == [group.payload for group in recipe().encode(interval)]
    assert not any(group.mended for group in groups) and all(group.fidelity.covered > 0.98 for group in groups)
    assert all(7 <= group.fidelity.least < 13 for group in groups)


def test_where_nothing_holds_there_is_an_error_and_no_file(monkeypatch):
    monkeypatch.setattr("meshreel.encoder.run.judge.NEAR", 0.0)
    with pytest.raises(InputError, match=r"frames 3 to \d of track 0: neither a template nor a mesh"):
        groups_of(Interval(frames_of(body(1, 3)), first_frame=3), recipe())
