"""`meshreel demo`: from nothing to a file, its numbers against the truth, and a picture."""

import sys
from functools import partial

import numpy as np
import pytest

import meshreel
from meshreel.capture.recording import open_recording
from meshreel.capture.simulated.simulated_rig import read_truth
from meshreel.capture.simulated.stage import StageOptions, record_stage
from meshreel.cli.console import called_as
from tests.capture.depth_scenes import camera, record
from tests.cli.conftest import failed
from tests.small_options import look_quickly, resolve_small


@pytest.fixture
def coarse(monkeypatch):
    """A demo that takes seconds: quick options, large pixels, large voxels."""
    resolve_small(monkeypatch.setattr)
    look_quickly(monkeypatch.setattr)
    monkeypatch.setattr("meshreel.cli.demo.WIDTH", 128)
    monkeypatch.setattr("meshreel.cli.demo.VOXEL", 0.06)


@pytest.mark.slow
@pytest.mark.usefixtures("coarse")
def test_the_demo_leaves_a_rig_a_file_and_a_picture_and_shows_its_numbers(run, tmp_path):
    said = run("demo", "-o", tmp_path / "demo", "--frames", "6", "--json")
    assert said.code == 0, said.err
    row = said.row
    assert row["frames"] == 6 and row["d2_psnr_paper"] > 40
    assert sum(row["bytes_by_content"].values()) == row["bytes"] == (tmp_path / "demo" / "demo.reel").stat().st_size
    assert row["bytes_by_content"]["background"] > 0
    truth = row["truth"]
    assert truth["frames"] == [0, 2, 3, 5]
    assert max(truth["decoded"][name] for name in ("people_median_m", "background_median_m")) < 0.02
    with meshreel.open(tmp_path / "demo" / "demo.reel") as video:
        assert len(video) == 6 and len(video.tracks) == row["scene"]["tracks"]
        assert not video.background(0).is_empty and not video.moving(5).is_empty
    assert (tmp_path / "demo" / "demo.png").read_bytes()[:4] == b"\x89PNG"


@pytest.mark.slow
def test_at_the_demos_own_resolution_two_people_are_two_tracks(run, tmp_path, monkeypatch):
    resolve_small(monkeypatch.setattr)
    look_quickly(monkeypatch.setattr)
    monkeypatch.setattr("meshreel.cli.demo.StageOptions", partial(StageOptions, frame_rate=10.0))  # time to move in
    row = run("demo", "-o", tmp_path, "--frames", "7", "--json").row
    assert row["scene"]["tracks"] == 2
    found, floor = (row["truth"][name]["background_median_m"] for name in ("decoded", "noise_floor"))
    assert found < floor  # fused over time


def test_the_rig_of_somebody_else_is_not_overwritten(run, tmp_path):
    record(tmp_path / "rig", [camera("mine")], [(0.0, 0.0, 0.0)])
    before = sorted(path for path in (tmp_path / "rig").rglob("*") if path.is_file())
    failed(run("demo", "-o", tmp_path, "--frames", "2"), "rig that is not of a demo", "--output")
    assert sorted(path for path in (tmp_path / "rig").rglob("*") if path.is_file()) == before


@pytest.mark.slow
@pytest.mark.usefixtures("coarse")
def test_the_same_seed_gives_the_same_bytes_and_another_one_other_noise(run, tmp_path):
    """Also where a longer demo was stopped before, of which nothing is left."""
    record_stage(tmp_path / "a" / "rig", StageOptions(frames=3, seed=5), 128)
    (tmp_path / "a" / "rig" / "rig.json").unlink()  # as if it had been stopped
    for name in ("a", "b"):
        assert run("demo", "-o", tmp_path / name, "--frames", "2", "--seed", "0", "--quiet").code == 0
    recording, warnings = open_recording(tmp_path / "a" / "rig")
    assert (len(recording), len(read_truth(tmp_path / "a" / "rig" / "truth")), warnings) == (2, 2, [])
    record_stage(tmp_path / "c" / "rig", StageOptions(frames=2, seed=1), 128)
    picture = "rig/corner0/depth/depth_00001.png"
    for file, same in (("demo.reel", "b"), (picture, "b")):
        assert (tmp_path / "a" / file).read_bytes() == (tmp_path / same / file).read_bytes()
    assert (tmp_path / "a" / picture).read_bytes() != (tmp_path / "c" / picture).read_bytes()
    still = [read_truth(tmp_path / name / "rig" / "truth")[0] for name in ("a", "c")]
    assert np.array_equal(*(frame.mesh.faces[~frame.dynamic] for frame in still))


@pytest.mark.skipif(sys.platform == "win32", reason="a program is found by its mode")
def test_a_command_is_shown_as_this_program_was_called(tmp_path, monkeypatch):
    here, there = tmp_path / "here" / "meshreel", tmp_path / "there" / "meshreel"
    for program in (here, there):
        program.parent.mkdir()
        program.write_text("#!/bin/sh\n")
        program.chmod(0o755)
    monkeypatch.setenv("PATH", str(here.parent))
    monkeypatch.chdir(tmp_path)
    module = str(tmp_path / "meshreel" / "__main__.py")
    calls = {str(here): "meshreel", "there/meshreel": "there/meshreel", module: f"{sys.executable} -m meshreel"}
    for called, shown in (calls | {"pytest": "meshreel"}).items():
        monkeypatch.setattr(sys, "argv", [called])
        assert called_as() == shown


def test_impossible_values_are_errors(run, tmp_path):
    assert failed(run("demo", "-o", tmp_path / "d", "--frames", "0"), "frames", "0")
    assert failed(run("demo", "-o", tmp_path / "d", "--quality", "-1"), "quality", "-1")
    assert failed(run("demo", "-o", tmp_path / "d", "--jobs", "0"), "jobs", "0")
    assert failed(run("demo", "-o", tmp_path / "d", "--seed", "-1"), "seed", "-1")
    assert not (tmp_path / "d").exists()
