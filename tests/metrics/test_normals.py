import numpy as np
import pytest

from meshreel.metrics.distance import surface_errors
from meshreel.metrics.surface_samples import angles, interpolate, welded_normals
from meshreel.types import Mesh

from .shapes import noisy, plane, sphere


def test_angles_agree_with_the_arc_cosine_and_are_exact_where_it_is_not():
    rng = np.random.default_rng(0)
    a, b = (v / np.linalg.norm(v, axis=1)[:, None] for v in rng.normal(size=(2, 100, 3)))
    assert np.allclose(angles(a, b), np.degrees(np.arccos((a * b).sum(axis=1))))
    tiny = 1e-9
    assert angles(np.array([[1.0, 0, 0]]), np.array([[1.0, tiny, 0]]))[0] == pytest.approx(np.degrees(tiny))
    assert angles(a, -a) == pytest.approx(180)


def test_a_missing_normal_is_the_worst_angle():
    assert angles(np.zeros((1, 3)), np.array([[0.0, 0, 1]]))[0] == 180


def test_the_error_of_a_tilted_plane_is_its_tilt():
    flat = plane()
    turn = np.radians(12)
    rotation = np.array([[1, 0, 0], [0, np.cos(turn), -np.sin(turn)], [0, np.sin(turn), np.cos(turn)]])
    errors = surface_errors(flat, Mesh.of(flat.vertices @ rotation.T, flat.faces))
    assert errors.angle == pytest.approx(12, abs=1e-3)
    assert errors.vertex_angle == pytest.approx(12, abs=1e-3)


def test_the_error_of_a_flipped_mesh_is_180_degrees():
    body = sphere()
    assert surface_errors(body, Mesh.of(body.vertices, body.faces[:, ::-1])).angle == pytest.approx(180, abs=0.1)


def test_the_mean_angle_agrees_with_random_points_over_the_area():
    a, b = sphere(levels=4), noisy(sphere(levels=4), 0.002)
    corner = _random_normals(a), _random_normals(b)  # the same faces and weights: equal topology
    assert surface_errors(a, b).forward.angle == pytest.approx(angles(*corner).mean(), rel=0.05)


def test_seams_do_not_split_normals():
    body = sphere(levels=3)
    soup = Mesh.of(body.vertices[body.faces].reshape(-1, 3), np.arange(3 * len(body.faces)).reshape(-1, 3))
    assert np.allclose(welded_normals(soup), welded_normals(body)[body.faces.reshape(-1)])
    assert surface_errors(body, soup).angle < 0.01


def test_welded_normals_of_a_fine_sphere_point_outwards():
    body = sphere(levels=4)
    assert angles(welded_normals(body), body.vertices).max() < 1
    assert welded_normals(Mesh.empty()).shape == (0, 3)


def _random_normals(mesh: Mesh) -> np.ndarray:
    rng = np.random.default_rng(3)
    weights = rng.dirichlet([1, 1, 1], 20_000)
    corners = mesh.faces[rng.integers(0, len(mesh.faces), 20_000)]
    return interpolate(welded_normals(mesh), corners, weights)
