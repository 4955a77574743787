"""Votes: equations 1 to 4 hold for any masks."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from meshreel.analysis.scene.labelling import votes
from meshreel.analysis.scene.views import place_views
from meshreel.geometry.drawing import draw
from meshreel.types import Mesh
from tests.metrics.shapes import sphere

FACES = 7
ids_of_views = arrays(np.int32, (2, 3, 4), elements=st.integers(-1, FACES - 1))
masks_of_views = arrays(np.bool_, (2, 3, 4))


@given(ids_of_views, masks_of_views)
def test_votes_are_the_sums_of_the_paper(ids, masks):
    dynamic, seen = votes(ids, masks, FACES)
    for face in range(FACES):
        assert dynamic[face] == sum(p == face and m for p, m in zip(ids.ravel(), masks.ravel(), strict=True))
        assert seen[face] == (ids == face).sum()


def test_a_mask_of_one_half_of_a_ball_finds_that_half():
    ball = sphere(levels=4)
    views = place_views([ball, Mesh(3 * ball.vertices, ball.faces[:, ::-1])], "y", 12, 160, 120)
    ids = np.stack([draw(ball, view).faces for view in views])
    assert ids.shape == (12, 120, 160) and ids.dtype == np.int32
    right = ball.vertices[ball.faces].mean(axis=1)[:, 0] > 0
    dynamic, count = votes(ids, (ids >= 0) & right[ids], len(ball.faces))
    seen = count > 0
    assert seen.mean() > 0.9 and np.array_equal((dynamic >= 0.5 * count)[seen], right[seen])


def test_an_empty_mesh_has_no_votes():
    nothing = np.full((1, 2, 2), -1, np.int32)
    assert [len(each) for each in votes(nothing, np.ones((1, 2, 2), bool), 0)] == [0, 0]
