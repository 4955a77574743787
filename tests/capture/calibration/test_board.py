"""A board in rendered pictures tells how cameras stand to each other, also through other cameras."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from meshreel.capture.calibration.board import BoardOptions, poses_by_board
from meshreel.capture.rig.cameras import ColorCamera
from meshreel.errors import InputError
from meshreel.geometry.cameras import Camera, CameraPose, looking_at
from meshreel.io.write import write_picture
from tests.capture.wrong_poses import errors

cv2 = pytest.importorskip("cv2")
BOARDS = [
    BoardOptions("charuco"),
    BoardOptions("apriltag", 4, 3, 0.08, 0.06),
    BoardOptions("apriltag", 1, 1, 0.3, 0.25),
]
WIDTH, HEIGHT, FOCAL = 960, 720, 900.0
INTRINSIC = np.array([[FOCAL, 0, WIDTH / 2 - 0.5], [0, FOCAL, HEIGHT / 2 - 0.5], [0, 0, 1]])
PIXELS = 4000  # of the printed board, a metre


def printed(options):
    """The board as it is printed, with a margin, and the matrix from its metres to those pixels."""
    count = (options.columns, options.rows)
    gap = 0 if options.kind == "charuco" else options.square - options.marker
    size = [round((n * options.square - gap) * PIXELS) for n in count]
    margin = 80
    image = options.made().generateImage((size[0] + 2 * margin, size[1] + 2 * margin), marginSize=margin)
    return image, np.array([[PIXELS, 0, margin - 0.5], [0, PIXELS, margin - 0.5], [0, 0, 1]])


def picture(options, board_to_world, camera_to_world, random):
    """What a camera sees of the board in front of grey."""
    image, to_pixels = printed(options)
    pose = np.linalg.inv(camera_to_world) @ board_to_world
    sight = INTRINSIC @ pose[:3, [0, 1, 3]] @ np.linalg.inv(to_pixels)
    large = np.diag([3.0, 3.0, 1.0]) + [[0, 0, 1], [0, 0, 1], [0, 0, 0]]  # drawn larger, then averaged
    seen = cv2.warpPerspective(image, large @ sight, (3 * WIDTH, 3 * HEIGHT), borderValue=128)
    seen = seen.reshape(HEIGHT, 3, WIDTH, 3).mean(axis=(1, 3)) + 2 * random.normal(size=(HEIGHT, WIDTH))
    return np.repeat(np.clip(seen, 0, 255).astype(np.uint8)[..., None], 3, axis=2)


def cameras_around(count):
    """Poses of cameras in a row that look at a place in front of the middle."""
    return [looking_at(np.array([0.5 * (k - (count - 1) / 2), 0.1 * k, -1.2]), np.zeros(3)) for k in range(count)]


def boards(options, frames, random):
    """Poses of the board near the world's origin, towards the cameras."""
    middle = np.array([options.columns, options.rows, 0]) * options.square / 2
    for _ in range(frames):
        pose = np.eye(4)
        pose[:3, :3] = Rotation.from_rotvec(0.4 * random.normal(size=3)).as_matrix()
        pose[:3, 3] = 0.05 * random.normal(size=3) - pose[:3, :3] @ middle
        yield pose


def recorded(folder, options, sees):
    """Colour cameras with pictures; `sees` has for each camera the frames in which the board is in its view."""
    random, poses = np.random.default_rng(0), cameras_around(len(sees))
    files = [{} for _ in sees]
    for frame, board in enumerate(boards(options, 1 + max(max(each) for each in sees), random)):
        for number, pose in enumerate(poses):
            files[number][frame] = folder / f"camera{number}_{frame}.png"
            seen = picture(options, board, pose, random)
            write_picture(seen if frame in sees[number] else np.full_like(seen, 128), files[number][frame])
    (fx, _, cx), (_, fy, cy), _ = INTRINSIC  # OpenCV's: the middles of pixels are whole numbers
    view = Camera(WIDTH, HEIGHT, (fx, fy), (cx + 0.5, cy + 0.5), CameraPose.of_camera(poses[0]), (0.0,) * 5)
    return poses, [ColorCamera(f"camera{k}", view, files[k]) for k in range(len(sees))]


@pytest.mark.parametrize("options", BOARDS, ids=["charuco", "tags", "tag"])
def test_cameras_that_see_the_board_are_placed_in_the_world_of_the_first(tmp_path, options):
    truth, cameras = recorded(tmp_path, options, [range(4)] * 2)
    found, warnings = poses_by_board(cameras, options)
    assert warnings == [] and np.array_equal(found["camera0"], truth[0])
    degrees, metres = errors([found["camera0"], found["camera1"]], truth)
    assert degrees.max() < 0.2 and metres.max() < 0.005


def test_cameras_are_chained_and_those_that_cannot_be_are_named(tmp_path):
    truth, cameras = recorded(tmp_path, BOARDS[0], [[0, 1], [0, 1, 2, 3], [2, 3], [4]])
    found, [warning] = poses_by_board(cameras, BOARDS[0])
    assert set(found) == {"camera0", "camera1", "camera2"}
    degrees, metres = errors([found[f"camera{k}"] for k in range(3)], truth[:3])
    assert degrees.max() < 0.3 and metres.max() < 0.008
    assert warning.startswith("camera3 did not see the board together with camera0")


def test_a_board_that_no_two_cameras_see_is_an_error_with_counts(tmp_path):
    _, cameras = recorded(tmp_path, BOARDS[0], [[0], [1]])
    with pytest.raises(InputError, match=r"camera0 in 1 frames, camera1 in 1 frames.*check its numbers"):
        poses_by_board(cameras, BOARDS[0])
    with pytest.raises(InputError, match="there are no colour cameras"):
        poses_by_board([], BOARDS[0])


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"marker": 0.05}, "smaller than squares"),
        ({"columns": 0}, "counts from 1"),
        ({"columns": 1, "rows": 1}, "a board of 1 x 1 with 5X5_100 is none to OpenCV"),
        ({"columns": 60, "rows": 60, "dictionary": "4X4_50"}, "and a dictionary with enough markers"),
        ({"dictionary": "9X9"}, "not known to OpenCV; give one of 4X4_50|not known"),
    ],
)
def test_an_impossible_board_is_refused(change, told):
    with pytest.raises(InputError, match=told):
        BoardOptions(**change).made()
