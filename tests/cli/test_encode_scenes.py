"""`meshreel encode` of scenes: reports, masks, rigs, and errors."""

import re
import shutil

import numpy as np
import pytest
from PIL import Image

import meshreel
from meshreel.capture.recording import open_recording
from meshreel.cli.encode import _describe_scene, describe
from meshreel.encoder.group.interval import Interval
from meshreel.encoder.paper.recipe import PaperRecipe
from meshreel.io.write import write_picture
from tests.cli.conftest import failed
from tests.small_options import quick

pytestmark = pytest.mark.usefixtures("quick_presets", "quick_bodies")
FRAMES = ("--fps", "10")
QUICK = quick("paper").method


@pytest.fixture
def quick_bodies(monkeypatch):
    """Bodies coded frame by frame: what is told of a scene does not depend on how its bodies are coded."""

    def frame_by_frame(recipe, interval):
        del recipe
        frames = interval.frames
        alone = [frames] if frames[0].is_empty else [[frame] for frame in frames]
        return [group for some in alone for group in PaperRecipe(QUICK).encode(Interval(some))]

    monkeypatch.setattr("meshreel.encoder.layers.recipe.LayersRecipe.encode", frame_by_frame)


def test_a_scene_is_reported_by_its_contents_and_info_agrees(run, scan, tmp_path):
    out = tmp_path / "a.reel"
    row = run("encode", scan, "-o", out, *FRAMES, "--background-refresh", "0.2", "--json").row
    parts = row["scene"]["bytes_by_content"]
    assert sum(parts.values()) == row["bytes"] and list(parts) == ["background", "track 0", "track 1", "other"]
    assert sum(row["scene"]["mbps_by_content"].values()) == pytest.approx(row["mbps"])
    info = run("info", out, "--json").row
    assert [state["ranges"] for state in info["background"]] == [[[0, 1]], [[2, 3]]]  # two copies
    assert parts["background"] == row["scene"]["background_bytes"] == info["bytes_by_content"]["background"]
    assert [track["bytes"] for track in info["tracks"]] == [parts["track 0"], parts["track 1"]]
    assert info["metadata"]["noise_m"] == pytest.approx(row["scene"]["noise_m"], rel=1e-3)
    assert {group["track"] for group in row["groups"]} == {0, 1}
    told = describe(row)
    assert f"background {parts['background']} bytes (" in told and "2 tracks (" in told
    assert re.search(r" mm, \d+ groups? of form \w+", told)
    with meshreel.open(out) as video:
        assert len(video.tracks) == 2 and not video.background(0).is_empty


def test_masks_say_what_moves_and_a_target_is_met_with_them(run, scan, painted, tmp_path):
    out = tmp_path / "a.reel"
    command = ("encode", scan, "-o", out, *FRAMES, "--frames", ":2", "--masks", painted)
    first = run(*command, "--quality", "45", "--json").row
    assert first["scene"]["tracks"] == 2 and first["scene"]["background_bytes"] > 0
    again = run(*command, "--target-mbps", first["mbps"], "--json")
    assert again.code == 0 and again.row["mbps"] == pytest.approx(first["mbps"], rel=0.05)


def test_where_all_moves_there_is_no_background(run, scan, painted, tmp_path):
    shutil.copytree(painted, tmp_path / "white")
    for picture in (tmp_path / "white").glob("view*/*.png"):
        Image.fromarray(np.full((90, 120), 1, np.uint8)).save(picture)
    out = tmp_path / "a.reel"
    said = run("encode", scan, "-o", out, "--frames", ":1", "--masks", tmp_path / "white", "--json")
    assert said.code == 0 and said.row["scene"]["background_bytes"] == 0
    with meshreel.open(out) as video:
        assert video.background(0).is_empty and not video.moving(0).is_empty


def test_a_background_that_leaves_nothing_of_the_rate_is_reported_at_once(run, scan, tmp_path):
    out = tmp_path / "a.reel"
    said = run("encode", scan, "-o", out, *FRAMES, "--target-mbps", "0.0001")
    assert failed(said, "a.reel: the background alone takes", "the target is 0.0001 Mbps", "over 0.4 s")
    assert not out.exists()


def test_a_refresh_of_what_is_not_there_is_reported(run, balls, tmp_path):
    said = run("encode", balls, "-o", tmp_path / "a.reel", "--frames", ":1", "--background-refresh", "1")
    assert said.code == 0 and "--background-refresh does nothing" in said.err


