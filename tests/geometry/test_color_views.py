"""Colours that cameras saw: where places are in pictures, what hides them, and which picture counts more."""

from dataclasses import replace

import numpy as np
import pytest

from meshreel.geometry.cameras import Camera, CameraPose
from meshreel.geometry.color_views import ColorPicture, ColorViews, sampled, spread_colors
from meshreel.geometry.depth import DepthPicture
from meshreel.geometry.drawing import draw
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


def test_clear_views_leave_out_what_is_beside_a_step_and_not_beside_a_small_hole() -> None:
    screen, wall = Mesh(WALL.vertices * [0.1, 0.1, 0.5], WALL.faces), subdivide_midpoint(WALL, 2)
    hole = np.linalg.norm(wall.vertices[wall.faces].mean(axis=1) - [0.58, 0.58, 2], axis=1) < 0.05
    room = concatenate([wall.with_faces(~hole), screen])
    points = np.array([[0.225, 0, 2], [0.32, 0, 2], [0.58, 0.66, 2]])  # 1 and 6 pixels from the step, beside the hole
    assert hole.any()
    for clear, wanted in ((True, [False, True, True]), (False, [True, True, True])):
        views = ColorViews([ColorPicture(AHEAD, PIXELS)], room)
        assert (views.clear if clear else views).at(points, NORMALS[:3])[1].tolist() == wanted


def depths_of(mesh: Mesh, camera: Camera = AHEAD) -> np.ndarray:
    """What a depth camera without errors measures of a mesh, mm."""
    depth = draw(mesh, camera).depth
    return np.where(np.isfinite(depth), np.rint(1000 * np.where(np.isfinite(depth), depth, 0)), 0).astype(np.uint16)


def test_no_color_crosses_a_step() -> None:
    screen = Mesh(WALL.vertices * [0.3, 0.3, 0.75], WALL.faces)  # .3 m to all sides, before a wall at 2 m
    room, aside = concatenate([WALL, screen]), np.eye(4)
    aside[:3, 3] = [-0.25, 0, 0]  # to the right
    cameras = [AHEAD, replace(AHEAD, pose=CameraPose.of_world(aside))]
    pictures = []
    for camera in cameras:
        seen = draw(room, camera)
        pixels = np.where(seen.faces < 0, 0, np.where(seen.faces < len(WALL.faces), 200, 90)).astype(np.uint8)
        pictures.append(ColorPicture(camera, pixels[..., None].repeat(3, axis=2)))
    views = ColorViews(pictures, room)
    for mesh, color in ((subdivide_midpoint(WALL, 3), 200), (subdivide_midpoint(screen, 3), 90)):
        colors, known = views.at(mesh.vertices, np.tile([0.0, 0, -1], (len(mesh.vertices), 1)))
        assert known.mean() > 0.5 and (colors[known].round() == color).all()


def test_a_place_before_the_surface_has_not_the_color_behind_it() -> None:
    views = ColorViews([ColorPicture(AHEAD, PIXELS)], WALL)
    assert views.at(np.array([[0.0, 0, 1.97], [0, 0, 1.99], [0, 0, 2.01], [0, 0, 2.03]]), NORMALS[:4])[1].tolist() == [
        False, True, True, False
    ]  # fmt: skip


@pytest.mark.parametrize("scale", [1.0, 0.2])
def test_guessed_surface_beyond_what_was_measured_has_no_color(scale: float) -> None:
    small = Mesh(WALL.vertices * [0.5, 0.5, 1], WALL.faces)  # what is there; the wall was guessed beyond it
    place, points = Placement(scale, (0.0, 0.0, 0.0)), np.array([[0.3, 0, 2], [0.47, 0, 2], [0.56, 0, 2], [0.7, 0, 2]])
    measured = depths_of(small)
    measured[40, 52] = 0  # a hole of one pixel changes nothing, of 9 pixels it is one
    measured[20:29, 20:29] = 0
    points = np.concatenate([points, [[0.25, 0.01, 2], [-0.31, -0.31, 2]]])
    depth, picture = DepthPicture(AHEAD, measured, 0.001, 8.0).placed(place), ColorPicture(AHEAD, PIXELS).placed(place)
    hides, normals = Mesh(WALL.vertices / scale, WALL.faces), np.tile([0.0, 0, -1], (6, 1))
    for depths, wanted in (([depth], [True, True, False, False, True, False]), ([], [True] * 6)):
        views = ColorViews([picture], hides, 0.01 / scale, depths)
        assert views.at(points / scale, normals)[1].tolist() == wanted
        assert views.clear.at(points / scale, normals)[1].tolist() == wanted


def test_noisy_measurements_confirm_a_surface_and_those_of_a_camera_elsewhere_say_nothing() -> None:
    noisy = depths_of(WALL) + np.random.default_rng(0).normal(0, 15, (SIDE, SIDE))  # mm
    points = np.stack([*np.meshgrid(np.linspace(-0.7, 0.7, 20), np.linspace(-0.7, 0.7, 20))], 2).reshape(-1, 2)
    points, away = np.column_stack([points, np.full(400, 2.0)]), np.eye(4)
    away[:3, 3] = [-1.5, 0, 0]
    cameras = AHEAD, replace(AHEAD, pose=CameraPose.of_world(away))
    for camera, measured in zip(cameras, (np.rint(noisy), np.zeros((SIDE, SIDE))), strict=True):
        depth = DepthPicture(camera, measured.astype(np.uint16), 0.001, 8.0)
        views = ColorViews([ColorPicture(AHEAD, PIXELS)], WALL, depths=[depth])
        assert views.at(points, np.tile([0.0, 0, -1], (400, 1)))[1].mean() > 0.99


def test_a_bent_lens_shows_what_is_hidden_where_it_is() -> None:
    screen = Mesh(WALL.vertices * [0.05, 0.05, 0.5] + [0.14, 0, 0], WALL.faces)  # hides .18 to .38 of the wall
    bent = ColorPicture(replace(AHEAD, distortion=(1.0,)), PIXELS)
    views = ColorViews([bent], concatenate([WALL, screen]))
    points = np.array([[0.1, 0, 2], [0.28, 0, 2], [0.45, 0, 2]])
    assert views.at(points, NORMALS[:3])[1].tolist() == [True, False, True]
