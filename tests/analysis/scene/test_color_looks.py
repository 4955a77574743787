"""Views from colour cameras are straight and of one size; surface of another hue is found in them, shadows are not."""

from dataclasses import replace

import numpy as np
import pytest

from meshreel.analysis.scene.color_looks import ColorChange, ColorLooks
from meshreel.analysis.scene.labelling import ByPlace, Rest
from meshreel.geometry.cameras import Camera, looking_at
from meshreel.geometry.color_views import ColorPicture
from meshreel.geometry.drawing import draw
from meshreel.geometry.topology import concatenate
from meshreel.geometry.voxels import Lattice, spread
from meshreel.types import Mesh
from tests.analysis.scene.test_views import box

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


FLOOR, SKIN, SHADE = (180, 160, 150), (190, 130, 110), 0.6
ABOVE = np.linalg.inv(looking_at(np.array([0.3, 2.0, 1.2]), np.array([0.0, 0, 0])))
EYE = Camera.of(160, 120, np.array([[140.0, 0, 80], [0, 140, 60], [0, 0, 1]]), ABOVE)
ROOM = box((-1, -0.1, -1), (1, 0, 1))
FOOT = box((-0.1, 0.0, -0.1), (0.15, 0.05, 0.1))
COME = concatenate([ROOM, FOOT])


def picture(mesh: Mesh, shaded: bool = False, skin: tuple[int, int, int] = SKIN) -> ColorPicture:
    faces = draw(mesh, EYE).faces
    colors = np.where((faces >= len(ROOM.faces))[..., None], skin, FLOOR) * (SHADE if shaded else 1.0)
    noisy = colors + np.random.default_rng(int(shaded)).normal(0, 2, colors.shape)
    return ColorPicture(EYE, np.clip(np.rint(noisy), 0, 255).astype(np.uint8))


FRAMES = [ROOM] * 6 + [ROOM, COME, COME]
COLORS = [[picture(ROOM)]] * 6 + [[picture(ROOM, shaded=True)], [picture(COME)], [picture(COME, skin=FLOOR)]]


@pytest.fixture(scope="module")
def change() -> ColorChange:
    return ColorChange.of(FRAMES, ColorLooks(COLORS, 0), range(6), 0.02)


def test_a_foot_of_another_colour_is_found_and_neither_a_shadow_nor_one_of_the_floor_s(change: ColorChange):
    found, seen = change.faces(7, COME), np.unique(draw(COME, EYE).faces)
    own = seen[seen >= len(ROOM.faces)]
    assert found[own].mean() > 0.8 and found[: len(ROOM.faces)].mean() < 0.01
    assert not change.faces(6, ROOM).any() and not change.faces(8, COME).any()


def test_what_is_found_moves_where_it_is_connected_with_what_moves(change: ColorChange):
    lattice = Lattice(np.array([-2.0, -2.0, -2.0]), 0.05)
    keys = np.unique(lattice.keys(spread(COME, 0.05)[0]))
    heel = np.isin(keys, lattice.keys(spread(FOOT, 0.05)[0])) & (lattice.centers(keys)[:, 0] < 0)
    counts = []
    for chosen, colors in ((heel, None), (heel, change), (np.zeros(len(keys), bool), change)):
        by = ByPlace(0.02, lattice, keys, chosen, Rest.none(len(keys)), 0.0, colors)
        moving = by.moving(7, COME)
        counts.append(int(moving[len(ROOM.faces) :].sum()))
        assert not (moving & by.still_at_first(7, COME)).any()
    assert 0 < counts[0] < counts[1] - 10 and counts[2] == 0
