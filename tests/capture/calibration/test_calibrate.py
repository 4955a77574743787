"""Poses are refined on depth alone: in a room they end right, and what surfaces leave open is told and stays."""

from dataclasses import replace

import numpy as np
import pytest

from meshreel.capture.calibration.calibrate import refine, refine_views, write_calibration_sheet
from meshreel.capture.calibration.still_view import still_view
from meshreel.capture.rig.cameras import posed
from meshreel.capture.rig.rig import read_rig
from meshreel.capture.simulated.demo_room import RoomOptions, furnished_room, room_cameras
from meshreel.capture.simulated.sensors import SensorOptions
from meshreel.capture.simulated.simulated_rig import simulate_rig
from meshreel.errors import InputError
from meshreel.io.pictures import read_picture
from tests.capture.depth_scenes import WALL, camera, measured
from tests.capture.wrong_poses import errors, wrong


@pytest.fixture(scope="module")
def room(tmp_path_factory):
    """What four noisy cameras see of the demo's room, while two people move in it for six seconds."""
    folder, cameras = tmp_path_factory.mktemp("room"), room_cameras()
    frames = furnished_room(RoomOptions(frames=12, frame_rate=2.0, spacing=0.06))
    simulate_rig(folder, frames, cameras, 2.0, SensorOptions(noise=0.5))
    rig = read_rig(folder)
    return tuple(still_view(one, rig.looked_at(number)) for number, one in enumerate(rig.cameras))


def mistaken(views, random, **amounts):
    """The views with wrong poses."""
    cameras = wrong([view.camera for view in views], random, **amounts)
    return [replace(view, camera=one) for view, one in zip(views, cameras, strict=True)]


@pytest.mark.parametrize("seed", range(3))
def test_poses_wrong_by_a_degree_and_two_centimetres_end_right(room, seed):
    views = mistaken(room, np.random.default_rng(seed))
    found = refine_views(views)
    degrees, metres = errors(*([one.view.pose.to_world for one in each] for each in (found.cameras, room_cameras())))
    assert degrees.max() < 0.15 and metres.max() < 0.005
    assert found.warnings == () and len(found.pairs) == 6
    assert all(pair.after < 0.001 < pair.before for pair in found.pairs)
    if seed == 0:  # the mean of the poses stays where they are wrong in no direction more than in another
        moved = [a.view.pose.to_world - b.camera.view.pose.to_world for a, b in zip(found.cameras, views, strict=True)]
        assert np.linalg.norm(np.mean(moved, axis=0)[:3, 3]) < 0.01


def test_people_who_move_are_no_part_of_what_stands_still(room):
    still = furnished_room().still
    low, high = still.vertices.min(axis=0) - 0.05, still.vertices.max(axis=0) + 0.05
    view, pose = room[0], room[0].camera.view.pose.to_world
    places = view.points[view.known] @ pose[:3, :3].T + pose[:3, 3]
    assert ((places > low) & (places < high)).all() and view.known.mean() > 0.5
    away = (np.abs(places[:, :2]) < (0.4, 3)).all(axis=1) & (np.abs(places[:, 2]) < 0.4) & (places[:, 1] > 0.1)
    assert away.mean() < 0.01  # the middle, where the child jumps and the walker walks around


def test_the_result_is_the_same_again_and_its_picture_shows_distances_and_walls(room, tmp_path):
    found, again = (refine_views(mistaken(room[:2], np.random.default_rng(0))) for _ in range(2))
    for one, other in zip(found.cameras, again.cameras, strict=True):
        assert np.array_equal(one.view.pose.to_world, other.view.pose.to_world)
    write_calibration_sheet(found, "y", tmp_path / "sheet.png")
    assert read_picture(tmp_path / "sheet.png").std() > 10


def wall_views(*cameras, noise=2.0):
    """What cameras see of a wall alone, with noise in mm."""
    random, ball = np.random.default_rng(0), (0.0, 0.0, -50.0)
    depths = [measured(one, ball) * one.depth_unit for one in cameras]
    noisy = [np.where(depth > 0, depth + noise / 1000 * random.normal(size=depth.shape), 0) for depth in depths]
    return [still_view(one, [depth]) for one, depth in zip(cameras, noisy, strict=True)]


def test_along_a_single_wall_cameras_stay_and_are_named():
    views = wall_views(camera("left", -20), camera("right", 20))
    shift = np.array([0.03, 0.0, 0.02])  # along the wall and across it
    pose = views[1].camera.view.pose.to_world.copy()
    pose[:3, 3] += shift
    views[1] = replace(views[1], camera=posed(views[1].camera, pose))
    found = refine_views(views)
    [warning] = found.warnings
    assert "does not fix left, right: it is one plane" in warning
    moved = [
        one.view.pose.to_world[:3, 3] - view.camera.view.pose.to_world[:3, 3]
        for one, view in zip(found.cameras, views, strict=True)
    ]
    assert np.abs(moved[0] + moved[1]).max() < 1e-3  # the mean stays
    assert np.abs(moved[0] - moved[1] - [0, 0, 0.02]).max() < 2e-3


def test_a_camera_that_shares_no_surface_keeps_its_pose_and_is_named():
    behind = camera("behind", 180)
    pose = behind.view.pose.to_world.copy()
    pose[2, 3] = 2 * WALL + 2  # sees the wall's other side
    views = wall_views(camera("left", -20), camera("right", 20), posed(behind, pose))
    found = refine_views(views)
    assert any("left, right | behind; poses across a bar are as" in text for text in found.warnings)
    assert np.allclose(found.cameras[2].view.pose.to_world, pose, atol=1e-9)
    assert [pair.cameras for pair in found.pairs] == [("left", "right")]


def test_a_pair_that_ends_apart_is_named(room):
    views = list(room[:2])
    views[1] = replace(views[1], points=views[1].points * (1 + 0.1 * np.sin(9 * views[1].points[..., :1])))
    assert any("cameras corner0 and corner1 see surfaces" in text for text in refine_views(views).warnings)


def test_a_rig_of_one_camera_or_with_nothing_still_is_refused(tmp_path):
    from tests.capture.depth_scenes import record

    with pytest.raises(InputError, match="one camera; poses are calibrated between two"):
        refine(read_rig(record(tmp_path / "one", [camera()], [(0.0, 0.0, 0.0)])))
    blind = record(tmp_path / "blind", [camera(), camera("up", depth_range=(3.9, 4.0))], [(0.0, 0.0, 0.0)])
    with pytest.raises(InputError, match="camera up sees no surface that stands still; record more"):
        refine(read_rig(blind))
