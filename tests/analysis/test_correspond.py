"""A template is found again in other frames: from its key frame outward, and from the last frame of a group onward."""

from __future__ import annotations

import numpy as np
import pytest

from meshreel.analysis.correspond import from_key, from_last
from meshreel.analysis.embedded import EmbeddedOptions, Stage
from meshreel.analysis.fit_match import Target
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


@pytest.mark.parametrize("key", [0, 2, 4])
def test_a_template_is_followed_from_its_key_in_both_directions(key: int) -> None:
    meshes = frames(5)
    template = Mesh.of(wanted(5)[key], BASE.faces)
    found = from_key(template, key, [Target(mesh) for mesh in meshes], OPTIONS)
    np.testing.assert_allclose(found[key], template.vertices, atol=1e-9)
    assert np.linalg.norm(found - wanted(5), axis=2).max() < 0.01


def test_a_single_frame_keeps_the_template_as_it_is() -> None:
    found = from_key(BASE, 0, [Target(BALL)], OPTIONS)
    np.testing.assert_array_equal(found, BASE.vertices[None])
    assert found.base is not BASE.vertices  # what is given back may be changed


def test_a_template_that_lies_on_the_frame_before_is_followed_onward() -> None:
    meshes = frames(4)
    found = from_last(Mesh.of(wanted(1)[0], BASE.faces), [Target(mesh) for mesh in meshes[1:]], OPTIONS)
    assert found.shape == (3, len(BASE.vertices), 3)
    assert np.linalg.norm(found - wanted(4)[1:], axis=2).max() < 0.02


def test_the_same_frames_give_the_same_bits() -> None:
    targets = [Target(mesh) for mesh in frames(2)]
    first, second = (from_key(BASE, 0, targets, OPTIONS) for _ in range(2))
    np.testing.assert_array_equal(first, second)
