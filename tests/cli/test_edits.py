"""Edits from the command line: `cut`, `retime`, `transform` and `tag` (`concat` has tests of its own)."""

import numpy as np

import meshreel
from tests.cli.conftest import SCENE, failed
from tests.golden import frame_record


def test_a_cut_tells_of_hidden_frames_and_info_shows_those_that_are_shown(run, tmp_path):
    said = run("cut", SCENE, "-o", tmp_path / "a.reel", "--frames", "4:9", "--json")
    assert said.row["frames"] == 5 and said.row["hidden"] == 9 and "9 hidden frames" in said.err
    shown = run("info", tmp_path / "a.reel", "--json").row
    assert shown["frames"] == 5 and shown["metadata"]["history"] == ["cut 4:9"]
    assert all(0 <= first <= last < 5 for track in shown["tracks"] for first, last in track["ranges"])
    whole = run("cut", SCENE, "-o", tmp_path / "b.reel", "--frames", "4:9", "--keys", "--json")
    assert whole.row["hidden"] == 0 and whole.err == ""


def test_decode_and_export_of_a_cut_have_its_frames(run, tmp_path):
    assert run("cut", SCENE, "-o", tmp_path / "a.reel", "--frames", "4:9").code == 0
    assert run("decode", tmp_path / "a.reel", "-o", tmp_path / "out").out.count("5 ply files") == 1
    assert run("export", tmp_path / "a.reel", "-o", tmp_path / "a.glb", "--json").row["frames"] == 5


def test_rotations_are_about_x_then_y_then_z(run, tmp_path):
    assert (
        run(
            "transform", SCENE, "-o", tmp_path / "a.reel", "--rotate", "90", "0", "90", "--scale", "2", "--up", "z"
        ).code
        == 0
    )
    video = meshreel.open(tmp_path / "a.reel")
    after, (x, y, z) = video[2].vertices, 2 * meshreel.open(SCENE)[2].vertices.T
    assert video.up == "z"
    np.testing.assert_allclose(after, np.column_stack([z, x, y]), atol=1e-6)  # y to z, -z to y; then x to y, -y to x


def test_a_title_and_a_speed(run, tmp_path):
    assert run("tag", SCENE, "title=A walk", "take=3", "-o", tmp_path / "a.reel").code == 0
    assert run("retime", tmp_path / "a.reel", "--speed", "2", "-o", tmp_path / "b.reel").code == 0
    video = meshreel.open(tmp_path / "b.reel")
    assert video.metadata["title"] == "A walk" and video.metadata["take"] == 3 and video.frame_rate == 50
    assert frame_record(video[3]) == frame_record(meshreel.open(SCENE)[3])
    assert "title A walk" in run("info", tmp_path / "b.reel").out


def test_wrong_words_are_said(run, tmp_path):
    out = ("-o", tmp_path / "a.reel")
    assert failed(run("tag", SCENE, "title", *out), "'title': give NAME=VALUE")
    assert failed(run("cut", SCENE, "--frames", "1:2", "-o", tmp_path / "a.mesh"), "must end in .reel")
    assert failed(run("retime", SCENE, *out), "a frame rate or a speed")
    assert failed(run("cut", SCENE, "--frames", "99:", *out), "leave 0")


def test_a_first_view_is_tagged_and_told(run, tmp_path):
    view, out = "-0.5,1.6,3,0,1,0,50", ("-o", tmp_path / "a.reel")
    assert run("tag", SCENE, "--view", view, *out).code == 0
    said = run("info", tmp_path / "a.reel")
    assert "first view: from -0.5 1.6 3 to 0 1 0 m, 50 degrees" in said.out and "position" not in said.out
    assert run("info", tmp_path / "a.reel", "--json").row["view"]["fov"] == 50
    assert run("info", SCENE, "--json").row["view"] is None
    assert failed(run("tag", SCENE, "--view", "0,1,2", *out), "--view '0,1,2': give six numbers with commas")
    assert failed(run("tag", SCENE, "--view", "0,1,2,a,1,0", *out), "give six numbers")
    assert failed(run("tag", SCENE, "--view", "0,1,2,0,1,2", *out), "position and target are the same")
