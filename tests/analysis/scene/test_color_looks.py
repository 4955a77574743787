"""Views from colour cameras: of one size, straight, and looking where the cameras look."""

from dataclasses import replace

import numpy as np

from meshreel.analysis.scene.color_looks import ColorLooks
from meshreel.geometry.cameras import Camera
from meshreel.geometry.color_views import ColorPicture

POSE = np.eye(4)
CAMERA = Camera.of(100, 60, np.array([[80.0, 0, 49], [0, 80, 31], [0, 0, 1]]), POSE)


def ramp(camera: Camera) -> np.ndarray:
    """A picture whose red is the column and whose green is the row."""
    rows, columns = np.mgrid[: camera.height, : camera.width]
    return np.stack([columns, rows, 0 * rows], axis=2).astype(np.uint8)


def test_a_straight_camera_s_picture_is_kept_and_a_missing_one_is_none():
    looks = ColorLooks([[None, ColorPicture(CAMERA, ramp(CAMERA))], [None, None]], 0)
    assert looks.views == (CAMERA,) and np.array_equal(looks.at(0, 0), ramp(CAMERA)) and looks.at(1, 0) is None
    assert ColorLooks([[None]], 0).views == ()


def test_views_have_one_size_and_show_a_point_where_the_camera_saw_it():
    other = Camera.of(200, 200, np.array([[150.0, 0, 100], [0, 150, 100], [0, 0, 1]]), POSE)
    pictures = [ColorPicture(CAMERA, ramp(CAMERA)), ColorPicture(replace(other, distortion=(0.1,)), ramp(other))]
    looks = ColorLooks([pictures], 0)
    assert {(view.width, view.height) for view in looks.views} == {(100, 60)}
    row, column = 20, 70
    point = 2 * looks.views[1].ahead[row, column][None]
    at = pictures[1].project(point)[0][0] - 0.5  # the ramp's values are those of the middles of pixels
    assert np.allclose(looks.at(0, 1)[row, column, :2], at, atol=0.51)


def test_large_pictures_become_smaller():
    large = replace(CAMERA, width=1280, height=720)
    (view,) = ColorLooks([[ColorPicture(large, np.zeros((720, 1280, 3), np.uint8))]], 0).views
    assert (view.width, view.height) == (640, 360) and np.allclose(view.intrinsic[:2], CAMERA.intrinsic[:2] / 2)
