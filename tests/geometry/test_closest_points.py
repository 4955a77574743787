"""Closest points, distances and borders of surfaces."""

import numpy as np
import pytest

from meshreel.geometry.closest_points import MovingSurface, Surface, distances
from meshreel.geometry.threads import mapped, threads
from meshreel.types import Mesh
from tests.metrics.shapes import brute_force_distances, moved, plane, sphere


@pytest.mark.parametrize("place", [(0, 0, 0), (1e6, -2e6, 3e6)])
def test_distances_equal_brute_force_at_any_offset(place):
    ball, points = sphere(0.5, 2), np.random.default_rng(0).normal(0, 0.6, (60, 3))
    found = distances(points + np.asarray(place, float), moved(ball, place))
    np.testing.assert_allclose(found, brute_force_distances(points, ball), atol=1e-6)


def test_answers_do_not_depend_on_the_order_of_the_queries():
    ball, rng = Surface(sphere(0.5, 3)), np.random.default_rng(0)
    points = rng.normal(0, 0.6, (500, 3))
    hits, mixed = ball.closest(points), rng.permutation(len(points))
    again, alone = ball.closest(points[mixed]), [ball.closest(point[None]) for point in points]
    for name in ("points", "faces", "barycentric"):
        np.testing.assert_array_equal(getattr(again, name), getattr(hits, name)[mixed])
        np.testing.assert_array_equal(np.concatenate([getattr(one, name) for one in alone]), getattr(hits, name))
    repeated = ball.closest(np.full((5, 3), 0.7))
    assert len(set(repeated.faces.tolist())) == 1 and len(ball.closest(np.zeros((0, 3))).faces) == 0


def test_queries_past_the_border_differ_from_queries_above_the_surface():
    square, ball = plane(1.0, 4), sphere(0.5, 2)
    points = np.array([[0.5, 0.5, 0.3], [0.98, 0.4, -0.2], [1.1, 0.4, 0.2], [-0.1, -0.1, 0], [0.4, 1.3, 0]])
    flat, round_ = Surface(square), Surface(ball)
    for _ in range(2):  # the second time from what was kept
        assert flat.past_border(flat.closest(points)).tolist() == [False, False, True, True, True]
    assert not round_.past_border(round_.closest(points)).any()  # it has none


def test_the_border_separates_points_past_the_border_at_any_offset():
    place, points = np.array([4e6, -1e6, 2e6]), np.array([[0.5, 0.5, 0.3], [1.1, 0.4, 0.2], [0.4, 1.3, 0.0]])
    surface = Surface(moved(plane(1.0, 4), place))
    assert surface.past_border(surface.closest(points + place)).tolist() == [False, True, True]
    assert len(surface.past_border(surface.closest(np.zeros((0, 3))))) == 0


def test_faces_that_are_gone_are_as_if_they_had_never_been():
    ball, rng = sphere(0.5, 3), np.random.default_rng(1)
    gone, points = rng.random(len(ball.faces)) < 0.5, rng.normal(0, 0.6, (400, 3))
    hits, rest = Surface(ball).closest(points, gone), np.flatnonzero(~gone)
    wanted = Surface(ball.with_faces(~gone)).closest(points)
    assert not gone[hits.faces].any()
    np.testing.assert_allclose(hits.points, wanted.points, atol=1e-6)
    assert (hits.faces == rest[wanted.faces]).mean() > 0.9  # others are as near: edges


def test_a_surface_that_moved_far_answers_as_one_that_was_built_there():
    ball, rng = sphere(levels=3), np.random.default_rng(0)
    ball = ball.at(np.concatenate([ball.vertices, [[-1e9, 0, 0]]]))  # a vertex without faces, which stays
    surface, away = Surface(ball), ball.at(np.concatenate([ball.vertices[:-1] + 1e6, ball.vertices[-1:]]))
    surface.move(away.vertices)
    queries = away.vertices[rng.integers(0, len(away.vertices) - 1, 50)] + 0.2 * rng.standard_normal((50, 3))
    assert np.allclose(surface.distances(queries), distances(queries, away), rtol=1e-9)


def test_a_surface_that_moves_answers_several_threads_at_a_time():
    ball, points = sphere(0.5, 3), np.random.default_rng(2).normal(0, 0.6, (200, 3))
    moving, places = MovingSurface(ball), [ball.vertices + [0.1 * k, 0, 0] for k in range(8)]

    def asked(vertices: np.ndarray) -> np.ndarray:
        with moving.at(vertices) as there:
            return there.distances(points)

    with threads(4):
        found = mapped(asked, places)
    for distances_there, vertices in zip(found, places, strict=True):
        wanted = distances(points, Mesh(vertices, ball.faces))
        np.testing.assert_allclose(distances_there, wanted, atol=1e-6)
