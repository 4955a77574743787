"""Labels of faces: every face of a body has its number in all frames, and faces of no body have none."""

import numpy as np

from meshreel.encoder.scene.scene import label_frames
from meshreel.geometry.topology import concatenate
from meshreel.types import Mesh, MeshList
from tests.encoder.scene.test_scene import ALL, NONE, SMALL, at
from tests.metrics.shapes import moved, sphere
from tests.small_options import quick

OPTIONS = quick(key_interval=2.0)
COUNT = len(SMALL.faces)


def labels(*frames: Mesh) -> list[list[int]]:
    """The numbers of the pieces of each frame, which are as large as `SMALL`; key intervals have two frames."""
    found = []
    for mesh, (moving, bodies) in zip(frames, label_frames(MeshList(frames, 1.0), ALL, OPTIONS), strict=True):
        assert moving.all() and len(moving) == len(bodies) == len(mesh.faces)
        found.append([np.unique(piece).item() for piece in bodies.reshape(-1, COUNT)])  # one number each
    return found


def test_a_body_keeps_its_number_over_intervals_whatever_the_order_of_faces() -> None:
    assert labels(at(0, 3), at(0, 3), at(3, 0), at(3, 0)) == [[1, 2], [1, 2], [2, 1], [2, 1]]


def test_a_body_that_enters_late_has_a_new_number_and_frames_without_bodies_have_none() -> None:
    assert labels(at(0), at(0), NONE, NONE, at(0, 3), at(0, 3)) == [[1], [1], [], [], [1, 2], [1, 2]]


def test_bits_that_are_there_for_a_moment_move_but_are_of_no_body() -> None:
    bit = moved(sphere(0.05, 2), (9.0, 0, 0))
    assert len(bit.faces) == COUNT
    assert labels(concatenate([at(0), bit]), at(0)) == [[1, 0], [1]]
