"""`meshreel calibrate`: new poses beside the old ones, or in place where that is asked for."""

import json

import numpy as np
import pytest

from meshreel.capture.rig.cameras import posed
from meshreel.capture.rig.rig import read_rig
from meshreel.cli import main
from meshreel.cli.calibrate import BEFORE
from tests.capture.depth_scenes import camera, record
from tests.capture.walks import record_walk

SHIFT = np.array([0.01, 0.0, 0.02])  # m
CAMERAS = [camera(name, side, size=160) for name, side in (("left", -25), ("middle", 0), ("right", 25))]


@pytest.fixture
def rig(tmp_path):
    """Cameras around a ball before a wall; the description has one of them in a wrong place."""
    folder = record(tmp_path / "rig", CAMERAS, [(0.0, 0.0, 0.0)] * 3)
    text = json.loads((folder / "rig.json").read_text())
    pose = np.array(text["cameras"][1]["camera_to_world"])
    pose[:3, 3] += SHIFT
    text["cameras"][1]["camera_to_world"] = pose.tolist()
    (folder / "rig.json").write_text(json.dumps(text))
    return folder


def apart(path, folder):
    """How far the middle camera is from its place, as the others see it, m."""
    (folder / "rig.json").write_bytes(path.read_bytes())
    places = [
        one.view.pose.to_world[:3, 3] - true.view.pose.to_world[:3, 3]
        for one, true in zip(read_rig(folder).cameras, CAMERAS, strict=True)
    ]
    return float(np.linalg.norm(places[1] - (places[0] + places[2]) / 2))


def test_a_recording_of_one_camera_has_no_poses_to_calibrate(tmp_path, capsys):
    (tmp_path / "camera.json").write_text("{}")
    assert main(["calibrate", str(tmp_path), "-o", str(tmp_path / "new.json")]) == 2
    assert "has one camera, in camera.json" in capsys.readouterr().err


def test_new_poses_and_a_picture_are_written_beside_the_old_ones(rig, tmp_path, capsys):
    before, out = (rig / "rig.json").read_bytes(), tmp_path / "new.json"
    assert main(["calibrate", str(rig), "-o", str(out), "--json"]) == 0
    row = json.loads(capsys.readouterr().out)
    assert [pair["cameras"] for pair in row["pairs"]] == [["left", "middle"], ["left", "right"], ["middle", "right"]]
    assert row["pairs"][0]["after_mm"] < 1 < row["pairs"][0]["before_mm"]
    assert (rig / "rig.json").read_bytes() == before and (tmp_path / "new.png").stat().st_size > 10_000
    assert apart(out, rig) < 0.003 < np.linalg.norm(SHIFT)


def test_poses_of_a_camera_that_moves_are_refined_in_place_alone_and_kept(tmp_path, capsys):
    rig = tmp_path / "rig"
    record_walk(rig, 8, people=False, width=96)
    assert main(["calibrate", str(rig), "-o", str(tmp_path / "new.json")]) == 2
    assert "has cameras that move" in (told := capsys.readouterr().err) and "give --in-place alone" in told
    before = (rig / "phone" / "poses.json").read_bytes()
    assert main(["calibrate", str(rig), "--in-place"]) == 0
    assert "camera phone moves: surfaces seen twice lie" in capsys.readouterr().out
    assert (rig / "phone" / "poses.before.json").read_bytes() == before != (rig / "phone" / "poses.json").read_bytes()


def test_in_place_keeps_the_description_before(rig, capsys):
    before = (rig / "rig.json").read_bytes()
    assert main(["calibrate", str(rig), "--in-place"]) == 0
    assert "left - middle" in capsys.readouterr().out
    assert (rig / BEFORE).read_bytes() == before != (rig / "rig.json").read_bytes()
    assert (rig / "calibration.png").exists()


def test_poses_of_a_file_are_taken_with_their_scale(rig, tmp_path, capsys):
    text = json.loads((rig / "rig.json").read_text())
    for entry in text["cameras"]:
        entry["camera_to_world"] = [[*row[:3], 1000 * row[3]] for row in entry["camera_to_world"][:3]] + [[0, 0, 0, 1]]
    given, out = tmp_path / "given.json", tmp_path / "new.json"
    given.write_text(json.dumps(text))
    command = ["calibrate", str(rig), "-o", str(out), "--poses", str(given), "--scale", "0.001", "--no-refine"]
    assert main(command) == 0 and "given cameras" in capsys.readouterr().out
    (rig / "rig.json").write_bytes(out.read_bytes())
    shifted = posed(CAMERAS[1], CAMERAS[1].view.pose.to_world + np.pad(SHIFT[:, None], ((0, 1), (3, 0))))
    assert np.allclose(read_rig(rig).cameras[1].view.pose.to_world, shifted.view.pose.to_world)


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        ([], "give either --output FILE.json, or --in-place"),
        (["-o", "new.json", "--in-place"], "give either --output"),
        (["-o", "new.yml"], "must end in .json"),
        (["-o", "RIG/rig.json"], "is the input"),
        (["-o", "new.json", "--scale", "0"], "--scale 0: give a factor above 0"),
        (["-o", "nowhere/new.json"], "nowhere/new.json: there is no folder nowhere"),
        (["-o", "new.json", "--scale", "2"], "--scale and --poses-of are for the poses of a file; give --poses"),
        (["-o", "new.json", "--columns", "5"], "are of a board; give --board, too"),
        (["-o", "new.json", "--no-refine"], "--no-refine leaves nothing to do without --poses or --board"),
        (["-o", "new.json", "--board", "charuco"], "rig: has no colour cameras, in whose pictures --board is found"),
        (
            ["-o", "new.json", "--poses", "RIG/rig.json", "--poses-of", "color"],
            "rig: has no color cameras, whose poses",
        ),
        (["-o", "new.json", "--poses", "mirror.json"], "mirror.json: camera left: camera_to_world is no rotation"),
    ],
)
def test_an_output_that_would_lose_poses_is_refused(rig, capsys, monkeypatch, tmp_path, arguments, told):
    monkeypatch.chdir(tmp_path)
    mirrored = {"name": "left", "camera_to_world": np.diag([1, 1, -1, 1]).tolist()}
    (tmp_path / "mirror.json").write_text(json.dumps({"cameras": [mirrored]}))
    assert main(["calibrate", str(rig), *(one.replace("RIG", str(rig)) for one in arguments)]) == 2
    error = capsys.readouterr().err
    assert told in error and error.count("\n") == 1
