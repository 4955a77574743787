"""Views: they see a room from inside, a body from outside, stay out of solids, and are the same every time."""

import numpy as np
import pytest

from meshreel.analysis.scene.labelling import looks
from meshreel.analysis.scene.views import place_views
from meshreel.errors import InputError
from meshreel.geometry.topology import concatenate, face_normals, subdivide_midpoint
from meshreel.types import Mesh, MeshList
from tests.metrics.shapes import moved, sphere

SMALL = {"width": 160, "height": 120}
_CORNERS = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=float)
_FACES = [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1], [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4]]
_FACES += [[1, 5, 7], [1, 7, 3]]


def box(low, high, inwards=False, levels=4) -> Mesh:
    """A box whose faces look outwards, or inwards as a room's walls do."""
    low, high = np.asarray(low, dtype=float), np.asarray(high, dtype=float)
    faces = np.array(_FACES)
    return subdivide_midpoint(Mesh.of(low + _CORNERS * (high - low), faces[:, ::-1] if inwards else faces), levels)


ROOM = concatenate(
    [box((0, 0, 0), (5, 2.5, 4), inwards=True), box((1, 0, 1), (2.5, 1, 2)), moved(sphere(0.3), (4, 1, 3))]
)


@pytest.fixture(scope="module")
def views():
    return place_views([ROOM], **SMALL)


def seen_share(mesh, views):
    """The share of the area whose faces some pixel sees."""
    ids = np.stack([seen.faces for seen in looks(mesh, views)])
    areas = face_normals(mesh)[1]
    return areas[np.unique(ids[ids >= 0])].sum() / areas.sum()


def test_nearly_all_of_a_room_is_seen_and_more_with_more_views():
    shares = [seen_share(ROOM, place_views([ROOM], count=count)) for count in (2, 6, 14)]
    assert shares == sorted(shares) and shares[-1] > 0.95 and shares[0] < 0.9


def test_views_are_in_the_box_and_not_in_solids(views):
    eyes = np.array([view.eye for view in views])
    assert ((eyes > [0, 0, 0]) & (eyes < [5, 2.5, 4])).all()
    assert not ((eyes > [1, 0, 1]) & (eyes < [2.5, 1, 2])).all(axis=1).any()
    hollow = box((0, 0, 0), (1, 1, 1))  # all of its box is inside: its order of corners says nothing then
    assert len(place_views([hollow], **SMALL)) == 14


def test_views_see_the_surface_of_all_inspected_frames():
    ball = sphere(0.3)
    moments = MeshList(
        tuple(concatenate([box((0, 0, 0), (5, 2.5, 4), True), moved(ball, (x, 1, 2))]) for x in (1, 2, 4))
    )
    views = place_views(moments, **SMALL)
    for mesh in moments:
        ids = np.stack([seen.faces for seen in looks(mesh, views)])
        assert np.unique(ids[ids >= len(mesh.faces) - len(ball.faces)]).size > 0.6 * len(ball.faces)


def test_views_differ_and_are_all_of_one_size(views):
    for view in views:
        turn = view.extrinsic[:3, :3]
        assert np.allclose(turn @ turn.T, np.eye(3)) and np.linalg.det(turn) == pytest.approx(1)
        assert (view.width, view.height) == (160, 120)
    assert len({tuple(view.extrinsic.ravel()) for view in views}) == 14


@pytest.mark.parametrize(("up", "axis"), [("y", 1), ("z", 2), ("-y", 1)])
def test_pictures_stand_upright(up, axis):
    for view in place_views([ROOM], up, 6, 80, 60):
        if abs(view.extrinsic[2, axis]) < 0.9:  # it does not look straight up or down
            assert (view.extrinsic[1, axis] < 0) == (not up.startswith("-"))  # y points down in a picture


def test_faces_without_area_do_no_harm():
    flat = Mesh.of([[0, 0, 0], [1, 1, 1], [2, 2, 2]], [[0, 1, 2], [0, 0, 0]])
    assert len(place_views([concatenate([ROOM, flat])], **SMALL)) == 14


def test_empty_frames_are_passed_over_and_none_but_empty_ones_refused():
    assert len(place_views([Mesh.empty(), ROOM], **SMALL)) == 14
    for frames in ([], [Mesh.empty()]):
        with pytest.raises(InputError, match="has a surface"):
            place_views(frames, **SMALL)
