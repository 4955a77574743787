"""Detection of scenes: rooms are scenes, lone bodies are not."""

import numpy as np
import pytest

from meshreel.errors import InputError
from meshreel.types import Mesh
from tests.metrics.shapes import moved, plane, sphere
from tests.scenes import ball, figure, is_scene, room, with_room

ROLLING = with_room([ball(0.5 + 0.25 * t) for t in range(5)])


def test_a_room_is_a_scene_with_or_without_people_and_anywhere_in_space():
    assert is_scene([moved(mesh, (1e6, -1e6, 2e6)) for mesh in ROLLING])
    assert is_scene([room()] * 2)


def test_a_body_alone_is_none_moving_or_still():
    assert not is_scene([ball(0.5 + 0.5 * t) for t in range(4)])
    assert not is_scene([figure(0.3)] * 4)  # closed
    holed = sphere(levels=5)
    assert not is_scene([Mesh(holed.vertices, holed.faces[40:])] * 4)


def test_a_room_that_moves_is_none():
    assert not is_scene([moved(room(), (0.3 * t, 0.3 * t, 0.3 * t)) for t in range(4)])


@pytest.mark.parametrize("offset", [0.0, 0.5])
def test_an_open_sheet_is_one_where_it_stands_still(offset):
    fine = sphere(levels=5)
    half = Mesh(fine.vertices, fine.faces[: len(fine.faces) // 2])
    assert is_scene([moved(half, (offset * t, offset * t, 0)) for t in range(4)]) == (offset == 0)


def test_a_mesh_of_few_cells_is_no_scene_because_small_steps_do_not_show():
    assert not is_scene([moved(plane(1.0, 8), (0.05 * t, 0, 0)) for t in range(3)])
    assert is_scene([plane(1.0, 30)] * 3)


def test_empty_and_single_frames_are_none_and_empty_ones_between_do_no_harm():
    assert not is_scene([]) and not is_scene([room()]) and not is_scene([Mesh.empty()] * 4)
    assert not is_scene([Mesh.empty(), room()])
    assert is_scene([ROLLING[0], Mesh.empty(), *ROLLING[1:]])


def test_frames_without_extent_are_none():
    assert not is_scene([Mesh.of(np.ones((3, 3)), [[0, 1, 2]])] * 3)


@pytest.mark.parametrize("spoil", ["nan", "face"])
def test_frames_that_cannot_be_used_are_refused_with_their_number(spoil):
    bad = Mesh.of(room().vertices.copy(), room().faces.copy())
    if spoil == "nan":
        bad.vertices[3, 1] = np.nan
    else:
        bad.faces[5, 0] = len(bad.vertices)
    with pytest.raises(InputError, match="frame 2"):
        is_scene([room(), room(), bad])
