"""A rig takes other poses: colour cameras go with their depth cameras, and all else of the description stays."""

import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from meshreel.capture.calibration.poses import described, posed_by, with_poses
from meshreel.capture.rig.rig import read_rig
from meshreel.errors import InputError
from tests.capture.depth_scenes import camera, record


def shifted(x):
    pose = np.eye(4)
    pose[0, 3] = x
    return pose


@pytest.fixture
def rig(tmp_path):
    """Two depth cameras; one has a colour camera 5 cm beside it, one an aligned one, and a third stands alone."""
    folder = record(tmp_path / "rig", [camera(), camera("side", 90)], [(0.0, 0.0, 0.0)])
    for name in ("front/color", "side/color", "alone"):
        (folder / name).mkdir()
        Image.fromarray(np.zeros((96, 96, 3), np.uint8)).save(folder / name / "color_00000.png")
    described = json.loads((folder / "rig.json").read_text())
    front, side = described["cameras"]
    front["color"] = {
        "folder": "front/color",
        "camera_to_world": (np.array(front["camera_to_world"]) @ shifted(0.05)).tolist(),
    }
    side["color"] = "side/color"
    described |= {"remark": "kept", "color_cameras": [front | {"name": "alone", "folder": "alone"}]}
    for key in ("depth", "color"):
        del described["color_cameras"][0][key]
    (folder / "rig.json").write_text(json.dumps(described))
    return read_rig(folder)


def read_again(rig):
    (rig.folder / "rig.json").write_bytes(described(rig))
    return read_rig(rig.folder)


def test_colour_cameras_go_with_their_depth_cameras(rig):
    poses = {"front": shifted(1.0), "side": shifted(2.0)}
    again = read_again(with_poses(rig, poses, {}))
    assert [one.view.pose.to_world[0, 3] for one in again.cameras] == [1.0, 2.0]
    assert [one.view.pose.to_world[0, 3] for one in again.color_cameras] == pytest.approx([1.05, 2.0, 0.0])
    assert json.loads((rig.folder / "rig.json").read_text())["remark"] == "kept"


def test_poses_of_colour_cameras_place_the_depth_cameras_beside_them(rig):
    found, warnings = posed_by(rig, {"front": shifted(1.0), "alone": shifted(3.0)}, "color", Path("x.json"))
    again = read_again(found)
    assert again.cameras[0].view.pose.to_world[0, 3] == pytest.approx(0.95)
    assert np.allclose(again.cameras[1].view.pose.to_world, rig.cameras[1].view.pose.to_world)
    assert again.color_cameras[2].view.pose.to_world[0, 3] == 3.0
    assert warnings == ["x.json: has no pose of side, which stay where they were"]


def test_poses_of_none_of_the_cameras_are_refused(rig):
    with pytest.raises(
        InputError, match=r"x.json: has poses of a, b and of none of the depth cameras front, side; name"
    ):
        posed_by(rig, {"a": shifted(0), "b": shifted(1)}, "depth", Path("x.json"))
