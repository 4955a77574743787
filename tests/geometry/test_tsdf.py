"""Grids of signed distances and the surface in them."""

from __future__ import annotations

import numpy as np

from meshreel.geometry.topology import face_normals
from meshreel.geometry.tsdf import SIDE, extract, fill_grid, new_grid

VOXEL = 0.05


def grid_of(field, weight=lambda points: np.ones(points.shape[:-1]), blocks=range(-2, 2)):
    """The grid of a function of places, block by block."""
    numbers = np.array([[i, j, k] for i in blocks for j in blocks for k in blocks], np.int32)
    inside = np.stack(np.meshgrid(*[np.arange(SIDE)] * 3, indexing="ij"), axis=-1)[..., ::-1]  # [k, j, i] is i, j, k
    points = VOXEL * (SIDE * numbers[:, None, None, None] + inside)
    return fill_grid(VOXEL, numbers, field(points).astype(np.float32), weight(points).astype(np.float32))


def ball(points):
    return np.linalg.norm(points, axis=-1) - 0.5


def test_the_surface_is_where_the_distance_is_zero_and_faces_outwards():
    mesh = extract(grid_of(ball), 0.5)
    radius = np.linalg.norm(mesh.vertices, axis=1)
    assert np.abs(radius - 0.5).max() < 0.02 * VOXEL + 1e-3
    normals, areas = face_normals(mesh)
    outwards = (normals * mesh.vertices[mesh.faces].mean(axis=1)).sum(axis=1)
    assert (outwards > 0).all() and abs(areas.sum() - np.pi) < 0.02 * np.pi


def test_array_axes_map_to_world_axes():
    for axis in range(3):
        mesh = extract(grid_of(lambda points, axis=axis: points[..., axis] - 0.13), 0.5)
        np.testing.assert_allclose(mesh.vertices[:, axis], 0.13, atol=1e-6)
        assert (face_normals(mesh)[0][:, axis] > 0.99).all()


def test_unknown_voxels_have_no_surface_and_the_border_stays_open():
    mesh = extract(grid_of(ball, lambda points: 1.0 * (points[..., 0] > 0)), 0.5)
    assert not mesh.is_empty and mesh.vertices[:, 0].min() >= VOXEL - 1e-6
    assert extract(grid_of(ball), 1.5).is_empty


def test_an_empty_grid_has_the_empty_mesh():
    assert extract(new_grid(VOXEL), 0.5).is_empty
    none = fill_grid(VOXEL, np.zeros((0, 3), np.int32), *[np.zeros((0, SIDE, SIDE, SIDE), np.float32)] * 2)
    assert extract(none, 0.5).is_empty


def test_the_same_distances_give_the_same_mesh_whatever_the_order_of_blocks():
    one, other = extract(grid_of(ball), 0.5), extract(grid_of(ball, blocks=range(1, -3, -1)), 0.5)
    assert np.array_equal(one.vertices, other.vertices) and np.array_equal(one.faces, other.faces)
