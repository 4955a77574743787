"""Interior samples are even, inside and labelled by body, also for open, flat and dirty meshes."""

import numpy as np
import pytest

from meshreel.geometry.inside import Samples, interior_samples, winding_inside, winding_numbers
from meshreel.geometry.topology import concatenate, subdivide_midpoint
from meshreel.types import Mesh
from tests.metrics import shapes
from tests.metrics.shapes import moved


def sphere(radius: float = 0.3, center: tuple[float, float, float] = (0, 0, 0), levels: int = 4) -> Mesh:
    return moved(shapes.sphere(radius, levels), center)


def sheet(side: float = 0.5) -> Mesh:
    square = Mesh.of([[0, 0, 0], [side, 0, 0], [side, side, 0], [0, side, 0]], [[0, 1, 2], [0, 2, 3]])
    return subdivide_midpoint(square, 4)


def samples_of(mesh: Mesh, count: int = 8000) -> Samples:
    return interior_samples(mesh, count, np.random.default_rng(1))


def test_a_sphere_gets_about_the_requested_count_and_only_points_inside() -> None:
    samples = samples_of(sphere())
    assert 7000 < len(samples.points) < 9000
    assert np.linalg.norm(samples.points, axis=1).max() < 0.301
    assert np.linalg.norm(samples.points.mean(axis=0)) < 0.003


def test_samples_are_as_dense_at_the_core_as_at_the_rim() -> None:
    radius = np.linalg.norm(samples_of(sphere()).points, axis=1)
    share = np.mean(radius < 0.15)
    assert share == pytest.approx(1 / 8, rel=0.08)


def test_a_box_of_twelve_large_faces_is_filled() -> None:
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 2) for z in (0, 0.5)], float) / 3
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    faces = [f for a, b, c, d in quads for f in ((a, b, c), (a, c, d))]
    points = samples_of(Mesh.of(corners, faces)).points
    assert 7000 < len(points) < 9000
    np.testing.assert_allclose(points.mean(axis=0), corners.mean(axis=0), atol=0.01)


def test_a_mesh_without_five_percent_of_its_faces_is_still_filled() -> None:
    whole = sphere()
    kept = np.random.default_rng(3).random(len(whole.faces)) > 0.05
    samples = samples_of(Mesh.of(whole.vertices, whole.faces[kept]))
    radius = np.linalg.norm(samples.points, axis=1)
    assert 7000 < len(samples.points) < 9000
    assert np.mean(radius > 0.301) < 0.01
    assert np.mean(radius < 0.15) == pytest.approx(1 / 8, rel=0.08)


def test_an_inside_out_mesh_is_filled() -> None:
    ball = sphere()
    assert 7000 < len(samples_of(Mesh.of(ball.vertices, ball.faces[:, ::-1])).points) < 9000


def test_bodies_are_numbered_by_volume() -> None:
    samples = samples_of(concatenate([sphere(0.1, (0.4, 0, 0)), sphere(0.2, (-0.2, 0, 0))]))
    sizes = np.bincount(samples.bodies)
    assert sizes[0] / sizes[1] == pytest.approx(8, rel=0.1)
    assert (samples.points[samples.bodies == 0, 0] < 0.1).all()


def test_a_speck_is_no_body() -> None:
    samples = samples_of(concatenate([sphere(0.3), sphere(0.01, (0.45, 0, 0), levels=2)]))
    assert samples.bodies.max() == 0
    assert samples.points[:, 0].max() < 0.31


def test_a_hollow_body_is_one_body_and_stays_hollow_where_its_inner_wall_looks_inwards() -> None:
    inner = sphere(0.15)
    samples = samples_of(concatenate([sphere(0.3), Mesh.of(inner.vertices, inner.faces[:, ::-1])]))
    assert samples.bodies.max() == 0
    assert np.linalg.norm(samples.points, axis=1).min() > 0.149


def test_a_flat_sheet_is_sampled_on_its_surface() -> None:
    samples = samples_of(sheet())
    assert 7000 < len(samples.points) < 9000
    assert np.abs(samples.points[:, 2]).max() < 1e-12
    np.testing.assert_allclose(samples.points[:, :2].mean(axis=0), 0.25, atol=0.005)


def test_a_sheet_beside_a_solid_becomes_a_separate_body() -> None:
    samples = samples_of(concatenate([sphere(0.2, (0, 0, 0.5)), sheet()]))
    assert samples.bodies.max() == 1
    assert np.abs(samples.points[samples.bodies == 1, 2]).max() < 1e-3


def test_zero_area_faces_do_no_harm() -> None:
    ball = sphere()
    dirty = Mesh.of(ball.vertices, np.concatenate([ball.faces, [[0, 0, 1]] * 50]))
    assert 7000 < len(samples_of(dirty).points) < 9000
    assert len(samples_of(Mesh.of(ball.vertices, [[0, 0, 1]])).points) == 2


def test_winding_separates_inside_from_outside_and_accepts_an_empty_query() -> None:
    queries = np.array([[0, 0, 0], [0.29, 0, 0], [0.31, 0, 0], [5.0, 5, 5]])
    assert winding_inside(sphere(), queries).tolist() == [True, True, False, False]
    assert winding_inside(sphere(), np.zeros((0, 3))).shape == (0,)


def test_nothing_lies_inside_a_mesh_without_faces():
    assert winding_numbers(Mesh.of(np.eye(3), []), np.zeros((2, 3))).tolist() == [0.0, 0.0]
