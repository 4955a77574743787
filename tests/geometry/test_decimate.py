"""Quadric decimation."""

import numpy as np
import pytest

from meshreel.errors import InputError
from meshreel.geometry.closest_points import Surface
from meshreel.geometry.decimate import decimate, decimate_faces
from meshreel.geometry.topology import border_edges, clean
from meshreel.types import Mesh
from tests.metrics.shapes import plane, sphere


def sheet(n: int = 40) -> Mesh:
    mesh = plane(1.0, n - 1)
    return Mesh.of(mesh.vertices + 0.05 * np.sin(6 * mesh.vertices[:, :1]) * (0, 0, 1), mesh.faces)


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e3])
@pytest.mark.parametrize("target", [200, 1000])
def test_a_closed_mesh_reaches_its_count_and_keeps_its_shape_at_any_scale(scale: float, target: int) -> None:
    whole = sphere(levels=5)
    small = decimate(Mesh(whole.vertices * scale + 5 * scale, whole.faces), target)
    assert len(small.vertices) == pytest.approx(target, rel=0.02)
    assert not len(border_edges(small))
    radius = np.linalg.norm(small.vertices / scale - 5, axis=1)
    np.testing.assert_allclose(radius, 1, atol=3.0 / target)


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e3])
def test_an_open_mesh_keeps_its_border(scale: float) -> None:
    whole = sheet()
    small = decimate(Mesh(whole.vertices * scale, whole.faces), 200)
    assert len(small.vertices) == pytest.approx(200, rel=0.05)
    border = whole.vertices[np.isin(whole.vertices[:, 1], (0, 1))]
    gap = Surface(Mesh(small.vertices / scale, small.faces)).closest(border).points - border
    assert np.linalg.norm(gap, axis=1).max() < 0.005


def test_no_vertex_of_flat_surface_takes_in_all_others() -> None:
    flat = plane(1.0, 60)
    small = decimate_faces(flat, len(flat.faces) // 2)
    assert np.bincount(small.faces.reshape(-1)).max() <= 16


def test_what_is_left_is_clean_and_the_same_each_time() -> None:
    a, b = decimate(sphere(levels=5), 300), decimate(sphere(levels=5), 300)
    assert np.array_equal(a.vertices, b.vertices)
    assert np.array_equal(a.faces, b.faces)
    assert len(clean(a).faces) == len(a.faces)


def test_a_mesh_that_is_small_enough_stays_and_an_empty_one_stays_empty() -> None:
    assert np.array_equal(decimate(sphere(levels=2), 1000).vertices, sphere(levels=2).vertices)
    assert decimate(Mesh.empty(), 10).is_empty


def test_an_impossible_count_is_refused() -> None:
    with pytest.raises(InputError, match="at least 4"):
        decimate(sphere(levels=1), 3)


@pytest.mark.parametrize("mesh", [sphere(levels=4), sheet()], ids=["closed", "open"])
def test_one_collapse_reaches_a_number_of_faces(mesh: Mesh) -> None:
    small = decimate_faces(mesh, 500)
    assert 480 <= len(small.faces) <= 500
    assert decimate_faces(small, 5000).faces.shape == small.faces.shape
    np.testing.assert_allclose(Surface(mesh).closest(small.vertices).points, small.vertices, atol=0.02)


def test_too_few_faces_are_refused() -> None:
    with pytest.raises(InputError, match="faces is 3"):
        decimate_faces(sphere(levels=1), 3)


def test_separate_triangles_may_be_fewer_than_what_a_quick_first_pass_leaves() -> None:
    """fast-simplification refuses such a number of faces."""
    corners = np.random.default_rng(0).random((120, 3))
    soup = Mesh.of(corners, np.arange(120).reshape(-1, 3))
    assert 0 < len(decimate(soup, 6).faces) <= 40
