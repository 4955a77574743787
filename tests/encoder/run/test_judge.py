"""The judge of groups: what is whole is left as it is. What is broken on purpose is in the tests of the bench."""

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
import pytest

from meshreel.encoder.group.forms import EncodedGroup
from meshreel.encoder.group.interval import Interval
from meshreel.encoder.layers.recipe import LayersRecipe
from meshreel.encoder.run.judge import judged
from meshreel.errors import InputError
from meshreel.format.layout import Form
from meshreel.geometry.topology import concatenate
from meshreel.types import Mesh, MeshList
from tests.crossed_arms import arms
from tests.metrics.shapes import moved, plane, sphere
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
    found = list(judged(interval, by))
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
    text = r"frame 3: 100.0 % of its surface is lost, and neither a template nor a mesh of its own"
    with pytest.raises(InputError, match=text):
        groups_of(Interval(frames_of(body(1, 3)), first_frame=3), recipe())


class Frozen(LayersRecipe):
    """Shows the first frame for all, and what it finds for each frame alone."""

    def encode(self, interval: Interval) -> Iterator[EncodedGroup]:
        frames = [interval.frames[0]] * len(interval.frames)
        yield from super().encode(replace(interval, frames=MeshList(tuple(frames), 30.0)))


def test_leaves_that_are_not_where_they_were_are_lost_though_the_tree_is_large():
    leaf, random = plane(0.1, 2), np.random.default_rng(0)
    places, ways = random.uniform(-2, 2, (200, 3)), random.normal(size=(200, 3))
    ways *= 0.06 / np.linalg.norm(ways, axis=1)[:, None]
    frames = [concatenate([moved(leaf, at + t * way) for at, way in zip(places, ways, strict=True)]) for t in (0, 1)]
    usual = recipe()
    groups = groups_of(Interval(frames_of(frames)), Frozen(usual.options, usual.key_interval, usual.colored))
    assert all(group.mended and group.form == Form.DRACO for group in groups)


def test_faces_without_area_cover_nothing(monkeypatch):
    """A bit far away whose decoded vertices are one point."""
    ball, bit = sphere(0.3, 3), moved(sphere(0.3, 1), (30.0, 0, 0))
    frames = [concatenate([ball, bit])] * 2
    coarse = concatenate([ball, Mesh(np.full_like(bit.vertices, bit.middle), bit.faces)])
    monkeypatch.setattr("meshreel.encoder.run.judge.LOST", (0.0, 0.0))
    monkeypatch.setattr("meshreel.encoder.run.judge._core.Group", lambda *_: Decoded([coarse] * 2))
    with pytest.raises(InputError, match="of its surface is lost"):
        groups_of(Interval(frames_of(frames)), recipe())


@pytest.mark.parametrize("noise, mended", [(0.002, True), (0.0, False)])
def test_a_template_inside_out_is_encoded_again_where_frames_are_captured(monkeypatch, noise: float, mended: bool):
    """Clean frames may be wound as they like."""
    ball = sphere(0.3, 4)
    turned = Mesh(ball.vertices, np.ascontiguousarray(ball.faces[:, ::-1]))
    monkeypatch.setattr("meshreel.encoder.run.judge._core.Group", lambda *_: Decoded([turned] * 2))
    groups = groups_of(Interval(frames_of([ball] * 2), noise), recipe())
    assert all(group.mended == mended for group in groups)
    assert all(group.form == (Form.DRACO if mended else Form.LAYERS) for group in groups)


class Decoded:
    """A group that decodes to given meshes."""

    state = None

    def __init__(self, meshes: list[Mesh]) -> None:
        self._meshes = meshes

    def frames(self) -> list[tuple[np.ndarray, np.ndarray]]:
        return [(mesh.vertices, mesh.faces) for mesh in self._meshes]
