"""Tracking of a template: from the chosen key, and onward from the last frame of a group."""

from __future__ import annotations

import numpy as np
import pytest

from meshreel.analysis.fit.frame import FrameSurface
from meshreel.analysis.follow import correspond
from meshreel.analysis.follow.correspond import choose_key, from_last
from meshreel.analysis.follow.embedded import EmbeddedOptions, Stage
from meshreel.capture.procedural import sliding_sphere
from meshreel.types import Mesh

OPTIONS = EmbeddedOptions(Stage(40, (0.1, 0.06, 0.03), (10.0, 1.0, 0.1)), Stage(120, (0.024,), (0.3,)), samples=800)
BALL = Mesh.of(sliding_sphere(1)[0].vertices * [0.4, 0.2, 0.1], sliding_sphere(1)[0].faces)
BASE = Mesh.of(sliding_sphere(1, levels=1)[0].vertices * [0.4, 0.2, 0.1], sliding_sphere(1, levels=1)[0].faces)


def frames(count: int) -> list[Mesh]:
    """An ellipsoid that slides and turns about x, so that where its points go is known."""
    found = []
    for t in range(count):
        c, s = np.cos(0.05 * t), np.sin(0.05 * t)
        found.append(Mesh.of(placed(BALL.vertices, c, s, t), BALL.faces))
    return found


def placed(points: np.ndarray, c: float, s: float, t: int) -> np.ndarray:
    return points @ np.array([[1, 0, 0], [0, c, s], [0, -s, c]]) + [0.01 * t, 0, 0]


def wanted(count: int) -> np.ndarray:
    return np.stack([placed(BASE.vertices, np.cos(0.05 * t), np.sin(0.05 * t), t) for t in range(count)])


def with_speck(mesh: Mesh) -> Mesh:
    """Beside the body's end one face."""
    speck = mesh.vertices[mesh.vertices[:, 0].argmax()] + [0.03, 0, 0] + 0.002 * np.eye(3)
    return Mesh.of(np.concatenate([mesh.vertices, speck]), [*mesh.faces, len(mesh.vertices) + np.arange(3)])


@pytest.fixture
def tried(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """The keys that are tried."""
    keys, motion = list[int](), correspond._follow

    def recorded(surfaces: list[FrameSurface], key: int, *rest: object) -> correspond.KeyMotion:
        keys.append(key)
        return motion(surfaces, key, *rest)

    monkeypatch.setattr(correspond, "_follow", recorded)
    return keys


def test_of_an_even_motion_the_middle_frame_is_the_key_and_no_other_is_tried(tried: list[int]) -> None:
    motion = choose_key([FrameSurface(mesh) for mesh in frames(5)], OPTIONS)
    assert (motion.key, motion.count, tried) == (2, 5, [2])
    template = Mesh.of(wanted(5)[2], BASE.faces)
    found = motion.move(template)
    np.testing.assert_allclose(found[2], template.vertices, atol=1e-9)
    assert np.linalg.norm(found - wanted(5), axis=2).max() < 0.01


def test_a_single_frame_keeps_the_template_as_it_is() -> None:
    motion = choose_key([FrameSurface(BALL)], OPTIONS)
    assert (motion.key, motion.count) == (0, 1)
    np.testing.assert_allclose(motion.move(BASE), BASE.vertices[None], atol=1e-12)


def test_frames_are_followed_up_to_one_that_is_lost() -> None:
    other = Mesh.of(BALL.vertices[:, [1, 2, 0]] * 2 + [0, 0.3, 0], BALL.faces)
    motion = choose_key([FrameSurface(mesh) for mesh in [*frames(4), other]], OPTIONS)
    assert motion.key < motion.count == 4
    assert motion.move(BASE).shape == (4, len(BASE.vertices), 3)


def test_no_frame_is_tracked_if_the_first_one_differs_from_the_key() -> None:
    other = Mesh.of(BALL.vertices[:, [1, 2, 0]] * 2 + [0, 0.3, 0], BALL.faces)
    motion = choose_key([FrameSurface(mesh) for mesh in [other, *frames(2)]], OPTIONS, 1)
    assert (motion.key, motion.count) == (1, 0)


def test_where_something_appears_that_the_middle_frame_has_not_another_is_the_key(tried: list[int]) -> None:
    first = frames(5)
    targets = [FrameSurface(mesh) for mesh in (*first[:3], *map(with_speck, first[3:]))]
    motion = choose_key(targets, OPTIONS)
    assert (motion.key, motion.count) == (3, 5) and tried[:2] == [2, 3]
    tried.clear()
    assert choose_key(targets, OPTIONS, 1).key == 2 and tried == [2]


def test_a_template_that_lies_on_the_frame_before_is_followed_onward() -> None:
    meshes = frames(4)
    found = from_last(meshes[0], [FrameSurface(mesh) for mesh in meshes[1:]], OPTIONS)
    assert np.linalg.norm(found - [mesh.vertices for mesh in meshes[1:]], axis=2).max() < 0.02


def test_a_template_is_followed_onward_up_to_a_frame_that_is_lost() -> None:
    other = Mesh.of(BALL.vertices[:, [1, 2, 0]] * 2 + [0, 0.3, 0], BALL.faces)
    for count in (0, 2):
        targets = [FrameSurface(mesh) for mesh in [*frames(count + 1)[1:], other, BALL]]
        assert from_last(BALL, targets, OPTIONS).shape == (count, len(BALL.vertices), 3)


def test_the_same_frames_give_the_same_bits() -> None:
    targets = [FrameSurface(mesh) for mesh in frames(2)]
    first, second = (choose_key(targets, OPTIONS).move(BASE) for _ in range(2))
    np.testing.assert_array_equal(first, second)
