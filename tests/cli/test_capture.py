"""`meshreel capture`: a rig's folder becomes frames, all of them, also after an interruption."""

import json
from pathlib import Path

import numpy as np
import pytest

from meshreel.cli import main
from meshreel.cli.sources import Reading, open_source
from meshreel.geometry import reconstruct
from meshreel.io.pictures import read_depth
from meshreel.io.sequence import open_sequence
from meshreel.io.write import write_picture
from tests.capture.depth_scenes import RADIUS, camera, record
from tests.capture.recordings.files import tum
from tests.cli.conftest import failed

BALLS = [(0.1 * number, 0.0, 0.0) for number in range(3)]


@pytest.fixture
def rig(tmp_path):
    return record(tmp_path / "rig", [camera(), camera("side", 90), camera("back", 180)], BALLS, wall=False)


def test_a_recording_becomes_a_mesh_per_frame(rig, tmp_path, capsys):
    out = tmp_path / "frames"
    assert main(["capture", str(rig), "-o", str(out), "--voxel", "0.04", "--json"]) == 0
    row = json.loads(capsys.readouterr().out)
    assert (row["frames"], row["fused"], row["frame_rate"]) == (3, 3, 15)
    frames = open_sequence(out)
    assert [path.name for path in sorted(out.glob("*.ply"))] == [f"frame_{i:05}.ply" for i in range(3)]
    for mesh, ball in zip(frames, BALLS, strict=True):
        assert abs(np.median(np.linalg.norm(mesh.vertices - ball, axis=1)) - RADIUS) < 0.01


def test_an_interrupted_run_goes_on_and_gives_the_same_bytes(rig, tmp_path, capsys):
    out = tmp_path / "frames"
    command = ["capture", str(rig), "-o", str(out), "--voxel", "0.04", "--json"]
    assert main(command) == 0
    before = {path.name: path.read_bytes() for path in out.glob("*.ply")}
    (out / "frame_00001.ply").unlink()
    capsys.readouterr()
    assert main(command) == 0
    assert json.loads(capsys.readouterr().out)["fused"] == 1
    assert {path.name: path.read_bytes() for path in out.glob("*.ply")} == before


def test_a_range_of_frames_is_taken(rig, tmp_path, capsys):
    out = tmp_path / "frames"
    command = ["capture", str(rig), "-o", str(out), "--voxel", "0.05", "--json", "--frames"]
    assert main([*command, "1:"]) == 0 and json.loads(capsys.readouterr().out)["frames"] == 2
    assert json.loads((out / "capture.json").read_text())["frames"] == [1, 2]
    assert main([*command, "3:"]) == 2 and "leave 0" in capsys.readouterr().err


def test_frames_of_other_options_are_not_mixed(rig, tmp_path, capsys):
    out = tmp_path / "frames"
    assert main(["capture", str(rig), "-o", str(out), "--voxel", "0.05"]) == 0
    assert main(["capture", str(rig), "-o", str(out), "--voxel", "0.04"]) == 2
    assert "other inputs or options (fusion.voxel 0.05, now 0.04); choose" in capsys.readouterr().err
    (out / "capture.json").write_text("{")
    assert main(["capture", str(rig), "-o", str(out), "--voxel", "0.05"]) == 2
    (out / "capture.json").unlink()
    assert main(["capture", str(rig), "-o", str(out), "--voxel", "0.05"]) == 2
    assert "without a capture.json" in capsys.readouterr().err


def test_what_is_missing_is_reported_once_and_errors_take_one_line(rig, tmp_path, capsys):
    (rig / "side" / "depth" / "depth_00002.png").unlink()
    assert main(["capture", str(rig), "-o", str(tmp_path / "frames"), "--voxel", "0.05"]) == 0
    assert capsys.readouterr().err.count("camera side lacks 1 of 3 frames") == 1
    assert main(["capture", str(tmp_path / "nothing"), "-o", str(tmp_path / "other")]) == 2
    error = capsys.readouterr().err
    assert "nothing: no such file or folder; check the path" in error and error.count("\n") == 1
    assert main(["capture", str(rig), "-o", str(tmp_path / "other"), "--voxel", "9"]) == 2
    assert "voxel 9" in capsys.readouterr().err and not (tmp_path / "other").exists()


