"""Cameras that move: poses of each frame are read, interpolated, refined on what stands still, and used."""

import json
import shutil

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from meshreel.capture.calibration.paths import refine_paths
from meshreel.capture.recording import open_recording
from meshreel.capture.recordings.takes import LOST_TRACK, Poses
from meshreel.capture.rig.cameras import DepthCamera, at_frame
from meshreel.capture.rig.rig import RIG, read_cameras, read_rig, write_rig
from meshreel.capture.simulated.simulated_rig import TRUTH, read_truth
from meshreel.errors import InputError
from meshreel.geometry.cameras import Camera, CameraPose
from meshreel.geometry.closest_points import Surface
from meshreel.geometry.depth import DepthPicture, is_carried, looked_at
from meshreel.io.write import write_picture
from meshreel.metrics.depth import DepthJudge, judge
from tests.capture.walks import record_walk
from tests.capture.wrong_poses import errors


@pytest.fixture(scope="module")
def walk(tmp_path_factory):
    folder = tmp_path_factory.mktemp("walk") / "rig"
    return folder, record_walk(folder)


def turned(degrees, place=(0.0, 0.0, 0.0)):
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = Rotation.from_euler("y", degrees, degrees=True).as_matrix(), place
    return pose


def test_poses_between_two_times_are_between_them_and_none_is_made_up_far_away():
    poses = Poses(np.stack([turned(0), turned(90, (1.0, 0, 2.0))]), np.array([10.0, 10.1]))
    found = poses.at(np.array([10.05, 10.1, 10.1 + 0.9 * LOST_TRACK, 9.9 - LOST_TRACK, 11.0]))
    assert np.allclose(found[0], turned(45, (0.5, 0, 1.0))) and np.allclose(found[1:3], turned(90, (1.0, 0, 2.0)))
    assert np.isnan(found[3:]).all()


def test_poses_that_a_tracker_lost_do_not_count():
    lost = np.full((4, 4), np.nan)
    poses = Poses(np.stack([turned(0), lost, turned(10)]), np.array([0.0, 0.05, 0.1]))
    assert np.allclose(poses.at(np.array([0.05]))[0], turned(5))
    assert np.array_equal(Poses(turned(3)[None]).at(np.array([5.0, 9.0])), np.stack([turned(3)] * 2))


def test_each_picture_of_a_rig_is_taken_from_the_pose_of_its_frame(walk):
    folder, camera = walk
    rig = read_rig(folder)
    recorded = json.loads((folder / "phone" / "poses.json").read_text())["camera_to_world"]
    for frame in (0, 5, 11):
        taken, seen = rig.depth_pictures(frame)[0], rig.color_pictures(frame)[0]
        assert np.allclose(taken.camera.pose.to_world, recorded[str(frame)], atol=1e-9)
        assert seen.camera.pose == taken.camera.pose
    truth = read_cameras(folder / TRUTH)[0][0]
    assert np.allclose(truth.path[7].to_world, camera.path[7].to_world, atol=1e-8)
    assert read_truth(folder / TRUTH).only([4, 9]).cameras[0].path[1] == truth.path[9]


def test_a_recording_of_it_is_opened_and_its_frames_lie_on_the_truth(walk):
    folder, _ = walk
    recording, warnings = open_recording(folder, frames="0:2")
    assert warnings == [] and folder / "phone" / "poses.json" in recording.files
    truth = Surface(read_truth(folder / TRUTH)[0].mesh)
    assert np.median(truth.distances(recording[0].vertices)) < 0.02  # of the drift, too
    assert is_carried(recording.depth.__getitem__, 2) and recording[0].is_colored


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (lambda poses: poses.pop("3"), r"poses\.json: has no pose of camera phone in 1 of 12 frames, as 3: .*png"),
        (lambda poses: poses.update({"4": [[1]]}), r"poses\.json: frame 4: camera : camera_to_world has the shape"),
        (lambda poses: poses.update({"first": poses["4"]}), r"poses\.json: has no object `camera_to_world`"),
        (lambda poses: poses.update({"4": np.zeros((4, 4)).tolist()}), r"frame 4: camera phone: camera_to_world "),
        (lambda poses: poses.clear(), r"poses\.json: has no object `camera_to_world`"),
    ],
)
def test_poses_that_are_missing_or_none_are_named(walk, tmp_path, change, told):
    folder = tmp_path / "rig"
    shutil.copytree(walk[0], folder)
    path = folder / "phone" / "poses.json"
    record = json.loads(path.read_text())
    change(record["camera_to_world"])
    path.write_text(json.dumps(record))
    with pytest.raises(InputError, match=told):
        read_rig(folder)


def test_colour_that_stands_still_beside_depth_that_moves_is_refused(walk, tmp_path):
    folder = tmp_path / "rig"
    shutil.copytree(walk[0], folder)
    record = json.loads((folder / RIG).read_text())
    record["cameras"][0]["color"]["camera_to_world"] = np.eye(4).tolist()
    (folder / RIG).write_text(json.dumps(record))
    with pytest.raises(InputError, match=r"camera phone moves by phone/poses\.json, its color stands still"):
        read_rig(folder)


