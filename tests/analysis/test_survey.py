"""The survey: bounding box, scale, and intervals that hold frames of one kind."""

import numpy as np

from meshreel.analysis.plan import cut_at
from meshreel.analysis.survey import survey_sequence
from meshreel.types import Mesh, MeshList

TRIANGLE = Mesh.of([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])


def scaled(factor):
    return Mesh.of(TRIANGLE.vertices * factor, TRIANGLE.faces)


def test_intervals_cover_every_frame_once_and_are_of_even_length():
    intervals = survey_sequence(MeshList((TRIANGLE,) * 23)).intervals(10)
    assert [i for interval in intervals for i in interval] == list(range(23))
    assert {len(interval) for interval in intervals} == {7, 8}


def test_an_interval_is_all_empty_or_has_no_empty_frame():
    intervals = survey_sequence(MeshList((TRIANGLE, Mesh.empty(), Mesh.empty(), TRIANGLE))).intervals(10)
    assert [list(interval) for interval in intervals] == [[0], [1, 2], [3]]


def test_frames_of_very_different_scale_are_not_in_one_interval():
    intervals = survey_sequence(MeshList((scaled(1), scaled(3), scaled(100), scaled(150)))).intervals(10)
    assert [list(interval) for interval in intervals] == [[0, 1], [2, 3]]


def test_normalised_frames_fit_a_box_of_diagonal_one_around_zero():
    survey = survey_sequence(MeshList((scaled(7), scaled(9))))
    vertices = survey.normalise(scaled(9)).vertices
    assert np.allclose(vertices.min(axis=0) + vertices.max(axis=0), 0)
    assert np.isclose(np.linalg.norm(np.ptp(vertices, axis=0)), 1)


def test_faces_that_are_not_kept_are_counted():
    doubled = Mesh.of(TRIANGLE.vertices, [[0, 1, 2], [2, 1, 0], [0, 0, 1]])
    assert survey_sequence(MeshList((TRIANGLE, doubled))).dropped == 2


def test_frames_that_are_followed_are_not_cut():
    assert cut_at(np.full(10, 0.9)) is None
    assert cut_at(np.array([5.0])) is None


def test_a_group_is_cut_where_its_frames_stop_being_followed():
    assert cut_at(np.array([0.5, 0.6, 0.5, 0.5, 4.0, 5.0, 4.5])) == 4


def test_small_residuals_never_cut_however_uneven():
    assert cut_at(np.array([0.01, 0.01, 0.9])) is None
