"""The first view in a file's metadata: which ones count, and what is passed over."""

import numpy as np
import pytest

from meshreel.format.view import View, known_view

GOOD = {"position": [0, 1, 3], "target": [0, 1, 0.5], "fov": 45}


def test_a_view_is_read_as_it_is_written():
    view = View((0.0, 1.0, 3.0), (0.0, 1.0, 0.5), 30.0)
    assert known_view(view.item) == view
    assert known_view({"view": GOOD | {"later": "unknown"}}) == View((0.0, 1.0, 3.0), (0.0, 1.0, 0.5), 45.0)


@pytest.mark.parametrize(
    "item",
    [
        "front",
        None,
        [],
        GOOD | {"fov": 0},
        GOOD | {"fov": 180},
        GOOD | {"fov": "45"},
        GOOD | {"fov": float("nan")},
        GOOD | {"target": GOOD["position"]},
        GOOD | {"position": [0, 1]},
        GOOD | {"position": [0, 1, 1e16]},
        GOOD | {"position": [0, 1, "3"]},
        GOOD | {"position": [0, 1, True]},
        GOOD | {"target": {"x": 1}},
        {name: value for name, value in GOOD.items() if name != "fov"},
    ],
)
def test_what_is_no_view_is_passed_over(item):
    """Files from before it may have any tag of this name."""
    assert known_view({"view": item}) is None and known_view({}) is None


def test_a_view_moves_with_what_it_shows():
    turn = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    moved = View((0.0, 0.0, 2.0), (0.0, 0.0, 0.0)).moved(3.0, turn, (1.0, 1.0, 1.0))
    assert moved == View((7.0, 1.0, 1.0), (1.0, 1.0, 1.0))