def test_planes_that_nothing_closes_are_reported(run, balls, tmp_path):
    said = run("encode", balls, "-o", tmp_path / "a.reel", "--frames", ":1", "--close-planes")
    assert said.code == 0 and "--close-planes closes nothing" in said.err


def test_guessed_surface_is_reported():
    scene = {"background_bytes": 9, "guessed_m2": 0.31, "tracks": 1, "noise_m": 0.003}
    told = _describe_scene(scene | {"mbps_by_content": {"background": 0.1, "track 0": 0.2}})
    assert told == "background 9 bytes (0.100 Mbps), 0.31 m2 of it guessed, 1 track (0.200 Mbps), noise 3 mm, "


def test_a_rig_is_fused_on_the_fly_at_its_own_rate(run, rig, tmp_path):
    (rig / "left" / "depth" / "depth_00001.png").unlink()
    out = tmp_path / "a.reel"
    said = run("encode", rig, "-o", out, "--frames", ":1", "--quality", "0")
    assert said.code == 0 and "camera left lacks 1 of 3 frames" in said.err
    with meshreel.open(out) as video:
        assert (len(video), video.frame_rate) == (1, 15)
        assert not video[0].is_empty
    assert failed(run("encode", rig, "-o", out, "--fps", "24"), "--fps 24", "a rig of 15 frames")
    assert failed(run("encode", rig, "-o", out, "--scale", "0.001"), "--scale 0.001", "metres")
    assert failed(run("encode", rig, "-o", out, "--frames", "3:"), "leave 0")


def test_a_file_names_the_axis_that_points_up(run, rig, tmp_path):
    """That of the rig's cameras, also of meshes that `capture` made; or that given; y is not told."""
    out, scan = tmp_path / "a.reel", tmp_path / "scan"
    assert run("capture", rig, "-o", scan, "--voxel", "0.06", "--frames", ":1").code == 0
    for inputs, flags, up in (
        (rig, (), "-y"),
        (scan, (), "-y"),
        (scan, ("--up", "z"), "z"),
        (scan, ("--up", "y"), None),
    ):
        assert run("encode", inputs, "-o", out, "--frames", ":1", "--quality", "0", *flags).code == 0
        reader = meshreel.open(out).reader
        assert (reader.metadata.get("up"), reader.up) == (up, up or "y")


def test_captured_meshes_have_the_rate_of_their_recording(run, rig, tmp_path):
    scan = tmp_path / "scan"
    assert run("capture", rig, "-o", scan, "--voxel", "0.06").code == 0
    rate = open_recording(rig)[0].frame_rate
    assert rate != 30
    assert run("encode", scan, "-o", tmp_path / "a.reel", "--dynamic-only", "--json").code == 0
    with meshreel.open(tmp_path / "a.reel") as video:
        assert video.frame_rate == rate
    run("encode", scan, "-o", tmp_path / "b.reel", "--dynamic-only", "--fps", "7")
    with meshreel.open(tmp_path / "b.reel") as video:
        assert video.frame_rate == 7


def test_depth_that_is_all_zero_is_reported_and_gives_empty_frames(run, rig, tmp_path):
    for picture in rig.glob("*/depth/*.png"):
        write_picture(np.zeros((96, 96), np.uint16), picture)
    said = run("encode", rig, "-o", tmp_path / "a.reel")
    assert said.code == 0 and "1 group of form empty" in said.out
    assert said.err.count("measures nothing in 3 of 3 frames looked at") == 2
    assert failed(run("segment", rig, "-o", tmp_path / "out"), "has a surface; give a frame with faces")


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--masks", "masks", "--dynamic-only"], ["--dynamic-only", "masks"]),
        (["--views", "none.json"], ["none.json", "cannot be read"]),
        (["--masks", "masks"], ["cameras.json", "cannot be read"]),
        (["--sam3", "masks"], ["masks: holds no weights of SAM3", "model.safetensors"]),
        (["--sam3", "none", "--masks", "masks"], ["--masks masks", "one of both"]),
    ],
)
def test_impossible_flags_are_errors_before_anything_is_written(run, scan, tmp_path, arguments, words, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "masks").mkdir()
    assert failed(run("encode", scan, "-o", "a.reel", *arguments), *words)
    assert [path.name for path in tmp_path.iterdir()] == ["masks"]