def test_drift_is_taken_out_and_told(walk, tmp_path):
    folder = tmp_path / "rig"
    shutil.copytree(walk[0], folder)
    (remark,) = refine_paths(folder)
    assert "camera phone moves: surfaces seen twice lie" in remark and "by its recorded poses" in remark
    true = [walk[1].path[frame].to_world for frame in range(12)]

    def off(folder):
        return errors([at_frame(read_rig(folder).cameras[0], k).view.pose.to_world for k in range(12)], true)

    before, after = off(walk[0]), off(folder)
    assert before[0].max() > 0.3 and after[0].max() < 0.15  # degrees
    assert before[1].max() > 0.008 and after[1].mean() < 0.4 * before[1].mean()  # m
    eye = read_rig(folder).color_cameras[0]
    assert eye.path[6] == read_rig(folder).cameras[0].path[6]


def test_a_camera_before_a_bare_wall_keeps_its_poses(tmp_path):
    """Nothing tells where it is along the wall: what its tracker says holds."""
    path = {k: CameraPose.of_camera(turned(0, (0.1 * k, 0, 0.0))) for k in range(5)}
    camera = DepthCamera("phone", Camera(96, 96, (96.0, 96.0), (48.0, 48.0), path[0]), path=path)
    write_rig(tmp_path, (camera,), 10.0)
    (tmp_path / "phone" / "depth").mkdir()
    for number in path:
        write_picture(np.full((96, 96), 2000, np.uint16), tmp_path / "phone" / "depth" / f"{number}.png")
    assert refine_paths(tmp_path) == [] and not list((tmp_path / "phone").glob("*.before.json"))
    found = read_rig(tmp_path).cameras[0].path
    assert max(np.abs(found[k].to_world - path[k].to_world).max() for k in path) < 1e-3


def test_a_point_is_looked_at_unless_it_is_hidden_or_outside_of_the_picture():
    picture = DepthPicture(Camera(10, 10, (10.0, 10.0), (5.0, 5.0)), np.full((10, 10), 2000, np.uint16), 0.001, 10.0)
    points = np.array([[0.0, 0, 1.0], [0, 0, 2.01], [0, 0, 2.5], [3, 0, 2.0], [0, 0, -1.0]])
    assert looked_at([picture, None], points).tolist() == [True, True, False, False, False]
    assert not is_carried(lambda _: [picture, None], 9)


def test_numbers_of_frames_may_have_zeros_before_them(walk, tmp_path):
    folder = tmp_path / "rig"
    shutil.copytree(walk[0], folder)
    path = folder / "phone" / "poses.json"
    record = json.loads(path.read_text())["camera_to_world"]
    path.write_text(json.dumps({"camera_to_world": {f"{int(frame):04}": pose for frame, pose in record.items()}}))
    assert read_rig(folder).cameras[0].path == read_rig(walk[0]).cameras[0].path
    assert read_cameras(folder)[0][0].path == read_rig(walk[0]).cameras[0].path


@pytest.fixture
def two(walk, tmp_path):
    """A rig of two cameras on the same path, of which the second lacks a picture of depth."""
    folder = tmp_path / "rig"
    shutil.copytree(walk[0], folder)
    shutil.copytree(folder / "phone", folder / "second")
    record = json.loads((folder / RIG).read_text())
    record["cameras"].append(json.loads(json.dumps(record["cameras"][0]).replace("phone", "second")))
    (folder / RIG).write_text(json.dumps(record))
    next((folder / "second" / "depth").glob("*00005.png")).unlink()
    return folder


def test_poses_of_frames_without_a_picture_of_depth_are_kept_and_those_as_recorded_too(two):
    before = (two / "second" / "poses.json").read_bytes()
    assert len(refine_paths(two)) == 2
    rig = read_rig(two)
    assert 5 not in rig.cameras[1].path and 5 in rig.color_cameras[1].path
    moved = rig.color_cameras[1].path[5].to_world[:3, 3] - read_rig(two).cameras[0].path[5].to_world[:3, 3]
    assert np.abs(moved).max() < 0.01  # with the frames beside it
    assert (two / "second" / "poses.before.json").read_bytes() == before
    refine_paths(two)
    assert (two / "second" / "poses.before.json").read_bytes() == before  # those of the first time


def test_two_cameras_with_one_file_of_poses_are_refused(two):
    record = json.loads((two / RIG).read_text())
    record["cameras"][1]["poses"] = "phone/poses.json"
    (two / RIG).write_text(json.dumps(record))
    with pytest.raises(InputError, match=r"two cameras have the poses phone/poses\.json; give each"):
        read_rig(two)


@pytest.mark.parametrize("pose", [2 * np.eye(4), np.diag([1.0, 1, -1, 1]), np.zeros((4, 4))])
def test_a_matrix_that_is_no_pose_is_told_by_its_number(pose):
    with pytest.raises(InputError, match=r"pose 1 is \[\["):
        Poses(np.stack([np.eye(4), pose]), np.array([0.0, 1.0]))


def test_poses_that_are_far_apart_in_time_hold_between_them():
    slow = Poses(np.stack([turned(0), turned(0, (1.0, 0, 0)), turned(0, (2.0, 0, 0))]), np.array([0.0, 1.0, 2.0]))
    assert np.allclose(slow.at(np.array([0.5, 2.9]))[:, 0, 3], [0.5, 2.0]) and np.isnan(slow.at(np.array([3.1]))).all()


def test_depth_judges_a_walk_without_bodies_and_flicker(walk):
    recording, _ = open_recording(walk[0], frames="0:3")
    judged = DepthJudge(recording.depth, 3, (0.0, 1.0, 0.0))
    row = judge(judged, recording, range(3))
    assert row["all_covered"] > 0.9 and row["body_covered"] is None
    assert row["still_flicker_m"] is None and row["body_flicker_deg"] is None
