"""How far points are from surfaces."""

from __future__ import annotations

import numpy as np
import pytest

from meshreel.geometry.nearest import distances
from tests.metrics.shapes import brute_force_distances, moved, sphere


@pytest.mark.parametrize("place", [(0, 0, 0), (1e6, -2e6, 3e6)])
def test_distances_are_those_of_all_pairs_wherever_in_the_world(place):
    ball, points = sphere(0.5, 2), np.random.default_rng(0).normal(0, 0.6, (60, 3))
    found = distances(points + np.asarray(place, float), moved(ball, place))
    np.testing.assert_allclose(found, brute_force_distances(points, ball), atol=1e-6)
