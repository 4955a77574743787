"""Faces have the label of their component; small components are removed."""

from __future__ import annotations

import numpy as np

from meshreel.geometry.topology import connected_faces, without_fragments
from meshreel.types import Mesh
from tests.metrics.shapes import moved, sphere


def test_faces_have_the_label_of_their_component():
    faces = np.array([[5, 3, 5], [1, 2, 4], [3, 5, 6]], np.int32)
    assert connected_faces(faces, 7).tolist() == [2, 1, 2]
    assert len(connected_faces(np.zeros((0, 3), np.int32), 0)) == 0


def test_only_components_with_enough_area_are_left():
    large, small = sphere(1.0, 2), moved(sphere(0.1, 1), (3, 0, 0))
    both = Mesh.of(
        np.concatenate([small.vertices, large.vertices]),
        np.concatenate([small.faces, large.faces + len(small.vertices)]),
    )
    left = without_fragments(both, 1.0)
    assert np.array_equal(left.vertices, large.vertices) and np.array_equal(left.faces, large.faces)
    assert without_fragments(both, 100.0).is_empty and without_fragments(Mesh.empty(), 1.0).is_empty
