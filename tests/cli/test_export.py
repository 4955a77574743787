"""`meshreel export`: one animated file, whole or not at all."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

import meshreel
from meshreel.cli import main
from tests.cli.conftest import FILE, SCENE, failed
from tests.colored_body import BODY, textured, written
from tests.golden import GOLDEN
from tests.play_glb import PlayedGlb

KINDS = ["glb", "usd", "usdc", "usda", "usdz"]


@pytest.fixture(autouse=True)
def has_usd():
    pytest.importorskip("pxr")


@pytest.mark.parametrize("kind", KINDS)
def test_the_extension_selects_the_format(run, tmp_path, kind):
    target = tmp_path / f"a.{kind.upper()}"
    row = run("export", FILE, "-o", target, "--json").row
    assert row.pop("bytes") == target.stat().st_size
    assert row == {"output": str(target), "format": kind, "frames": 10, "frame_rate": 25.0, "meshes": 3}


@pytest.mark.parametrize(("flag", "name"), [("--glb", "mixed.glb"), ("--usd", "mixed.usdc")])
def test_without_a_name_it_is_the_files_in_the_current_folder(run, tmp_path, monkeypatch, flag, name):
    monkeypatch.chdir(tmp_path)
    said = run("export", FILE, flag)
    size = (tmp_path / name).stat().st_size
    assert (said.code, said.out, said.err) == (0, f"{name}: 10 frames in 3 meshes, {size} bytes\n", "")
    assert [path.name for path in tmp_path.iterdir()] == [name]


def test_quiet_is_silent(run, tmp_path):
    said = run("export", FILE, "-o", tmp_path / "a.glb", "--quiet")
    assert (said.code, said.out, said.err) == (0, "", "")


def test_flags_reach_the_file(run, tmp_path):
    flags = ["--frames", "3:8", "--only", "moving", "--up", "-z", "--layers", "1"]
    assert run("export", SCENE, "-o", tmp_path / "a.glb", *flags, "--json").row["frames"] == 5
    played = PlayedGlb(tmp_path / "a.glb")
    assert set(played.shown(0)) == {"track_0", "track_1"}
    assert played.tree["nodes"][0]["matrix"][4:8] == [0, 0, 1, 0]  # +y goes to +z: -z is up
    ((mesh, _),) = played.shown(0)["track_0"]
    assert len(mesh.vertices) == len(meshreel.open(SCENE).at(1).parts(3)["track 0"].vertices)


def test_flags_that_contradict_each_other_are_errors(run, tmp_path):
    assert failed(run("export", FILE), "no format", "--glb")
    assert failed(run("export", FILE, "--glb", "--usd"), "--glb and --usd")
    assert failed(run("export", FILE, "--glb", "-o", tmp_path / "a.usdc"), "a.usdc", ".glb")
    assert failed(run("export", FILE, "--usd", "-o", tmp_path / "a.glb"), "a.glb", ".usdc")
    assert failed(run("export", FILE, "-o", tmp_path / "a.glb", "--frames", "7:7"), "7:7")
    assert failed(run("export", FILE, "-o", tmp_path / "a.glb", "--frames", "x"), "'x'")
    assert failed(run("export", FILE, "-o", tmp_path / "a.glb", "--only", "background"), "no background")
    assert failed(run("export", tmp_path / "none.reel", "--glb"), "none.reel")
    assert list(tmp_path.iterdir()) == []


def test_a_recording_is_not_replaced_by_what_it_is_exported_to(run, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    recording = Path("a.glb")
    recording.write_bytes(FILE.read_bytes())
    assert failed(run("export", recording, "--glb"), "a.glb", "the recording itself", "-o")
    os.link(recording, "b.glb")
    assert failed(run("export", recording, "-o", "b.glb"), "b.glb", "the recording itself")
    assert recording.read_bytes() == Path("b.glb").read_bytes() == FILE.read_bytes()
    assert run("export", recording, "-o", "c.glb").code == 0


def test_a_file_in_which_nothing_is_to_be_seen_is_a_warning(run, tmp_path):
    said = run("export", GOLDEN / "empty.reel", "-o", tmp_path / "a.glb")
    assert said.code == 0 and "no frame has a surface" in said.err


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (lambda data: data[:-1], ("chunk 3 (frames 9 to 9)", "nothing is written", "copy the file again")),
        (lambda data: data[:-200] + bytes(100) + data[-100:], ("chunk ", "damaged", "nothing is written")),
    ],
)
def test_a_file_that_is_no_whole_reel_is_reported_and_nothing_is_written(run, tmp_path, spoil, words, kind):
    (tmp_path / "a.reel").write_bytes(spoil(FILE.read_bytes()))
    said = run("export", tmp_path / "a.reel", "-o", tmp_path / f"a.{kind}")
    assert failed(said, str(tmp_path / "a.reel"), *words)
    assert [path.name for path in tmp_path.iterdir()] == ["a.reel"]


@pytest.mark.skipif(sys.platform == "win32", reason="POSIX limits")
@pytest.mark.parametrize(("kind", "late"), [*((kind, False) for kind in KINDS), ("usda", True), ("usdz", True)])
def test_a_full_disk_leaves_nothing_and_says_so(run, tmp_path, kind, late):
    """`late`: the crate still has room, not what is made of it."""
    run("export", FILE, "-o", tmp_path / "a.usdc")
    size = (tmp_path / "a.usdc").stat().st_size + 20 if late else 3000
    (tmp_path / "a.usdc").unlink()

    def prepare() -> None:
        import resource

        resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))

    command = [sys.executable, "-m", "meshreel", "export", FILE, "-o", tmp_path / f"a.{kind}"]
    environment = os.environ | {"PYTHONDONTWRITEBYTECODE": "1"}
    done = subprocess.run(command, capture_output=True, text=True, preexec_fn=prepare, env=environment)
    assert (done.returncode, done.stdout, done.stderr.count("\n")) == (2, "", 1), done.stderr
    assert f"a.{kind}: cannot be written" in done.stderr and "too large" in done.stderr and "free space" in done.stderr
    assert list(tmp_path.iterdir()) == []


def test_a_glb_needs_nothing_but_the_light_install(tmp_path):
    script = (
        "import sys; from meshreel.cli import main\n"
        "code = main(['export', sys.argv[1], '-o', sys.argv[2], '--quiet'])\n"
        "heavy = ('open3d', 'scipy', 'skimage', 'igl', 'matplotlib', 'trimesh', 'pxr', 'meshreel.encoder.sequence')\n"
        "print(code, [name for name in heavy if name in sys.modules])"
    )
    command = [sys.executable, "-c", script, str(FILE), str(tmp_path / "a.glb")]
    assert subprocess.run(command, capture_output=True, text=True, check=True).stdout == "0 []\n"


def test_without_usd_the_extra_is_named(run, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "pxr", None)
    assert failed(run("export", FILE, "-o", tmp_path / "a.usdc"), "pip install 'meshreel[usd]'")
    assert main(["export", str(FILE), "-o", str(tmp_path / "a.glb"), "--quiet"]) == 0


def test_a_texture_is_exported_where_it_is_asked_for(run, tmp_path):
    for name in ("av", "xatlas"):
        pytest.importorskip(name)
    file = written([textured(mesh) for mesh in BODY[:2]])
    for kind in ("glb", "usdc"):
        for flags in ([], ["--texture"]):
            said = run("export", file, "-o", tmp_path / f"a.{kind}", *flags)
            assert said.code == 0 and ("the texture of its first frame" in said.err) == (kind == "glb" and bool(flags))
            assert (tmp_path / "a_textures").exists() == (kind == "usdc" and bool(flags))
            if kind == "glb":
                assert len(PlayedGlb(tmp_path / "a.glb").tree.get("images", [])) == len(flags)
    assert "has no textures" in run("export", FILE, "-o", tmp_path / "b.glb", "--texture").err
    assert [path.name for path in sorted((tmp_path / "a_textures").iterdir())] == [
        "track_0_00000.png",
        "track_0_00001.png",
    ]