def test_a_recording_that_was_made_again_is_not_mixed_with_the_one_before(rig, tmp_path, capsys):
    command = ["capture", str(rig), "-o", str(tmp_path / "frames"), "--voxel", "0.05"]
    assert main(command) == 0
    path = rig / "side" / "depth" / "depth_00001.png"
    write_picture(read_depth(path) // 2, path)
    assert main(command) == 2
    assert "(pictures[1] " in capsys.readouterr().err


def test_pictures_of_noise_alone_give_frames_without_a_surface_which_are_reported(rig, tmp_path, capsys):
    random = np.random.default_rng(0)
    for path in rig.rglob("depth_*.png"):
        write_picture(random.integers(0, 65_535, (96, 96)).astype(np.uint16), path)
    assert main(["capture", str(rig), "-o", str(tmp_path / "frames"), "--voxel", "0.1"]) == 0
    assert "3 of 3 fused frames have no surface, as frame_00000.ply" in capsys.readouterr().err


def test_surface_in_too_many_blocks_is_refused_with_the_frame(rig, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(reconstruct, "MOST_BLOCKS", 10)
    assert main(["capture", str(rig), "-o", str(tmp_path / "frames"), "--voxel", "0.02"]) == 2
    error = capsys.readouterr().err
    assert "rig: frame 0: surface in " in error and "are depth_unit_m and depth_max_m right?" in error
    assert not list((tmp_path / "frames").glob("frame_*"))


def test_a_recording_is_listed_and_becomes_a_rig(tmp_path, run):
    folder, rig = tum(tmp_path / "desk"), tmp_path / "rig"
    said = run("capture", "--list", folder)
    assert said.code == 0 and "camera: depth 96 x 96, 4 pictures in 0.30 s (10 a second), calibrated" in said.out
    camera = run("capture", "--list", folder, "--json").row["recordings"][0]["cameras"][0]
    assert camera["depth"]["pictures"] == 4 and camera["color"]["calibrated"] and camera["poses"] == 4
    row = run("capture", folder, "-o", rig, "--json").row
    assert (row["cameras"], row["color_cameras"], row["frames"], row["frame_rate"]) == (1, 1, 4, 10)
    said = run("capture", "--list", rig).out
    assert "rig: a rig, 4 frames, 10 a second" in said and "desk-camera-color: color 96 x 96, 4 pictures" in said
    assert run("capture", "--list", rig, "--json").row["recordings"][0]["cameras"][0]["pictures"] == 4
    assert run("capture", rig, "-o", tmp_path / "meshes", "--voxel", "0.05").code == 0
    assert len(open_sequence(tmp_path / "meshes")) == 4


def test_commands_that_take_scenes_take_recordings_through_a_temporary_rig(tmp_path):
    source = open_source([str(tum(tmp_path / "desk"))], Reading(frames="1:3"))
    assert len(source.sequence) == 2 and len(source.sequence[0].faces) > 1000 and source.warnings == ()
    place = Path(source.scratch.name)
    assert (place / "rig" / "rig.json").exists()
    del source
    assert not place.exists()


def test_recordings_take_no_options_of_fusion_and_no_folder_that_is_there(tmp_path, run):
    folder = tum(tmp_path / "desk")
    assert failed(run("capture", folder), "--output is missing")
    assert failed(run("capture", folder, "-o", tmp_path / "rig", "--voxel", "0.1"), "is no rig: make one of it")
    assert failed(run("capture", folder, "-o", tmp_path), "is there already; choose another folder")
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "rig.json").write_text("{}")
    for inputs in ([folder, tmp_path / "other"], [tmp_path / "other", folder]):
        assert failed(run("encode", *inputs, "-o", tmp_path / "x.reel"), "other: is a rig, which no other")
    assert failed(run("capture", tmp_path, "-o", tmp_path / "rig"), "nor a recording that can be read", ".mkv")
    assert not (tmp_path / "rig").exists()
