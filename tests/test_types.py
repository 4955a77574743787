"""Frames by number: some of them, evenly spread."""

from __future__ import annotations

import pytest

from meshreel.types import evenly


@pytest.mark.parametrize(
    ("count", "most", "wanted"),
    [(9, 3, [0, 4, 8]), (60, 2, [0, 59]), (3, 10, [0, 1, 2]), (5, 1, [0]), (5, 0, []), (0, 4, [])],
)
def test_some_frames_are_evenly_spread_from_the_first_to_the_last(count, most, wanted):
    assert evenly(count, most) == wanted
