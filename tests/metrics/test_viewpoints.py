from pathlib import Path

import numpy as np
import pytest

from meshreel.errors import InputError
from meshreel.geometry.cameras import pack_cameras
from meshreel.metrics.viewpoints import Box, ViewOptions, read_cameras, views_around
from meshreel.types import UP_AXES, Mesh, MeshList

from .shapes import moved, sphere

CORNERS = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=float)


def _in_camera(points: np.ndarray, camera) -> np.ndarray:
    return points @ camera.extrinsic[:3, :3].T + camera.extrinsic[:3, 3]


@pytest.mark.parametrize("up", ["y", "z", "-y", "-z"])
@pytest.mark.parametrize("size", [(1, 2, 1), (5, 1, 0.2), (0, 3, 0), (2, 2, 0)])
def test_the_whole_box_is_in_every_view(up: str, size: tuple[float, ...]):
    box = Box(np.array([10.0, 20, 30]), np.array([10.0, 20, 30]) + size)
    corners = box.low + CORNERS * box.size
    for camera in views_around(box, ViewOptions(up=up)):
        local = _in_camera(corners, camera)
        pixels = camera.project(local)
        assert np.isfinite(pixels).all()
        assert (pixels >= 0).all() and (pixels <= [camera.width, camera.height]).all()
        rotation = camera.extrinsic[:3, :3]
        assert np.allclose(rotation @ rotation.T, np.eye(3)) and np.linalg.det(rotation) == pytest.approx(1)


def test_the_views_are_front_right_back_left_and_upright():
    box = Box(np.full(3, -1.0), np.full(3, 1.0))
    front, right, back, left = views_around(box)
    for camera, side in ((front, [0, 0, 1]), (right, [1, 0, 0]), (back, [0, 0, -1]), (left, [-1, 0, 0])):
        eye = -camera.extrinsic[:3, :3].T @ camera.extrinsic[:3, 3]
        assert np.allclose(eye / np.linalg.norm(eye), side)
        above = camera.project(_in_camera(np.array([[0, 0.5, 0.0]]), camera))
        assert above[0] == pytest.approx([960, above[0, 1]]) and above[0, 1] < 540


@pytest.mark.parametrize(("up", "side"), [("z", (0, -1, 0)), ("-y", (0, 0, -1)), ("-z", (0, 1, 0))])
def test_the_up_axis_is_up_in_the_pictures_and_decides_the_front(up: str, side: tuple[int, ...]):
    front = views_around(Box(np.full(3, -1.0), np.full(3, 1.0)), ViewOptions(up=up))[0]
    eye = -front.extrinsic[:3, :3].T @ front.extrinsic[:3, 3]
    assert np.allclose(eye / np.linalg.norm(eye), side)
    above = front.project(_in_camera(0.5 * np.array([UP_AXES[up]]), front))
    assert above[0, 0] == pytest.approx(960) and above[0, 1] < 540


def test_the_box_is_around_all_frames_and_ignores_empty_ones():
    frames = MeshList((sphere(), Mesh.empty(), moved(sphere(), (4, 0, 0))))
    box = Box.of(frames)
    assert np.allclose(box.low, [-1, -1, -1]) and np.allclose(box.high, [5, 1, 1])
    assert np.allclose(Box.of(MeshList((Mesh.empty(),))).size, 1)


def test_a_camera_file_is_read_back_by_us_and_by_open3d(tmp_path: Path):
    o3d = pytest.importorskip("open3d")
    cameras = views_around(Box(np.array([1.0, 2, 3]), np.array([2.0, 4, 4])), ViewOptions(640, 480))
    path = tmp_path / "views.json"
    path.write_bytes(pack_cameras(cameras))
    theirs = o3d.io.read_pinhole_camera_trajectory(str(path)).parameters
    for ours, again, other in zip(cameras, read_cameras(path), theirs, strict=True):
        assert np.array_equal(ours.intrinsic, again.intrinsic) and np.array_equal(ours.extrinsic, again.extrinsic)
        assert (again.width, again.height) == (640, 480) == (other.intrinsic.width, other.intrinsic.height)
        assert np.allclose(other.extrinsic, ours.extrinsic)
        assert np.allclose(other.intrinsic.intrinsic_matrix, ours.intrinsic)


def test_a_single_camera_that_open3d_wrote_is_read(tmp_path: Path):
    o3d = pytest.importorskip("open3d")
    camera = o3d.camera.PinholeCameraParameters()
    camera.intrinsic = o3d.camera.PinholeCameraIntrinsic(320, 240, 300, 310, 159.5, 119.5)
    camera.extrinsic = np.array([[1, 0, 0, 1], [0, 0, -1, 2], [0, 1, 0, 3], [0, 0, 0, 1.0]])
    path = tmp_path / "one.json"
    o3d.io.write_pinhole_camera_parameters(str(path), camera)
    (ours,) = read_cameras(path)
    assert np.allclose(ours.extrinsic, camera.extrinsic)
    assert np.allclose(ours.intrinsic, camera.intrinsic.intrinsic_matrix)


@pytest.mark.parametrize("options", [{"width": 3}, {"up": "x"}])
def test_bad_view_options_are_refused(options: dict):
    with pytest.raises(InputError):
        ViewOptions(**options)
