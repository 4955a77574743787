"""What is occupied and what is seen free, where a room and a ball say what is what."""

from __future__ import annotations

import numpy as np
import pytest

from meshreel.analysis.segment.cut import moving_places
from meshreel.analysis.segment.places import Places, PlacesOptions, find_places
from meshreel.analysis.segment.views import place_views
from meshreel.errors import InputError
from meshreel.geometry.voxels import Lattice
from meshreel.types import Mesh
from tests.metrics.shapes import moved
from tests.scenes import CELL, RADIUS, SEGMENT, ball, room, with_room

LATTICE = Lattice(np.zeros(3), CELL)
FROM, TO = 0.6, 1.6  # m, where the ball lies in the first half of the frames and in the second
FRAMES = with_room([ball(FROM)] * 2 + [ball(TO)] * 2)


@pytest.fixture(scope="module")
def views():
    return place_views(FRAMES, SEGMENT.views)


@pytest.fixture(scope="module")
def places(views) -> Places:
    return find_places(FRAMES, views, LATTICE)


def on_ball(places: Places, x: float) -> np.ndarray:
    """Places on a ball that lies there, well above the floor."""
    away = np.linalg.norm(places.middles - [x, 1.2, RADIUS + 0.5 * CELL], axis=1)
    return (np.abs(away - RADIUS) < 0.4 * CELL) & (places.middles[:, 2] > 3 * CELL)


def test_where_a_ball_was_it_is_free_before_and_after(places):
    first, second = on_ball(places, FROM), on_ball(places, TO)
    assert first.sum() > 100
    assert places.occupied[:2, first].mean() > 0.98 and places.free[:2, first].mean() < 0.01
    assert places.occupied[2:, first].mean() < 0.05 and places.free[2:, first].mean() > 0.6  # the rest is hidden
    assert places.occupied[2:, second].mean() > 0.98 and places.free[:2, second].mean() > 0.6


def test_the_room_is_never_free(places):
    of_room = (places.middles < 0.6 * CELL).any(axis=1) & ~places.free.any(axis=0)
    assert (of_room.sum() / (places.middles < 0.6 * CELL).any(axis=1).sum()) > 0.97
    assert not (places.occupied & places.free).any()


def test_normals_are_those_of_what_was_there(places):
    chosen = on_ball(places, FROM)
    outward = places.middles[chosen] - [FROM, 1.2, RADIUS + 0.5 * CELL]
    outward /= np.linalg.norm(outward, axis=1)[:, None]
    assert np.median((places.normals[chosen] * outward).sum(axis=1)) > 0.95
    assert np.allclose(np.linalg.norm(places.normals, axis=1), 1, atol=1e-5)


def test_the_order_of_time_does_not_matter(places, views):
    back = find_places(FRAMES[::-1], views, LATTICE)
    assert np.array_equal(back.keys, places.keys) and np.array_equal(back.beside, places.beside)
    assert np.array_equal(back.free, places.free[::-1]) and np.array_equal(back.occupied, places.occupied[::-1])
    assert np.array_equal(back.free_share, places.free_share)
    np.testing.assert_allclose(back.normals, places.normals, atol=1e-4)
    assert np.array_equal(moving_places(back), moving_places(places))


def test_the_same_frames_have_the_same_places(places, views):
    again = find_places(iter(FRAMES), views, LATTICE)
    for name in ("keys", "beside", "occupied", "free", "normals"):
        assert getattr(again, name).tobytes() == getattr(places, name).tobytes()


def test_more_views_that_must_agree_find_less_free(places, views):
    strict = find_places(FRAMES, views, LATTICE, PlacesOptions(views=4))
    assert 0 < strict.free.sum() < places.free.sum() and not (strict.free & ~places.free).any()
    far = find_places(FRAMES, views, LATTICE, PlacesOptions(past=6.0))
    assert far.free.sum() < places.free.sum() and not (far.free & ~places.free).any()


def test_the_back_of_a_face_says_nothing_of_what_is_before_it():
    """Whoever looks through an open side into a wall's back is inside of something that was not scanned."""
    wall = Mesh.of(room().vertices, room().faces[:, ::-1])
    frames = [wall, moved(wall, (0, 0, 0.3))]
    there = place_views([room()], SEGMENT.views)
    assert not find_places(frames, there, LATTICE).free.any()


def test_nobody_looks_behind_nothing(views):
    """Where nothing is met, a place is not known to be free."""
    alone = find_places([ball(FROM), ball(TO)], views, LATTICE)
    assert alone.free.mean() < 0.2


@pytest.mark.parametrize("wrong", [{"frames": 1}, {"past": 0.0}, {"past": float("nan")}, {"views": 0}], ids=str)
def test_options_that_cannot_be_are_refused(wrong):
    with pytest.raises(InputError, match="give"):
        PlacesOptions(**wrong)
