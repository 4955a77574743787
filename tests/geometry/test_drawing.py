import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from meshreel.geometry.cameras import Camera, Rays, matrix_of
from meshreel.geometry.drawing import Crop, Parallel, backs, draw, draw_places
from meshreel.geometry.topology import concatenate, face_normals
from meshreel.types import Mesh

from ..metrics.shapes import moved, noisy, plane, sphere

INTRINSIC = np.array([[60.0, 0, 40], [0, 60.0, 30], [0, 0, 1]])
WALL = moved(plane(8.0, 8), (-4, -4, 3))  # z = 3, faces the other way


def camera(eye=(0.0, 0.0, 0.0)) -> Camera:
    """Looks along +z."""
    extrinsic = np.eye(4)
    extrinsic[:3, 3] = -np.asarray(eye)
    return Camera.of(80, 60, INTRINSIC, extrinsic)


def test_a_wall_has_one_depth_and_every_pixel_sees_the_face_that_it_should():
    seen = draw(WALL, camera())
    assert seen.depth.shape == seen.faces.shape == (60, 80) and np.allclose(seen.depth, 3)
    corners = WALL.vertices[WALL.faces]
    images = np.stack([camera().project(corners[:, k]) for k in range(3)], axis=1)
    rows, columns = np.mgrid[:60, :80]
    pixels = np.stack([columns + 0.5, rows + 0.5], axis=-1)
    low, high = images.min(axis=1)[seen.faces], images.max(axis=1)[seen.faces]
    assert (pixels >= low - 1e-3).all() and (pixels <= high + 1e-3).all()


def test_a_pixel_that_sees_no_face_is_a_miss():
    ball = moved(sphere(0.5), (0, 0, 3))
    seen = draw(ball, camera())
    assert np.array_equal(seen.faces == -1, np.isinf(seen.depth))
    assert seen.faces[30, 40] >= 0 and seen.faces[0, 0] == -1
    assert seen.depth[30, 40] == pytest.approx(2.5, abs=0.01)


def test_the_nearest_surface_is_seen_from_either_side():
    both = Mesh.of(np.concatenate([WALL.vertices, WALL.vertices - [0, 0, 1]]), np.concatenate([WALL.faces] * 2))
    both.faces[len(WALL.faces) :] += len(WALL.vertices)
    flipped = Mesh.of(both.vertices, both.faces[:, ::-1])
    for mesh in (both, flipped):
        seen = draw(mesh, camera())
        assert np.allclose(seen.depth, 2) and (seen.faces >= len(WALL.faces)).all()


def test_far_away_worlds_keep_their_millimetres():
    offset, eye = np.array([1e6, -2e6, 3e6]), np.array([0, 0, 0.1])
    near, far = draw(WALL, camera(eye)), draw(moved(WALL, offset), camera(offset + eye))
    assert np.abs(far.depth - near.depth).max() < 1e-4 and (far.faces == near.faces).mean() > 0.99


TURNED = matrix_of(np.array([[0.0, 0, -1], [0, 1, 0], [1, 0, 0]]), np.array([0.3, -0.2, 4.0]))
VIEW = Camera.of(160, 120, INTRINSIC * [[2], [2], [1]], TURNED)


def test_pixels_see_what_rays_through_their_middles_meet():
    body = noisy(sphere(levels=5), 0.03)
    hit = Rays(body).cast(VIEW.eye[None], VIEW.ahead.reshape(-1, 3) @ TURNED[:3, :3])
    seen = draw(body, VIEW)
    same = hit.faces.reshape(120, 160) == seen.faces
    assert same.mean() > 0.995 and (seen.faces >= 0).mean() > 0.1  # corners are rounded: edges differ
    both = same & (seen.faces >= 0)
    assert np.allclose(hit.distances.reshape(120, 160)[both], seen.depth[both], atol=1e-6)


