"""Colours that cameras saw: where places are in pictures, what hides them, and which picture counts more."""

from dataclasses import replace

import numpy as np
import pytest

from meshreel.geometry.cameras import Camera, CameraPose
from meshreel.geometry.color_views import ColorPicture, ColorViews, sampled, spread_colors
from meshreel.geometry.topology import concatenate, subdivide_midpoint
from meshreel.types import GREY, Mesh, Placement

SIDE = 80
INTRINSIC = np.array([[100.0, 0, 40], [0, 100, 40], [0, 0, 1]])
AHEAD = Camera.of(SIDE, SIDE, INTRINSIC, np.eye(4))  # looks along +z
PIXELS = np.stack([*np.meshgrid(np.arange(SIDE), np.arange(SIDE)), np.zeros((SIDE, SIDE))], axis=2).astype(np.uint8)
WALL = subdivide_midpoint(
    Mesh.of([[-1, -1, 2], [1, -1, 2], [1, 1, 2], [-1, 1, 2]], [[0, 2, 1], [0, 3, 2]]), 3
)  # faces the camera
NORMALS = np.tile([0.0, 0, -1], (len(WALL.vertices), 1))


def test_places_have_the_colors_of_their_pixels() -> None:
    points = np.array([[0.0, 0, 2], [0.4, -0.2, 2], [0.9, 0, 2]])
    colors, seen = ColorViews([ColorPicture(AHEAD, PIXELS)], WALL).at(points, NORMALS[:3])
    assert seen.tolist() == [True, True, False]  # the last is beside the picture
    np.testing.assert_allclose(colors[:2, :2], [[39.5, 39.5], [59.5, 29.5]])


def test_what_is_hidden_or_turned_away_is_not_seen() -> None:
    screen = Mesh(WALL.vertices * [0.1, 0.1, 0.5], WALL.faces)
    views = ColorViews([ColorPicture(AHEAD, PIXELS)], concatenate([WALL, screen]))
    points = np.array([[0.0, 0, 2], [0.6, 0, 2], [0.05, 0, 1]])
    assert views.at(points, NORMALS[:3])[1].tolist() == [False, True, True]
    assert not views.at(points, -NORMALS[:3])[1].any()


def test_the_camera_that_looks_squarely_counts_most() -> None:
    aside = np.eye(4)
    aside[:3, :3] = [[0.8, 0, -0.6], [0, 1, 0], [0.6, 0, 0.8]]
    aside[:3, 3] = [1.2, 0, 0.4]  # looks at the wall's middle from its side
    other = ColorPicture(replace(AHEAD, pose=CameraPose.of_world(aside)), np.full_like(PIXELS, 200))
    dark = ColorPicture(AHEAD, np.full_like(PIXELS, 100))
    colors, seen = ColorViews([dark, other], WALL).at(np.array([[0.0, 0, 2]]), NORMALS[:1])
    eye = other.camera.eye - [0, 0, 2]
    cosine = -eye[2] / np.linalg.norm(eye)
    assert seen.all()
    np.testing.assert_allclose(colors, (100 + 200 * cosine**3) / (1 + cosine**3), rtol=1e-6)


def test_a_lens_bends_as_opencv_says() -> None:
    k1, k2, p1, p2, k3 = distortion = (0.1, -0.05, 0.01, 0.02, 0.03)
    x, y = 0.2, -0.3
    r = x * x + y * y
    bend = 1 + k1 * r + k2 * r**2 + k3 * r**3
    bent = [x * bend + 2 * p1 * x * y + p2 * (r + 2 * x * x), y * bend + p1 * (r + 2 * y * y) + 2 * p2 * x * y]
    picture = ColorPicture(replace(AHEAD, distortion=distortion), PIXELS)
    found, depth = picture.project(np.array([[2 * x, 2 * y, 2.0], [0, 0, -1]]))
    np.testing.assert_allclose(found[0], 100 * np.array(bent) + 40)
    assert np.isnan(found[1]).all() and depth.tolist() == [2.0, -1.0]


def test_normalised_coordinates_have_the_same_pixels() -> None:
    place = Placement(2.5, (0.3, -0.2, 0.7))
    points = np.array([[0.1, 0.2, 2.0], [-0.4, 0.3, 3.0]])
    picture = ColorPicture(replace(AHEAD, distortion=(0.1,)), PIXELS)
    found, depth = picture.placed(place).project((points - place.origin) / place.scale)
    np.testing.assert_allclose(found, picture.project(points)[0])
    np.testing.assert_allclose(depth * place.scale, points[:, 2])


def test_unseen_vertices_have_the_means_of_their_neighbours() -> None:
    colors, seen = np.zeros((len(WALL.vertices), 3)), WALL.vertices[:, 0] < -0.5
    colors[seen] = 90
    assert (spread_colors(WALL, colors, seen) == 90).all()
    assert (spread_colors(WALL, colors, ~seen & seen) == GREY).all()


@pytest.mark.parametrize("at, wanted", [((0.5, 0.5), (0, 0)), ((2.0, 1.5), (1.5, 1)), ((79.9, 0), (79, 0))])
def test_pixels_are_blended_between_their_middles(at: tuple[float, float], wanted: tuple[float, float]) -> None:
    np.testing.assert_allclose(sampled(PIXELS, np.array([at]))[0, :2], wanted, atol=0.01)


def test_a_picture_that_is_too_bright_is_divided_by_its_gains() -> None:
    bright = ColorPicture(AHEAD, PIXELS, gains=(2.0, 0.5, 1.0))
    colors, seen = ColorViews([bright], WALL).at(np.array([[0.0, 0, 2]]), NORMALS[:1])
    assert seen.all()
    np.testing.assert_allclose(colors, [[39.5 / 2, 39.5 * 2, 0]])


def test_clear_views_leave_out_what_is_beside_a_step_and_not_beside_a_hole() -> None:
    screen = Mesh(WALL.vertices * [0.1, 0.1, 0.5], WALL.faces)
    hole = np.linalg.norm(WALL.vertices[WALL.faces].mean(axis=1) - [0.58, 0.58, 2], axis=1) < 0.15
    room = concatenate([WALL.with_faces(~hole), screen])
    points = np.array([[0.225, 0, 2], [0.32, 0, 2], [0.58, 0.77, 2]])  # 1 and 6 pixels from the step, beside the hole
    assert hole.any()
    for clear, wanted in ((True, [False, True, True]), (False, [True, True, True])):
        views = ColorViews([ColorPicture(AHEAD, PIXELS)], room)
        assert (views.clear if clear else views).at(points, NORMALS[:3])[1].tolist() == wanted
