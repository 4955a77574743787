"""`meshreel segment`: labels as NumPy files, previews, and pictures for tools that make masks."""

import json
import shutil

import numpy as np
import pytest
from PIL import Image

from meshreel.io.sequence import open_sequence
from tests.cli.conftest import failed
from tests.small_scene import ROOM_FACES

pytestmark = pytest.mark.usefixtures("quick_presets")


def labels(folder, number):
    with np.load(folder / "labels" / f"frame_{number:05}.npz") as archive:
        return archive["moving"], archive["bodies"]


def test_each_frame_has_labels_and_bodies_keep_their_numbers(run, scan, tmp_path):
    said = run("segment", scan, "-o", tmp_path / "out", "--json")
    assert said.code == 0
    frames = open_sequence(scan)
    for number, mesh in enumerate(frames):
        moving, bodies = labels(tmp_path / "out", number)
        assert moving.shape == bodies.shape == (len(mesh.faces),)
        assert moving[ROOM_FACES:].all() and not moving[:ROOM_FACES].any()
        assert np.array_equal(moving, bodies > 0)
        half = (len(mesh.faces) - ROOM_FACES) // 2
        first, second = np.unique(bodies[ROOM_FACES : ROOM_FACES + half]), np.unique(bodies[ROOM_FACES + half :])
        assert {first.item(), second.item()} == {1, 2}
        assert first.item() == labels(tmp_path / "out", 0)[1][ROOM_FACES]
    assert said.row["moving_share"] == pytest.approx(256 / (ROOM_FACES + 256))
    assert said.row["bodies"] == [{"body": number, "frames": 4, "faces": 128} for number in (1, 2)]


def test_the_sheet_the_cameras_and_the_colored_frames_are_beside_them(run, scan, tmp_path):
    out = tmp_path / "out"
    said = run("segment", scan, "-o", out, "--previews", "2")
    assert said.code == 0 and "2 bodies (1 in 4 frames, 128 faces; 2 in 4 frames, 128 faces)" in said.out
    assert sorted(path.name for path in (out / "colored").iterdir()) == ["frame_00000.ply", "frame_00003.ply"]
    shown = open_sequence(out / "colored")[1]
    assert len(shown.faces) == ROOM_FACES + 256
    with Image.open(out / "sheet.png") as sheet:
        assert sheet.size == (64 + 4 * 124, 24 + 2 * 94 + 24)
        colors = np.array(sheet).reshape(-1, 3).astype(int)
    assert (colors[:, 0] > 2 * colors[:, 2]).any() and (colors[:, 2] > 2 * colors[:, 0]).any()  # red and blue balls
    assert len(json.loads((out / "cameras.json").read_text())["parameters"]) == 6
    assert run("segment", scan, "-o", tmp_path / "bare", "--previews", "0", "--quiet").code == 0
    assert sorted(path.name for path in (tmp_path / "bare").iterdir()) == ["cameras.json", "labels"]


def test_pictures_for_other_tools_are_laid_out_as_masks_are_read(run, scan, tmp_path):
    out = tmp_path / "out"
    said = run("segment", scan, "-o", out, "--views-only", "--frames", "1:3")
    assert said.code == 0 and "pictures of 2 frames from 6 views" in said.out
    assert sorted(path.name for path in out.iterdir()) == ["cameras.json", *(f"view{k:02}" for k in range(6))]
    said = run("segment", scan, "-o", tmp_path / "labels", "--frames", "1:3", "--masks", out)
    assert failed(said, "frame_00000.png: a mask of mode RGB", "8-bit gray PNG")  # the pictures themselves
    for picture in out.glob("view*/*.png"):
        Image.fromarray(np.zeros((90, 120), np.uint8)).save(picture)  # a tool that sees nothing move
    said = run("segment", scan, "-o", tmp_path / "labels", "--frames", "1:3", "--masks", out, "--json")
    assert said.row["moving"] == 0 and said.row["bodies"] == []


def test_masks_move_the_faces_that_they_show(run, scan, painted, tmp_path):
    assert run("segment", scan, "-o", tmp_path / "out", "--masks", painted, "--quiet").code == 0
    for number in range(4):
        moving, _ = labels(tmp_path / "out", number)
        assert moving[ROOM_FACES:].mean() > 0.95 and moving[:ROOM_FACES].mean() < 0.01


def test_masks_that_were_painted_in_place_are_not_replaced_by_pictures(run, scan, painted, tmp_path):
    shutil.copytree(painted, tmp_path / "painted")
    mask = tmp_path / "painted" / "view00" / "frame_00000.png"
    before = mask.read_bytes()
    said = run("segment", scan, "-o", tmp_path / "painted", "--views-only")
    assert failed(said, "view00/frame_00000.png and 23 others are masks", "choose another folder")
    assert mask.read_bytes() == before


