"""Faces are cut in two at their longest edges: the surface stays where it is, and has no cracks."""

import numpy as np

from meshreel.geometry.bisection import bisected
from meshreel.geometry.topology import border_edges, edge_lengths, face_normals
from tests.metrics.shapes import plane, sphere


def test_a_cut_surface_is_the_same_and_has_no_crack():
    random = np.random.default_rng(0)
    for mesh in (sphere(1.0, 3), plane(1.0, 5)):
        border, normals = len(border_edges(mesh)), face_normals(mesh)
        cut = mesh
        for _ in range(6):
            chosen = random.random(len(cut.faces)) < 0.1
            longest = edge_lengths(cut).max()
            finer = bisected(cut, chosen)
            assert len(finer.faces) >= len(cut.faces) + chosen.sum()
            np.testing.assert_array_equal(finer.vertices[: len(cut.vertices)], cut.vertices)
            assert edge_lengths(finer).max() <= longest
            cut = finer
        assert (len(border_edges(cut)) == 0) == (border == 0)
        after = face_normals(cut)
        np.testing.assert_allclose(after[1].sum(), normals[1].sum(), rtol=1e-12)
        np.testing.assert_allclose(
            (after[0] * after[1][:, None]).sum(axis=0), (normals[0] * normals[1][:, None]).sum(axis=0), atol=1e-12
        )
        inner = np.ptp(np.bincount(cut.faces.reshape(-1), minlength=len(cut.vertices)))
        assert inner > 0 and cut.faces.max() == len(cut.vertices) - 1  # each new vertex is used


def test_angles_do_not_become_thinner_without_end():
    mesh = plane(1.0, 2)
    for _ in range(8):
        mesh = bisected(mesh, mesh.vertices[mesh.faces].mean(axis=1)[:, 0] < 0.3)
    areas = face_normals(mesh)[1]
    longest = (
        np.square(mesh.vertices[mesh.faces] - mesh.vertices[np.roll(mesh.faces, 1, axis=1)]).sum(axis=2).max(axis=1)
    )
    assert (2 * areas / longest).min() > 0.24  # half of a square cut along its diagonal: the half of .5, at least


def test_where_nothing_is_chosen_nothing_is_cut():
    mesh = sphere(1.0, 2)
    same = bisected(mesh, np.zeros(len(mesh.faces), bool))
    np.testing.assert_array_equal(same.vertices, mesh.vertices)
    assert sorted(map(sorted, same.faces.tolist())) == sorted(map(sorted, mesh.faces.tolist()))