def test_a_place_lies_on_its_face_at_its_depth_under_the_middle_of_its_pixel():
    body = sphere(levels=4)
    seen = draw_places(body, VIEW)
    local = VIEW.local(seen.points)
    assert np.allclose(local[:, 2], seen.depth, atol=1e-4) and (seen.barycentric >= 0).all()
    assert np.allclose(seen.barycentric.sum(axis=1), 1)
    rows, columns = np.nonzero(seen.covered)
    assert np.abs(VIEW.project(local) - np.stack([columns, rows], axis=1) - 0.5).max() < 1 / 128


@given(st.tuples(*[st.floats(-0.3, 0.3)] * 3), st.integers(0, 2**32 - 1))
def test_a_closed_surface_has_no_gap_from_within(eye, seed):
    room = noisy(sphere(levels=3), 0.1, seed)
    seen = draw(room, camera(eye))
    assert (seen.faces >= 0).all() and (seen.depth > 0).all()


def test_faces_that_reach_behind_the_eye_are_cut_where_it_sees_them():
    floor = Mesh.of([[-1e5, 1, -60], [1e5, 1, -60], [0, 1, 1e5]], [[0, 1, 2]])
    seen = draw(floor, camera())
    below = camera().ahead[..., 1] > 0
    assert np.array_equal(seen.faces >= 0, below)
    assert np.allclose(seen.depth[below], 1 / camera().ahead[..., 1][below], rtol=1e-5)
    assert (draw(Mesh.of(floor.vertices * [1, 1, -1], floor.faces), camera((0, 0, 70))).faces == -1).all()


def test_faces_that_share_an_edge_through_middles_of_pixels_cover_each_once():
    corners = np.array([[x, y, 3.0] for y in (-1.475, 0.025, 1.475) for x in (-1.975, 0.025, 1.975)])
    quads = np.array([[0, 1, 4, 3], [1, 2, 5, 4], [3, 4, 7, 6], [4, 5, 8, 7]])
    faces = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    together = draw(Mesh.of(corners, faces), camera()).faces
    alone = [draw(Mesh.of(corners, faces[k : k + 1]), camera()).faces == 0 for k in range(len(faces))]
    assert (np.sum(alone, axis=0) == (together >= 0)).all()


def test_a_crop_shows_the_same_pixels_as_the_whole_picture():
    body, crop = noisy(sphere(levels=4), 0.02), Crop(31, 84, 50, 121)
    whole, part = draw(body, VIEW), draw(body, VIEW, crop)
    assert np.array_equal(part.faces, whole.faces[31:84, 50:121]) and (part.faces >= 0).any()
    assert np.array_equal(part.depth, whole.depth[31:84, 50:121])
    assert draw(body, VIEW, Crop(0, 0, 0, 0)).faces.shape == (0, 0)


def test_parallel_rays_see_a_body_in_its_own_size_also_behind_the_plane_of_the_camera():
    body = moved(sphere(levels=5), (0, 0, -0.5))
    seen = draw_places(body, Parallel(100, 80, 0.025, np.eye(4)))
    assert seen.covered.sum() == pytest.approx(np.pi / 0.025**2, rel=0.01)
    assert np.allclose(seen.points[:, 2], seen.depth, atol=1e-3) and seen.depth.min() == pytest.approx(-1.5, abs=1e-3)


def test_faces_that_show_their_backs_are_those_whose_normals_look_away():
    turned = Mesh.of(WALL.vertices + [4.0, 0, 0], WALL.faces[:, ::-1])
    both = concatenate([moved(WALL, (-4.0, 0, 0)), turned])
    seen = draw(both, camera())
    away = face_normals(both)[0][seen.faces][..., 2] > 0
    assert np.array_equal(backs(face_normals(both)[0], camera(), seen), away) and 0.1 < away.mean() < 0.9


@pytest.mark.parametrize("mesh", [Mesh.empty(), Mesh.of([[0, 0, 0], [1, 1, 1]], [])])
def test_no_pixel_sees_an_empty_mesh(mesh):
    seen, normals = draw(mesh, camera()), face_normals(mesh)[0]
    assert (seen.faces == -1).all() and np.isinf(seen.depth).all() and not backs(normals, camera(), seen).any()
    assert len(draw_places(mesh, camera()).points) == 0
