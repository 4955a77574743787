"""Rays hit the faces, at the depths, that analytic geometry predicts."""

from __future__ import annotations

import numpy as np
import pytest

from meshreel.geometry.cameras import Camera
from meshreel.geometry.raycast import Rays, pixels_near
from meshreel.types import Mesh
from tests.metrics.shapes import moved, plane, sphere

INTRINSIC = np.array([[60.0, 0, 40], [0, 60.0, 30], [0, 0, 1]])
BALL = moved(sphere(0.5, 3), (0, 0, 3))
WALL = moved(plane(8.0, 8), (-4, -4, 3))  # z = 3, faces the other way


def camera(eye=(0.0, 0.0, 0.0)) -> Camera:
    """Looks along +z."""
    extrinsic = np.eye(4)
    extrinsic[:3, 3] = -np.asarray(eye)
    return Camera.of(80, 60, INTRINSIC, extrinsic)


def test_a_wall_has_one_depth_and_every_pixel_sees_the_face_that_it_should():
    seen = Rays(WALL).look(camera())
    assert seen.depth.shape == seen.faces.shape == (60, 80) and np.allclose(seen.depth, 3)
    corners = WALL.vertices[WALL.faces]
    images = np.stack([camera().project(corners[:, k]) for k in range(3)], axis=1)
    rows, columns = np.mgrid[:60, :80]
    pixels = np.stack([columns + 0.5, rows + 0.5], axis=-1)
    low, high = images.min(axis=1)[seen.faces], images.max(axis=1)[seen.faces]
    assert (pixels >= low - 1e-3).all() and (pixels <= high + 1e-3).all()


@pytest.mark.parametrize("eye", [(0, 0, 0), (0.3, 0.2, 1.5), (0, 0, 2.8), (0, 0, 9)])
def test_faces_are_seen_in_no_pixels_but_those_near_them(eye):
    some = np.arange(len(BALL.faces)) % 7 == 0
    near, rays = pixels_near(camera(eye), Mesh(BALL.vertices, BALL.faces[some])), Rays(BALL)
    seen = rays.look(camera(eye)).faces
    assert np.array_equal(rays.faces_in(camera(eye), near), seen[near])
    assert not np.append(some, False)[seen[~near]].any()
    assert near.all() == (eye[2] == 2.8) and near.any() == (eye[2] != 9)  # inside the ball, and behind it


def test_a_ray_that_meets_no_face_is_a_miss():
    ball = moved(sphere(0.5), (0, 0, 3))
    seen = Rays(ball).look(camera())
    assert np.array_equal(seen.faces == -1, np.isinf(seen.depth))
    assert seen.faces[30, 40] >= 0 and seen.faces[0, 0] == -1
    assert seen.depth[30, 40] == pytest.approx(2.5, abs=0.01)


def test_the_nearest_surface_is_seen_from_either_side():
    both = Mesh.of(np.concatenate([WALL.vertices, WALL.vertices - [0, 0, 1]]), np.concatenate([WALL.faces] * 2))
    both.faces[len(WALL.faces) :] += len(WALL.vertices)
    flipped = Mesh.of(both.vertices, both.faces[:, ::-1])
    for mesh in (both, flipped):
        seen = Rays(mesh).look(camera())
        assert np.allclose(seen.depth, 2) and (seen.faces >= len(WALL.faces)).all()


def test_a_hit_is_the_point_of_its_face_at_its_distance():
    random = np.random.default_rng(0)
    origins = random.normal(0, 5, (500, 3))
    directions = random.normal(0, 1, (500, 3)) - origins
    body = sphere(levels=4)
    hit = Rays(body).cast(origins, directions)
    met = hit.faces >= 0
    assert 20 < met.sum() < 480 and np.isinf(hit.distances[~met]).all()
    along = origins[met] + hit.distances[met, None] * directions[met]
    corners = body.vertices[body.faces[hit.faces[met]]]
    assert np.allclose(np.einsum("nk,nkd->nd", hit.barycentric[met], corners), along, atol=1e-5)
    assert np.allclose(np.linalg.norm(along, axis=1), 1, atol=0.01)


def test_far_away_worlds_keep_their_millimetres():
    offset, eye = np.array([1e6, -2e6, 3e6]), np.array([0, 0, 0.1])
    near, far = Rays(WALL).look(camera(eye)), Rays(moved(WALL, offset)).look(camera(offset + eye))
    assert np.abs(far.depth - near.depth).max() < 1e-4 and (far.faces == near.faces).mean() > 0.99


def test_no_ray_slips_between_faces():
    random = np.random.default_rng(0)
    body = sphere(levels=4)
    edges = body.vertices[body.faces[:, [0, 1]]]
    share = random.random((len(edges), 1))
    targets = np.concatenate([body.vertices, share * edges[:, 0] + (1 - share) * edges[:, 1]])
    origins = random.normal(0, 0.2, targets.shape)
    assert (Rays(body).cast(origins, targets - origins).faces >= 0).all()


@pytest.mark.parametrize("mesh", [Mesh.empty(), Mesh.of([[0, 0, 0], [1, 1, 1]], [])])
def test_no_ray_meets_an_empty_mesh(mesh):
    seen, hit = Rays(mesh).look(camera()), Rays(mesh).cast(np.zeros((2, 3)), np.ones((2, 3)))
    assert (seen.faces == -1).all() and np.isinf(seen.depth).all()
    assert (hit.faces == -1).all() and np.isinf(hit.distances).all()


def test_a_view_sees_what_its_rays_meet():
    turned = np.eye(4)
    turned[:3, :3] = np.array([[0.0, 0, -1], [0, 1, 0], [1, 0, 0]])
    turned[:3, 3] = [0.3, -0.2, 4.0]
    view, rays = Camera.of(80, 60, INTRINSIC, turned), Rays(sphere(levels=3))
    rows, columns = np.mgrid[:60, :80]
    _, local = view.rays(np.stack([columns.ravel() + 0.5, rows.ravel() + 0.5], axis=1))
    hit = rays.cast(np.broadcast_to(view.eye, local.shape), local @ turned[:3, :3])
    seen = rays.look(view)
    same = hit.faces.reshape(60, 80) == seen.faces
    assert same.mean() > 0.99 and (seen.faces >= 0).mean() > 0.1
    depth = (hit.distances * local[:, 2]).reshape(60, 80)
    assert np.allclose(depth[same & (seen.faces >= 0)], seen.depth[same & (seen.faces >= 0)], atol=1e-5)
