"""How far points are from surfaces."""

from __future__ import annotations

import numpy as np
import pytest

from meshreel.geometry.nearest import Outline, Surface, distances
from tests.metrics.shapes import brute_force_distances, moved, plane, sphere


@pytest.mark.parametrize("place", [(0, 0, 0), (1e6, -2e6, 3e6)])
def test_distances_are_those_of_all_pairs_wherever_in_the_world(place):
    ball, points = sphere(0.5, 2), np.random.default_rng(0).normal(0, 0.6, (60, 3))
    found = distances(points + np.asarray(place, float), moved(ball, place))
    np.testing.assert_allclose(found, brute_force_distances(points, ball), atol=1e-6)


def test_what_lies_past_the_border_is_told_from_what_lies_above():
    square, ball = plane(1.0, 4), sphere(0.5, 2)
    points = np.array([[0.5, 0.5, 0.3], [0.98, 0.4, -0.2], [1.1, 0.4, 0.2], [-0.1, -0.1, 0], [0.4, 1.3, 0]])
    flat, round_ = Surface(square), Surface(ball)
    for _ in range(2):  # the second time from what was kept
        assert flat.past_border(flat.closest(points)).tolist() == [False, False, True, True, True]
    assert not round_.past_border(round_.closest(points)).any()  # it has none


def test_an_outline_is_where_the_mesh_is():
    place, points = np.array([4e6, -1e6, 2e6]), np.array([[0.5, 0.5, 0.3], [1.1, 0.4, 0.2], [0.4, 1.3, 0.0]])
    outline = Outline(moved(plane(1.0, 4), place))
    assert outline.leaves_out(points + place).tolist() == [False, True, True]
    assert len(outline.leaves_out(np.zeros((0, 3)))) == 0
