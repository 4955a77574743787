"""Grids of signed distances and the surface in them."""

import sys

import numpy as np
import pytest

from meshreel.errors import InputError
from meshreel.geometry.cameras import Camera
from meshreel.geometry.depth import DepthPicture
from meshreel.geometry.reconstruct import SIDE, Grid, close_holes, extract, integrate, poisson_surface
from meshreel.geometry.topology import border_edges, face_normals, unique_edges
from meshreel.types import Mesh
from tests.spheres import deforming_sphere

VOXEL = 0.05


def grid_of(field, weight=lambda points: np.ones(points.shape[:-1])):
    """The grid of a function of places, block by block."""
    numbers = np.array([[i, j, k] for i in range(-2, 2) for j in range(-2, 2) for k in range(-2, 2)], np.int32)
    inside = np.stack(np.meshgrid(*[np.arange(SIDE)] * 3, indexing="ij"), axis=-1)[..., ::-1]  # [k, j, i] is i, j, k
    points = VOXEL * (SIDE * numbers[:, None, None, None] + inside)
    return Grid(VOXEL, numbers, field(points).astype(np.float32), weight(points).astype(np.float32))


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
    none = Grid(VOXEL, np.zeros((0, 3), np.int32), *[np.zeros((0, SIDE, SIDE, SIDE), np.float32)] * 2)
    assert extract(none, 0.5).is_empty


def test_surface_of_any_signs_is_closed():
    random = np.random.default_rng(0)
    numbers = np.array([[i, j, k] for i in (0, 1) for j in (0, 1) for k in (0, 1)], np.int32)
    inside = np.ones((16, 16, 16))
    inside[1:-1, 1:-1, 1:-1] = random.choice([-1.0, 1.0], (14, 14, 14)) * random.uniform(0.2, 1, (14, 14, 14))
    values = inside.reshape(2, SIDE, 2, SIDE, 2, SIDE).transpose(4, 2, 0, 1, 3, 5).reshape(8, SIDE, SIDE, SIDE)
    mesh = extract(Grid(1.0, numbers, values.astype(np.float32), np.ones_like(values, np.float32)), 0.5)
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
    monkeypatch.setattr("meshreel.geometry.reconstruct.MOST_BLOCKS", 10)
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


BALL = deforming_sphere(1, levels=3)[0]


def open_edges(mesh):
    edges, of_faces = unique_edges(mesh.faces)
    return int((np.bincount(of_faces.reshape(-1), minlength=len(edges)) == 1).sum())


def without_ring(mesh, vertex):
    """The mesh without the faces at one vertex: a hole of one ring."""
    return Mesh.of(mesh.vertices, mesh.faces[(mesh.faces != vertex).all(axis=1)])


def test_a_closed_mesh_stays_as_it_is():
    assert np.array_equal(close_holes(BALL, 1e9).faces, BALL.faces)


def test_small_holes_are_closed_with_faces_that_look_outwards():
    holed = without_ring(without_ring(BALL, 5), 200)
    closed = close_holes(holed, 0.5 * np.pi)
    assert open_edges(holed) > 0 and open_edges(closed) == 0
    assert len(closed.vertices) == len(BALL.vertices)
    new = Mesh.of(closed.vertices, closed.faces[len(holed.faces) :])
    outwards = new.vertices[new.faces].mean(axis=1) - BALL.vertices.mean(axis=0)
    assert (np.einsum("fd,fd->f", face_normals(new)[0], outwards) > 0).all()


def test_large_holes_stay_open():
    above = BALL.vertices[:, 1] > BALL.vertices[:, 1].mean()
    half = Mesh.of(BALL.vertices, BALL.faces[above[BALL.faces].all(axis=1)])
    assert open_edges(close_holes(half, 0.1)) == open_edges(half) > 0


def test_an_empty_mesh_has_no_holes():
    assert close_holes(Mesh.empty(), 1.0).is_empty


def test_holes_that_meet_at_a_vertex_are_closed_each_for_itself():
    a, b = BALL.faces[0][0], BALL.faces[0][1]
    ring = set(BALL.faces[(BALL.faces == a).any(axis=1)].reshape(-1))
    beyond = next(v for v in BALL.faces[(BALL.faces == b).any(axis=1)].reshape(-1) if v not in ring)
    far = [v for v in BALL.faces[(BALL.faces == beyond).any(axis=1)].reshape(-1) if v not in ring]
    across = next(v for v in far if len(ring & set(BALL.faces[(BALL.faces == v).any(axis=1)].reshape(-1))) == 1)
    holed = without_ring(without_ring(BALL, a), across)
    closed = close_holes(holed, 0.5 * np.pi)
    assert open_edges(closed) == 0 and len(closed.vertices) == len(BALL.vertices)


def test_a_hole_that_a_camera_saw_through_stays_open():
    holed = without_ring(without_ring(BALL, 5), 200)
    near = BALL.vertices[5]
    closed = close_holes(holed, 0.5 * np.pi, lambda points: np.linalg.norm(points - near, axis=1) < 0.3)
    assert 0 < open_edges(closed) < open_edges(holed)
    assert len(closed.vertices) == len(BALL.vertices)


def test_the_faces_of_a_flat_hole_have_its_area_and_no_vertex_is_added():
    grid = np.stack(np.meshgrid(np.arange(9.0), np.arange(7.0), [0.0], indexing="ij"), axis=-1).reshape(-1, 3)
    corner = np.array([7 * i + j for i in range(8) for j in range(6)])[:, None]
    faces = np.concatenate([corner + [0, 7, 8], corner + [0, 8, 1]])
    middles = grid[faces].mean(axis=1)
    crack = (np.abs(middles[:, 1] - 3) < 1) & (middles[:, 0] > 2) & (middles[:, 0] < 6)
    bend = (np.abs(middles[:, 0] - 5) < 1) & (middles[:, 1] > 2) & (middles[:, 1] < 5)  # a concave loop
    closed = close_holes(Mesh.of(grid, faces[~(crack | bend)]), 20.0)
    normals, areas = face_normals(closed)
    assert open_edges(closed) == 2 * (8 + 6)  # its rim
    assert areas.sum() == pytest.approx(48) and (normals[areas > 0, 2] > 0).all() and len(closed.vertices) == len(grid)


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
