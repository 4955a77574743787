"""Hypotheses: moving objects are found among tracked ones, and found again in the views of a moment."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from meshreel.analysis.scene.hypotheses import (
    Tracked,
    hypotheses,
    moving_in_views,
    overlap,
    reference_view,
    tour,
    variation,
)
from meshreel.analysis.scene.views import place_views
from meshreel.geometry.drawing import draw
from meshreel.geometry.topology import concatenate
from tests.analysis.scene.test_views import ROOM, box
from tests.metrics.shapes import moved, sphere

WALKER, CHAIR, LAMP = 1, 2, 3


def scene(frames: int = 8) -> Tracked:
    """Somebody walks, a chair stands and flickers at its border, a lamp stands."""
    objects = np.zeros((frames, 20, 40), np.int32)
    for frame in range(frames):
        objects[frame, 12:18, 30:38] = CHAIR
        objects[frame, 12, 30 + frame % 2] = 0
        objects[frame, 0:4, 0:4] = LAMP
        objects[frame, 6:14, 3 * frame : 3 * frame + 5] = WALKER
    return Tracked(objects, {WALKER: "person", CHAIR: "chair", LAMP: "lamp"})


def test_the_mask_of_a_walking_object_varies_and_that_of_a_standing_one_does_not():
    tracked = scene()
    assert variation(tracked.objects, WALKER) > 0.7 and variation(tracked.objects, LAMP) == 0
    assert 0 < variation(tracked.objects, CHAIR) < 0.05 and variation(tracked.objects, 9) == 0
    found = hypotheses(tracked)
    assert np.array_equal(found.objects > 0, tracked.objects == WALKER) and found.kinds == {"person"}


def test_a_kind_with_one_standing_object_does_not_move_elsewhere():
    tracked = scene()
    tracked.kinds[LAMP] = "person"  # a statue
    assert hypotheses(tracked).kinds == frozenset()


def test_objects_of_a_moment_take_the_numbers_of_the_moving_objects():
    moving = hypotheses(scene())
    objects = np.zeros((2, 20, 40), np.int32)
    objects[0] = np.where(scene().objects[3] == WALKER, 7, np.where(scene().objects[3] == CHAIR, 8, 0))
    objects[1, 5:9, 5:9], objects[1, 12:15, 5:9], objects[1, 0:3, 0:3], objects[1, 0:3, 6:9] = 7, 8, 9, 10
    moment = Tracked(objects, {7: "person", 8: "chair", 9: "person", 10: "chair"})
    found = moving_in_views(moment, moving, 3)
    assert np.array_equal(found[0], np.where(objects[0] == 7, WALKER, 0))
    assert np.array_equal(found[1] == WALKER, objects[1] == 7)
    assert np.array_equal(found[1] == moving.elsewhere, objects[1] == 9)  # the reference view does not see it
    assert not found[1][(objects[1] == 8) | (objects[1] == 10)].any()


def test_where_nothing_is_tracked_nothing_moves():
    nothing = Tracked(np.zeros((3, 4, 5), np.int32), {})
    moving = hypotheses(nothing)
    assert not moving.objects.any() and not moving_in_views(nothing, moving, 0).any()


@given(st.integers(0, 2**12 - 1), st.integers(0, 2**12 - 1))
def test_overlap_is_symmetric_and_one_only_for_equal_masks(a, b):
    one, other = (np.array([[bool(bits >> k & 1) for k in range(12)]]) for bits in (a, b))
    assert overlap(one, other) == overlap(other, one) and 0 <= overlap(one, other) <= 1
    assert (overlap(one, other) == 1) == (a == b)


def test_a_tour_visits_every_view_once_and_turns_gently():
    views = place_views([ROOM], width=80, height=60)
    order = tour(views, 5)
    assert order[0] == 5 and sorted(order) == list(range(len(views)))
    axes = np.array([views[k].extrinsic[2, :3] for k in order])
    plain = np.array([view.extrinsic[2, :3] for view in views])
    turns, before = ((1 - (a[1:] * a[:-1]).sum(axis=1)).mean() for a in (axes, plain))
    assert turns < before
    assert tour(views[:1], 0) == [0]


def test_the_reference_view_is_the_one_that_sees_the_change():
    views = place_views([ROOM], "y", 6, 80, 60)
    walls = box((0, 0, 0), (5, 2.5, 4), inwards=True)
    meshes = [concatenate([walls, moved(sphere(0.4), (x, 1.2, 2))]) for x in (1.5, 2.5, 3.5)]
    moments = [[draw(mesh, view) for view in views] for mesh in meshes]
    changes = [
        max(int((np.abs(m[k].depth - moments[0][k].depth) > 0.1).sum()) for m in moments) for k in range(len(views))
    ]
    assert changes[reference_view(moments)] > np.median(changes)