def test_what_is_left_of_a_run_before_is_reported(run, scan, tmp_path):
    out = tmp_path / "out"
    assert run("segment", scan, "-o", out, "--previews", "2").err == ""
    assert failed(run("segment", scan, "-o", out, "--previews", "2"), "there already", "--force")  # the same again
    said = run("segment", scan, "-o", out, "--previews", "1", "--frames", "1:3", "--json", "--force")
    assert [line.split("; ")[0].removeprefix(str(out)) for line in said.row["warnings"]] == [
        "/labels holds 2 other frame files, as frame_00002.npz",
        "/colored holds 1 other frame files, as frame_00003.ply",
    ]
    assert run("segment", scan, "-o", tmp_path / "views", "--views-only").err == ""
    said = run("segment", scan, "-o", tmp_path / "views", "--views-only", "--frames", ":3", "--json", "--force")
    assert len(said.row["warnings"]) == 6 and "view00 holds 1 other frame files" in said.row["warnings"][0]


def test_given_cameras_are_looked_from(run, scan, painted, tmp_path):
    record = json.loads((painted / "cameras.json").read_text())
    record["parameters"] = record["parameters"][:2]
    (tmp_path / "two.json").write_text(json.dumps(record))
    said = run("segment", scan, "-o", tmp_path / "out", "--views-only", "--views", tmp_path / "two.json", "--json")
    assert said.row["views"] == 2
    assert json.loads((tmp_path / "out" / "cameras.json").read_text()) == record


def test_a_rig_is_an_input(run, rig, tmp_path):
    said = run("segment", rig, "-o", tmp_path / "out", "--json", "--previews", "1")
    assert said.code == 0 and said.row["frames"] == 3 and said.row["faces"] > 10_000
    (rig / "left" / "depth" / "depth_00001.png").unlink()
    said = run("segment", rig, "-o", tmp_path / "pictures", "--views-only", "--frames", "1:2")
    assert said.code == 0 and "camera left lacks 1 of 3 frames" in said.err


def test_the_pictures_of_a_rig_s_colour_cameras_are_those_for_masks(run, rig, tmp_path):
    record = json.loads((rig / "rig.json").read_text())
    left = next(entry for entry in record["cameras"] if entry["name"] == "left")
    left["color"] = "left/color"
    (rig / "rig.json").write_text(json.dumps(record))
    (rig / "left" / "color").mkdir()
    for number in range(3):
        pixels = np.full((left["height"], left["width"], 3), 40 * number, np.uint8)
        Image.fromarray(pixels).save(rig / "left" / "color" / f"color_{number:05}.png")
    said = run("segment", rig, "-o", tmp_path / "out", "--views-only", "--json")
    assert said.code == 0 and said.row["views"] == 1
    assert (np.asarray(Image.open(tmp_path / "out" / "view00" / "frame_00002.png")) == 80).all()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--previews", "-1"], ["--previews -1", "0 to 16"]),
        (["--previews", "17"], ["--previews 17"]),
        (["--views-only", "--masks", "masks"], ["--views-only", "leave out"]),
        (["--masks", "masks", "--sam3", "weights"], ["--masks masks", "--sam3 weights", "one of both"]),
        (["--masks", "masks", "--views", "c.json"], ["--views c.json", "cameras of their own"]),
        (["--prompts", "person"], ["--prompts", "give --sam3"]),
        (["--device", "cuda"], ["--device", "give --sam3"]),
        (["--prompt-by", "motion"], ["--prompt-by", "give --sam3"]),
        (["--sam3", "w", "--prompt-by", "motion", "--prompts", "person"], ["--prompt-by motion needs none"]),
        (["--sam3", "weights"], ["weights: holds no weights of SAM3", "config.json"]),
        (["--views", "none.json"], ["none.json", "cannot be read"]),
        (["--views", "bad.json"], ["bad.json", "pinhole camera JSON"]),
        (["--up", "x"], ["x"]),
    ],
)
def test_impossible_flags_are_errors(run, scan, tmp_path, arguments, words, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "bad.json").write_text("{}")
    (tmp_path / "weights").mkdir()
    assert failed(run("segment", scan, "-o", "out", *arguments), *words)
    assert not (tmp_path / "out").exists()


def test_the_help_says_how_labels_are_read(run):
    told = " ".join(run("segment", "--help").out.replace("│", " ").split())
    assert 'np.load(file)["moving"]' in told and "--masks" in told and "--empty-prompts" not in told
