"""Files that no argument names are never replaced without a word: not in a folder, and not beside an output."""

import json
from pathlib import Path

import pytest

from tests.cli.conftest import failed
from tests.golden import GOLDEN

TEXTURES, SPLATS = GOLDEN / "colored/textures.reel", GOLDEN / "splats/splats.reel"
COMMANDS = {  # and a file that they would replace
    "meshes": (("decode", TEXTURES, "-o", "out"), "out/frame_00003.ply"),
    "pictures": (("decode", TEXTURES, "-o", "out", "--format", "obj"), "out/frame_00000.png"),
    "materials": (("decode", TEXTURES, "-o", "out", "--format", "obj"), "out/frame_00001.mtl"),
    "splats": (("decode", SPLATS, "-o", "out", "--splats"), "out/frame_00002.ply"),
    "export": (("export", TEXTURES, "--glb"), "textures.glb"),
    "textures": (("export", TEXTURES, "-o", "a.usdc", "--texture"), "a_textures/track_0_00000.png"),
    "player": (("player", "--copy-to", "out"), "out/index.html"),
}


@pytest.mark.parametrize(("arguments", "name"), COMMANDS.values(), ids=COMMANDS)
def test_a_file_that_was_not_named_is_kept_until_force_is_given(run, tmp_path, monkeypatch, arguments, name):
    pytest.importorskip("av", reason="textures need the extra color")
    monkeypatch.chdir(tmp_path)
    (precious := tmp_path / name).parent.mkdir(exist_ok=True)
    precious.write_bytes(b"mine")
    before = sorted(tmp_path.rglob("*"))
    assert failed(run(*arguments), name, "--force")
    assert precious.read_bytes() == b"mine" and sorted(tmp_path.rglob("*")) == before
    assert run(*arguments, "--force").code == 0
    assert precious.read_bytes() != b"mine" or name.endswith("track_0_00000.png")
    assert failed(run(*arguments), "there already", "--force")  # the same again: they are of a run before, not named


def test_a_named_file_is_replaced(run, tmp_path):
    for _ in range(2):
        assert run("export", TEXTURES, "-o", tmp_path / "a.glb").code == 0
        assert run("cut", TEXTURES, "-o", tmp_path / "a.reel", "--frames", "1:").code == 0


@pytest.mark.parametrize(("flags", "name"), [(("-o", "new.json"), "new.png"), (("--in-place",), "rig.before.json")])
def test_pictures_and_rigs_beside_a_calibration_are_kept(run, tmp_path, monkeypatch, flags, name):
    monkeypatch.chdir(tmp_path)
    Path("rig").mkdir()
    Path("rig/rig.json").write_text(json.dumps({}))
    precious = Path("rig" if "before" in name else "", name)
    precious.write_bytes(b"mine")
    assert failed(run("calibrate", "rig", *flags), str(precious), "--force")
    assert precious.read_bytes() == b"mine"


@pytest.mark.parametrize("name", ["labels/frame_00001.npz", "colored/frame_00000.ply", "sheet.png", "cameras.json"])
def test_labels_that_are_there_are_kept(run, scan, tmp_path, name):
    (precious := tmp_path / "out" / name).parent.mkdir(parents=True)
    precious.write_bytes(b"mine")
    assert failed(run("segment", scan, "-o", tmp_path / "out"), name, "--force")
    assert precious.read_bytes() == b"mine"


def test_files_of_a_folder_that_is_of_no_demo_are_kept(run, tmp_path):
    (tmp_path / "demo.png").write_bytes(b"mine")
    assert failed(run("demo", "-o", tmp_path, "--frames", "2"), "demo.png", "--force")


@pytest.mark.parametrize("splats", [(), ("--splats",)])
def test_force_does_not_replace_the_input(run, tmp_path, splats):
    (tmp_path / "out").mkdir()
    recording = tmp_path / "out" / "frame_00000.ply"
    recording.write_bytes(SPLATS.read_bytes())
    assert failed(run("decode", recording, "-o", tmp_path / "out", "--force", *splats), "frame_00000.ply", "the input")
    assert recording.read_bytes() == SPLATS.read_bytes()
