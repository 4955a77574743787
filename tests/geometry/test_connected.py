"""Connected components by SciPy have the labels of the decoder's implementation."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from meshreel.geometry.connected import connected, connected_faces
from meshreel.geometry.topology import components

FACES = st.lists(st.tuples(*[st.integers(0, 19)] * 3), max_size=30)


@settings(deadline=None)
@given(FACES)
def test_labels_are_those_of_components(faces):
    array = np.array(faces, np.int32).reshape(-1, 3)
    label = connected(array, 20)
    assert np.array_equal(label, components(array, 20))
    assert np.array_equal(connected_faces(array, 20), label[array[:, 0]])


def test_an_empty_mesh_has_no_labels():
    assert len(connected(np.zeros((0, 3), np.int32), 0)) == len(connected_faces(np.zeros((0, 3), np.int32), 0)) == 0
    assert connected(np.zeros((0, 3), np.int32), 3).tolist() == [0, 1, 2]


def test_repeated_faces_still_connect_vertices():
    assert connected(np.array([[0, 1, 2]] * 256, np.int32), 4).tolist() == [0, 0, 0, 1]
