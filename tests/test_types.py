"""Frames by number, and the axis that points up."""

from __future__ import annotations

import numpy as np
import pytest

from meshreel.errors import InputError
from meshreel.types import UP_AXES, check_up, evenly, known_up


@pytest.mark.parametrize(
    ("count", "most", "wanted"),
    [(9, 3, [0, 4, 8]), (60, 2, [0, 59]), (3, 10, [0, 1, 2]), (5, 1, [0]), (5, 0, []), (0, 4, [])],
)
def test_some_frames_are_evenly_spread_from_the_first_to_the_last(count, most, wanted):
    assert evenly(count, most) == wanted


@pytest.mark.parametrize("axis", UP_AXES)
def test_an_axis_that_can_point_up_is_known(axis: str) -> None:
    check_up(axis)
    assert known_up(axis) == axis
    assert np.linalg.norm(UP_AXES[known_up(axis)]) == 1.0


@pytest.mark.parametrize("told", ["x", "", None, 1, ["z"], {"up": "z"}])
def test_where_a_file_says_nothing_that_is_known_y_points_up(told: object) -> None:
    assert known_up(told) == "y"


def test_another_axis_is_refused() -> None:
    with pytest.raises(InputError, match="up axis 'x': give y, z, -y, -z"):
        check_up("x")
