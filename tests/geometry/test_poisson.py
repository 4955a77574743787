"""Poisson reconstruction and its trimming."""

from __future__ import annotations

import os

import numpy as np

from meshreel.geometry.poisson import PoissonOptions, _without_leaf_warnings, drop_small, reconstruct, thin_out
from meshreel.geometry.topology import face_normals
from meshreel.types import Mesh

OPTIONS = PoissonOptions(depth=6, reach=0.05)


def directions(count: int, seed: int = 0) -> np.ndarray:
    points = np.random.default_rng(seed).standard_normal((count, 3))
    return points / np.linalg.norm(points, axis=1, keepdims=True)


def test_points_of_a_ball_give_the_ball_facing_outward() -> None:
    n = directions(5000)
    mesh = reconstruct(0.3 * n, n, OPTIONS)
    np.testing.assert_allclose(np.linalg.norm(mesh.vertices, axis=1), 0.3, atol=0.01)
    outward = np.sum(face_normals(mesh)[0] * mesh.vertices[mesh.faces[:, 0]], axis=1)
    assert (outward > 0).mean() > 0.999


def test_leaf_warnings_are_filtered_and_other_messages_are_shown(capfd, monkeypatch) -> None:
    n = directions(300)
    monkeypatch.setattr("meshreel.geometry.poisson.decimate", lambda mesh, _: (mesh, os.write(2, b"after\n"))[0])
    reconstruct(0.3 * n, n, PoissonOptions(depth=4, reach=0.1))  # the library warns about its leaves
    assert capfd.readouterr().err == "after\n"
    with _without_leaf_warnings():
        os.write(2, b"[WARNING] a (Line 1)\n    _getValues\n    getValue assumes leaf node\n[WARNING] another\n")
    assert capfd.readouterr().err == "[WARNING] another\n"


def test_no_surface_is_invented_where_there_are_no_points() -> None:
    n = directions(6000)
    n = n[n[:, 2] > 0]  # half a ball: Poisson would close it
    mesh = reconstruct(0.3 * n, n, OPTIONS)
    assert mesh.vertices[:, 2].min() > -0.05


def test_the_same_points_give_the_same_bits() -> None:
    n = directions(2000)
    a, b = (reconstruct(0.3 * n, n, OPTIONS) for _ in range(2))
    assert np.array_equal(a.vertices, b.vertices)
    assert np.array_equal(a.faces, b.faces)


def test_too_few_points_give_the_empty_mesh() -> None:
    assert reconstruct(np.zeros((3, 3)), np.zeros((3, 3)), OPTIONS).is_empty


def test_small_components_are_dropped() -> None:
    n = directions(5000)
    points = np.concatenate([0.3 * n, 0.02 * n[:60] + 0.5])
    whole = reconstruct(
        points, np.concatenate([n, n[:60]]), PoissonOptions(depth=6, reach=0.05, trim=10.0, smallest=0.0)
    )
    assert whole.vertices.max() > 0.4
    assert drop_small(whole, 0.1).vertices.max() < 0.4
    assert drop_small(Mesh.empty(), 0.1).is_empty


def test_thinning_keeps_both_sides_of_a_thin_sheet() -> None:
    rng = np.random.default_rng(0)
    top = np.concatenate([rng.uniform(0, 1, (5000, 2)), np.full((5000, 1), 0.501)], axis=1)
    points = np.concatenate([top, top - np.array([0, 0, 0.0005])])
    normals = np.repeat([[0.0, 0, 1], [0.0, 0, -1]], 5000, axis=0)
    few, turned = thin_out(points, normals, 0.1)
    assert 150 <= len(few) <= 250
    np.testing.assert_allclose(np.abs(turned[:, 2]), 1)
