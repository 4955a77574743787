"""`meshreel play` and `meshreel serve`: real processes, asked over HTTP and stopped."""

import json
import signal
import subprocess
import sys
import threading
import urllib.request

import pytest

pytest.importorskip("starlette", reason="the extra `play` is not installed")

import meshreel
from meshreel.cli import main
from meshreel.cli.console import Common
from meshreel.io.write import write_mesh
from tests.cli.conftest import failed
from tests.golden import GOLDEN
from tests.spheres import sliding_sphere

FILE = GOLDEN / "scene.reel"
needs_signals = pytest.mark.skipif(sys.platform == "win32", reason="no SIGINT for one process on Windows")


def fetch(address: str, **headers: str) -> bytes:
    with urllib.request.urlopen(urllib.request.Request(address, headers=headers), timeout=60) as answer:
        return answer.read()


@pytest.fixture
def started():
    """Starts a command and gives its process and the address that it told."""
    processes = []

    def start(*arguments: str) -> tuple[subprocess.Popen[str], str]:
        command = [sys.executable, "-m", "meshreel", *arguments, "--json"]
        pipe = subprocess.PIPE
        process = subprocess.Popen(command, stdout=pipe, stderr=pipe, text=True)
        processes.append(process)
        line = process.stdout.readline()
        assert line, process.stderr.read()
        return process, json.loads(line)["addresses"][0]

    yield start
    for process in processes:
        process.kill()
        process.communicate()


@needs_signals
@pytest.mark.parametrize("number, code", [(signal.SIGINT, 0), (signal.SIGTERM, 143)])
def test_play_serves_page_player_and_ranges_until_it_is_stopped(started, number, code):
    process, address = started("play", str(FILE), "--no-browser")
    page = fetch(address).decode()
    assert '<meshreel-player src="/files/scene.reel"' in page
    assert fetch(f"{address}player/core.wasm")[:4] == b"\0asm"
    assert fetch(f"{address}files/scene.reel", Range="bytes=0-7") == FILE.read_bytes()[:8]
    process.send_signal(number)
    out, err = process.communicate(timeout=60)
    assert process.returncode == code and out == ""
    assert "Traceback" not in err


@needs_signals
def test_a_folder_of_meshes_is_encoded_for_its_play_alone(started, tmp_path):
    folder = tmp_path / "ball"
    folder.mkdir()
    for number, ball in enumerate(sliding_sphere(3, levels=2)):
        write_mesh(ball, folder / f"ball_{number}.ply")
    process, address = started("play", str(folder), "--no-browser")
    with meshreel.open(fetch(f"{address}files/ball.reel")) as video:
        assert len(video) == 3
    process.send_signal(signal.SIGINT)
    _, err = process.communicate(timeout=60)
    assert process.returncode == 0 and f"encode {folder} -o ball.reel" in err
    assert [path.name for path in tmp_path.iterdir()] == ["ball"] and not [*folder.glob("*.reel")]


@needs_signals
def test_serve_shows_what_is_in_the_folder_now(started, tmp_path):
    process, address = started("serve", str(tmp_path))
    assert "This folder has no .reel files" in fetch(address).decode()
    (tmp_path / "new.reel").write_bytes(FILE.read_bytes())
    assert "new" in fetch(address).decode()
    process.send_signal(signal.SIGINT)
    process.communicate(timeout=60)
    assert process.returncode == 0


def test_what_cannot_be_played_is_reported_before_anything_is_served(run, tmp_path):
    damaged = tmp_path / "damaged.reel"
    damaged.write_bytes(b"nothing")
    assert failed(run("play", damaged, "--no-browser"), "damaged.reel", "not a .reel file")
    assert failed(run("play", tmp_path / "absent.reel", "--no-browser"), "absent.reel")
    (tmp_path / "ball.ply").write_text("ply")
    assert failed(run("play", tmp_path / "ball.ply"), "encode it first", "ball.reel")
    (tmp_path / "reels").mkdir()
    (tmp_path / "reels" / "scene.reel").write_bytes(FILE.read_bytes())
    assert failed(run("play", tmp_path / "reels"), "0 mesh files", f"serve {tmp_path / 'reels'}")
    assert failed(run("serve", FILE), "no folder")
    assert failed(run("play", FILE, "--no-browser", "--port", "99999"), "--port 99999")


def test_without_the_extra_the_error_names_it():
    hidden = "import sys; sys.modules['uvicorn'] = None; from meshreel.cli import main; main()"
    command = [sys.executable, "-c", hidden, "play", str(FILE), "--no-browser"]
    said = subprocess.run(command, capture_output=True, text=True)
    assert said.returncode == 2 and "pip install 'meshreel[play]'" in said.stderr


@needs_signals
def test_a_download_that_is_under_way_does_not_hold_up_the_end(started, tmp_path):
    with (tmp_path / "big.reel").open("wb") as file:
        file.truncate(256 * 2**20)
    process, address = started("serve", str(tmp_path))
    with urllib.request.urlopen(f"{address}files/big.reel", timeout=60) as answer:  # and is not read on
        assert len(answer.read(1000)) == 1000
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=30)
    assert (process.returncode, out, err) == (0, "", "")


@pytest.fixture
def told_once(monkeypatch):
    """`play` ends as soon as it has told its address."""
    monkeypatch.setattr("meshreel.cli.serve.run", lambda _app, _options, tell: tell(["http://127.0.0.1:1/"]))


@pytest.mark.usefixtures("told_once")
def test_a_browser_that_stays_open_holds_nothing_up(run, monkeypatch):
    opened, go_on = threading.Event(), threading.Event()
    monkeypatch.setattr("webbrowser.open", lambda _: opened.set() or go_on.wait(60))
    try:
        assert run("play", FILE).code == 0
        assert opened.wait(60) and not go_on.is_set()
    finally:
        go_on.set()


@pytest.mark.usefixtures("told_once")
def test_where_no_browser_is_found_the_address_is_reported_again(monkeypatch):
    notes: list[str] = []
    heard = threading.Event()
    monkeypatch.setattr("webbrowser.open", lambda _: False)
    monkeypatch.setattr(Common, "note", lambda _, text: notes.append(text) or heard.set())
    assert main(["play", str(FILE)]) == 0
    assert heard.wait(60) and notes == ["no browser was found: open http://127.0.0.1:1/"]


def test_an_origin_with_a_path_is_reported(run, tmp_path):
    assert failed(run("serve", tmp_path, "--cors", "https://example.org/"), "--cors 'https://example.org/'")


@needs_signals
def test_without_a_file_a_small_sample_plays(started):
    process, address = started("play", "--no-browser")
    data = fetch(f"{address}files/sample.reel")
    with meshreel.open(data) as video:
        assert len(video) >= 20 and len(video.tracks) == 2 and video.view is not None
    assert len(data) <= 250_000
    process.send_signal(signal.SIGINT)
    process.communicate(timeout=60)
    assert process.returncode == 0
