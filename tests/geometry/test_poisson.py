"""Poisson reconstruction as the paper has it: closed where there are points, open where there are none."""

from __future__ import annotations

import sys

import numpy as np
import pytest

from meshreel.errors import InputError
from meshreel.geometry.poisson import poisson_surface
from meshreel.geometry.topology import face_normals


def directions(count: int) -> np.ndarray:
    points = np.random.default_rng(0).standard_normal((count, 3))
    return points / np.linalg.norm(points, axis=1, keepdims=True)


def test_points_of_a_ball_give_the_ball_facing_outward_and_the_same_bits() -> None:
    n = directions(4000)
    mesh, again = (poisson_surface(0.3 * n, n, 6, 0.05) for _ in range(2))
    np.testing.assert_allclose(np.linalg.norm(mesh.vertices, axis=1), 0.3, atol=0.01)
    outward = np.sum(face_normals(mesh)[0] * mesh.vertices[mesh.faces[:, 0]], axis=1)
    assert (outward > 0).mean() > 0.999
    assert np.array_equal(mesh.vertices, again.vertices) and np.array_equal(mesh.faces, again.faces)


def test_no_surface_is_invented_where_there_are_no_points() -> None:
    n = directions(6000)
    n = n[n[:, 2] > 0]  # half a ball: Poisson would close it
    assert poisson_surface(0.3 * n, n, 6, 0.05).vertices[:, 2].min() > -0.06
    assert poisson_surface(n[:3], n[:3], 6, 0.05).is_empty


def test_without_open3d_the_error_names_the_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "open3d", None)
    with pytest.raises(InputError, match=r"extra `open3d`: pip install 'meshreel\[open3d\]'"):
        poisson_surface(np.zeros((20, 3)), np.zeros((20, 3)), 6, 0.05)
