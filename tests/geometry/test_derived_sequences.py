"""Derived sequences: chosen frames, and all frames forth and back."""

from __future__ import annotations

import pytest

from meshreel.capture.procedural import sliding_sphere
from meshreel.errors import InputError
from meshreel.geometry.derived_sequences import Chosen, Upright, captured, forth_and_back


def test_chosen_frames_are_those_of_the_source():
    source = sliding_sphere(5, levels=1)
    some = Chosen(source, (4, 0))
    assert len(some) == 2 and some.frame_rate == source.frame_rate
    assert [mesh.vertices[0, 0] for mesh in some] == [source[4].vertices[0, 0], source[0].vertices[0, 0]]


def test_forth_and_back_moves_by_one_frame_at_a_time():
    source = sliding_sphere(4, levels=1)
    places = [source[i].vertices[0, 0] for i in range(4)]
    played = [mesh.vertices[0, 0] for mesh in forth_and_back(source, 9)]
    assert played == [places[i] for i in (0, 1, 2, 3, 2, 1, 0, 1, 2)]
    assert len(forth_and_back(source, 2)) == 2 and len(forth_and_back(sliding_sphere(1, levels=1), 3)) == 3


def test_a_sequence_that_names_no_up_axis_is_refused():
    class Sideways(Upright):
        up = "x"

    with pytest.raises(InputError, match="up axis 'x'"):
        captured(Sideways(sliding_sphere(2, levels=1), None))
