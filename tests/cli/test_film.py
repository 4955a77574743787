"""`meshreel export` of films: what flags mean, and what is said; whole or not at all."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

import meshreel
from meshreel.edit.edits import tag
from tests.cli.conftest import SCENE, failed
from tests.golden import GOLDEN
from tests.tones import tone

av = pytest.importorskip("av", reason="films need the extra color")
Image = pytest.importorskip("PIL.Image")

FILE = GOLDEN / "colored/vertices.reel"
SMALL = ("--size", "64x48")
COMMAND = [sys.executable, "-m", "meshreel", "export", FILE]


@pytest.mark.parametrize("kind", ["mp4", "webm", "gif"])
def test_a_flag_selects_the_format_and_the_files_name_is_the_recordings(run, tmp_path, monkeypatch, kind):
    monkeypatch.chdir(tmp_path)
    said = run("export", FILE, f"--{kind}", *SMALL, "--frames", ":2", "--json")
    assert said.row == {
        "output": f"vertices.{kind}",
        "format": kind,
        "bytes": Path(f"vertices.{kind}").stat().st_size,
        "pictures": 2,
    }
    assert [path.name for path in tmp_path.iterdir()] == [f"vertices.{kind}"] and said.err == ""


def test_flags_reach_the_pictures(run, tmp_path):
    out = tmp_path / "a.png"
    run("export", SCENE, "-o", out, *SMALL, "--background", "#0a141e", "--only", "moving")
    moving = np.asarray(Image.open(out))
    assert moving.shape == (48, 64, 3) and tuple(moving[0, 0]) == (10, 20, 30)
    run("export", SCENE, "-o", out, *SMALL, "--background", "transparent", "--only", "moving")
    assert np.asarray(Image.open(out)).shape == (48, 64, 4)
    run(
        "export", SCENE, "-o", out, *SMALL, "--background", "#0a141e", "--only", "moving", "--up", "-z", "--layers", "0"
    )
    assert (np.asarray(Image.open(out)) != moving).any()
    row = run(
        "export", FILE, "-o", tmp_path / "a.gif", *SMALL, "--turntable", "--seconds", "1", "--fps", "7", "--json"
    ).row
    assert row["pictures"] == 7


def test_a_view_is_in_the_unit_and_axes_of_the_frames(run, tmp_path):
    with meshreel.open(FILE) as video:
        target = np.mean(video.box, axis=0)
        far = target + [0, 0, 6 * np.ptp(video.box, axis=0).max()]
    view, seen = ",".join(f"{number:.6f}" for number in (*far, *target)), []
    for degrees in ("", ",22"):
        out = ("-o", tmp_path / "a.png", *SMALL, "--background", "transparent")
        assert run("export", FILE, *out, "--view", view + degrees).code == 0
        rows, columns = np.nonzero(np.asarray(Image.open(tmp_path / "a.png"))[..., 3] > 204)  # no shadow is so dark
        assert abs(rows.mean() - 23.5) < 2 and abs(columns.mean() - 31.5) < 2
        seen.append(len(rows))
    assert 3 * seen[0] < seen[1] < 6 * seen[0]


def test_a_film_begins_with_the_first_view_of_its_file(run, tmp_path):
    view, pictures = "1000000.2,-2,4,1000000,-2.5,0,30", []
    assert run("tag", FILE, "--view", view, "-o", tmp_path / "viewed.reel").code == 0
    for file, flags in ((tmp_path / "viewed.reel", ()), (FILE, ("--view", view)), (FILE, ())):
        assert run("export", file, "-o", tmp_path / "a.png", *SMALL, *flags).code == 0
        pictures.append(np.asarray(Image.open(tmp_path / "a.png")).astype(int))
    assert np.abs(pictures[0] - pictures[1]).mean() < 0.1 < np.abs(pictures[0] - pictures[2]).mean()


def test_what_cannot_be_understood_is_an_error_that_says_what_to_give(run, tmp_path):
    out = ("export", FILE, "-o", tmp_path / "a.gif")
    assert failed(run(*out, "--size", "64"), "--size 64", "1280x720")
    assert failed(run(*out, "--size", "9x9"), "9 pixels", "16 to 8192")
    assert failed(run(*out, "--background", "dusk"), "--background dusk", "transparent")
    assert failed(run(*out, "--view", "1,2,3"), "--view '1,2,3'", "six numbers")
    assert failed(run(*out, "--view", "-1,2,3,-1,2,3"), "both places are one")
    assert failed(run(*out, "--view", "0,0,1,0,0,0,180"), "degrees")
    assert failed(run(*out, "--fps", "0"), "0 pictures a second", "above 0")
    assert failed(run(*out, "--texture"), "--texture", "GLB and USD")
    assert failed(run("export", FILE, "-o", tmp_path / "a.glb", "--size", "64x48"), "--size", "a.glb", ".mp4")
    assert failed(run("export", FILE, "--mp4", "--gif"), "--mp4 and --gif")
    assert failed(run("export", FILE, "--mp4", "-o", tmp_path / "a.webm"), "a.webm", ".mp4")
    assert failed(
        run("export", FILE, "-o", tmp_path / "a.mp4", *SMALL, "--background", "transparent"), "a.mp4", ".webm"
    )
    assert list(tmp_path.iterdir()) == []


def test_what_a_film_lacks_is_told(run, tmp_path):
    tag(FILE, tmp_path / "heard.reel", audio=tone(0.5))
    heard = ("export", tmp_path / "heard.reel", *SMALL, "--frames", ":2", "-o")
    assert "audio" in run(*heard, tmp_path / "a.gif").err and run(*heard, tmp_path / "a.webm").err == ""
    said = run("export", GOLDEN / "splats/splats.reel", *SMALL, "--frames", ":1", "-o", tmp_path / "a.png")
    assert said.code == 0 and said.err == ""


def test_without_pyav_the_extra_is_named(run, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "av", None)
    assert failed(run("export", FILE, "-o", tmp_path / "a.mp4"), "pip install 'meshreel[color]'")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("kind", ["mp4", "webm", "gif"])
def test_a_damaged_file_leaves_nothing(run, tmp_path, kind):
    data = bytearray(FILE.read_bytes())
    data[-150] ^= 1
    (tmp_path / "b.reel").write_bytes(data)
    assert failed(
        run("export", tmp_path / "b.reel", "-o", tmp_path / f"a.{kind}", *SMALL), "b.reel", "nothing is written"
    )
    assert [path.name for path in tmp_path.iterdir()] == ["b.reel"]


@pytest.mark.skipif(sys.platform == "win32", reason="POSIX limits")
@pytest.mark.parametrize("kind", ["mp4", "webm", "gif"])
def test_a_full_disk_leaves_nothing_and_says_so(tmp_path, kind):
    def prepare() -> None:
        import resource

        resource.setrlimit(resource.RLIMIT_FSIZE, (1500, 1500))

    environment = os.environ | {"PYTHONDONTWRITEBYTECODE": "1"}
    command = [*COMMAND, "-o", tmp_path / f"a.{kind}", *SMALL]
    done = subprocess.run(command, capture_output=True, text=True, preexec_fn=prepare, env=environment)
    assert (done.returncode, done.stdout, done.stderr.count("\n")) == (2, "", 1), done.stderr
    assert f"a.{kind}: cannot be written" in done.stderr and "free space" in done.stderr
    assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif(sys.platform == "win32", reason="POSIX signals")
def test_a_killed_export_leaves_the_old_film_and_the_next_one_takes_over(run, tmp_path):
    target = tmp_path / "a.gif"
    target.write_bytes(b"old")
    killed = subprocess.Popen([*COMMAND, "-o", target, "--seconds", "1000"], stderr=subprocess.DEVNULL)
    while not (tmp_path / ".a.gif.part").exists() and killed.poll() is None:
        time.sleep(0.02)
    killed.send_signal(signal.SIGKILL)
    killed.wait()
    assert target.read_bytes() == b"old"
    assert run("export", FILE, "-o", target, *SMALL, "--frames", ":2").code == 0
    assert [path.name for path in tmp_path.iterdir()] == ["a.gif"] and target.read_bytes()[:3] == b"GIF"
