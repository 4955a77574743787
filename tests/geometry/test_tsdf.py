"""Grids of signed distances and the surface in them."""

from __future__ import annotations

import numpy as np
import pytest

from meshreel.errors import InputError
from meshreel.geometry.cameras import Camera
from meshreel.geometry.depth import DepthPicture
from meshreel.geometry.topology import border_edges, face_normals
from meshreel.geometry.tsdf import SIDE, Grid, extract, integrate

VOXEL = 0.05


def grid_of(field, weight=lambda points: np.ones(points.shape[:-1]), blocks=range(-2, 2)):
    """The grid of a function of places, block by block."""
    numbers = np.array([[i, j, k] for i in blocks for j in blocks for k in blocks], np.int32)
    inside = np.stack(np.meshgrid(*[np.arange(SIDE)] * 3, indexing="ij"), axis=-1)[..., ::-1]  # [k, j, i] is i, j, k
    points = VOXEL * (SIDE * numbers[:, None, None, None] + inside)
    return Grid.of(VOXEL, numbers, field(points).astype(np.float32), weight(points).astype(np.float32))


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
    none = Grid.of(VOXEL, np.zeros((0, 3), np.int32), *[np.zeros((0, SIDE, SIDE, SIDE), np.float32)] * 2)
    assert extract(none, 0.5).is_empty


def test_the_same_distances_give_the_same_mesh_whatever_the_order_of_blocks():
    one, other = extract(grid_of(ball), 0.5), extract(grid_of(ball, blocks=range(1, -3, -1)), 0.5)
    assert np.array_equal(one.vertices, other.vertices) and np.array_equal(one.faces, other.faces)


def test_surface_of_any_signs_is_closed():
    random = np.random.default_rng(0)
    numbers = np.array([[i, j, k] for i in (0, 1) for j in (0, 1) for k in (0, 1)], np.int32)
    inside = np.ones((16, 16, 16))
    inside[1:-1, 1:-1, 1:-1] = random.choice([-1.0, 1.0], (14, 14, 14)) * random.uniform(0.2, 1, (14, 14, 14))
    values = inside.reshape(2, SIDE, 2, SIDE, 2, SIDE).transpose(4, 2, 0, 1, 3, 5).reshape(8, SIDE, SIDE, SIDE)
    mesh = extract(Grid.of(1.0, numbers, values.astype(np.float32), np.ones_like(values, np.float32)), 0.5)
    assert len(mesh.faces) > 5000 and not len(border_edges(mesh))


def wall(depth=1.0, eye=(0.0, 0.0, 0.0), size=(40, 30)) -> DepthPicture:
    """The picture of a wall across the view of a camera that looks along +z, with a hole of 4 x 4 pixels."""
    depths = np.full(size[::-1], 1000 * depth, np.uint16)
    depths[10:14, 10:14] = 0
    extrinsic = np.eye(4)
    extrinsic[:3, 3] = -np.asarray(eye)
    camera = Camera.of(*size, np.array([[40.0, 0, 20], [0, 40, 15], [0, 0, 1]]), extrinsic)
    return DepthPicture(camera, depths, 0.001, 3.0)


@pytest.mark.parametrize("eye", [(0, 0, 0), (-300.0, 200.0, 1000.0)])
def test_a_wall_becomes_a_wall_that_faces_the_camera(eye):
    mesh = extract(integrate([wall(eye=eye)], 0.02, 3.0), 0.5)
    np.testing.assert_allclose(mesh.vertices[:, 2], eye[2] + 1, atol=1e-4)
    assert (face_normals(mesh)[0][:, 2] < -0.999).all()
    low, high = mesh.vertices.min(axis=0) - eye, mesh.vertices.max(axis=0) - eye
    np.testing.assert_allclose((low[:2], high[:2]), ((-0.5, -0.375), (0.5, 0.375)), atol=0.05)
    hole = np.abs(mesh.vertices[:, :2] - np.asarray(eye)[:2] - (-0.2, -0.075)).max(axis=1)
    assert 0.04 < hole.min() < 0.07


def test_a_pixel_that_flies_alone_has_no_surface():
    picture = wall()
    picture.depth[21, 21] = 500
    assert extract(integrate([picture], 0.02, 3.0), 0.5).vertices[:, 2].min() > 0.9


def test_what_one_camera_sees_through_is_carved_away():
    flying, true = wall(0.9), wall(1.0)
    flying.depth[:] = np.where(np.arange(40) < 20, flying.depth, 0)
    mesh = extract(integrate([flying, true, true], 0.02, 3.0), 0.5)
    assert mesh.vertices[:, 2].min() > 0.95


def test_depths_beyond_the_farthest_and_no_pictures_have_no_surface():
    assert extract(integrate([wall(3.5)], 0.02, 3.0), 0.5).is_empty
    assert extract(integrate([], 0.02, 3.0), 0.5).is_empty


def test_more_blocks_than_memory_should_hold_are_refused(monkeypatch):
    monkeypatch.setattr("meshreel.geometry.tsdf.MOST_BLOCKS", 10)
    with pytest.raises(InputError, match=r"blocks of 0\.16 m, over 10"):
        integrate([wall()], 0.02, 3.0)


def test_guessed_surface_counts_only_where_no_picture_tells_anything():
    near, far = np.zeros((40, 40), np.float32), np.zeros((40, 40), np.float32)
    near[:, :20], far[:] = 1.0, 2.0
    camera = Camera.of(40, 40, np.array([[40.0, 0, 20], [0, 40, 20], [0, 0, 1]]), np.eye(4))
    seen, guessed = (DepthPicture(camera, depth, 1.0, 5.0) for depth in (near, far))
    plain, more = integrate([seen], VOXEL, 3.0), integrate([seen], VOXEL, 3.0, [guessed])
    places = {tuple(block): number for number, block in enumerate(more.blocks)}
    of_plain = [places[tuple(block)] for block in plain.blocks]
    told = plain.weights > 0
    assert np.array_equal(more.distances[of_plain][told], plain.distances[told])
    assert not np.array_equal(more.weights > 0, integrate([guessed], VOXEL, 3.0).weights > 0)
    alone = extract(more, 0.5).vertices
    assert (np.abs(alone[:, 2] - 2) < VOXEL).any() and (np.abs(alone[:, 2] - 1) < VOXEL).any()
    assert ((np.abs(alone[:, 2] - 2) < VOXEL) | (alone[:, 2] < 1 + 3 * VOXEL)).all()  # no surface between them
