"""Ends of the server's process, whatever runs: real processes, which get signals."""

from __future__ import annotations

import json
import signal
import socket
import subprocess
import sys
import time

import pytest

pytest.importorskip("starlette", reason="the extra `play` is not installed")

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="no signals for one process on Windows")

PROMISED = 2.0  # s
HANGS = """
import os, pathlib, re
def poster(path):
    pathlib.Path(path).with_suffix(".pid").write_text(str(os.getpid()))
    re.match("(a+)+$", "a" * 64 + "b")  # in one call, which lets no other thread run
"""
SERVE = """
import sys, time
from meshreel.cli import main
from meshreel.server import files, posters
posters.PAINTER = (sys.executable, "-P", "-c", sys.argv[1])
if sys.argv[3]:
    files.OpenFile.read = lambda self, piece: time.sleep(60)
sys.exit(main(["serve", sys.argv[2], "--json"]))
"""


@pytest.fixture
def serve(folder):
    """Starts a server whose painter hangs, and on request whose file system does; gives its process and its port."""
    with (folder / "big.reel").open("wb") as file:
        file.truncate(48 * 2**20)
    started = []

    def start(is_hung=False):
        painter = (
            f"import sys\nsys.modules['meshreel.metrics.render'] = None\nfrom meshreel.server import painter\n{HANGS}"
        )
        painter += "painter.poster = poster\npainter.main()\n"
        command = [sys.executable, "-c", SERVE, painter, str(folder), "hung" if is_hung else ""]
        process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        started.append(process)
        address = json.loads(process.stdout.readline())["addresses"][0]
        return process, int(address.rstrip("/").rpartition(":")[2])

    yield start
    for process in started:
        process.kill()
        process.communicate()


def ask(port, request):
    line = socket.create_connection(("127.0.0.1", port), timeout=30)
    line.sendall(request)
    return line


def get(path):
    return f"GET {path} HTTP/1.1\r\nHost: localhost\r\n\r\n".encode()


def busy(port, folder):
    """Connections of all kinds, and the number of the process that draws a poster and will never end."""
    lines = [ask(port, request) for request in (b"", b"GET / HT", get("/style.css"), get("/files/big.reel"))]
    for line in lines[2:]:
        assert line.recv(9) == b"HTTP/1.1 "
    lines.append(ask(port, get("/posters/walk.reel.png")))
    return lines, painter_of(folder)


def painter_of(folder):
    until = time.monotonic() + 30
    while time.monotonic() < until:
        try:
            return int((folder / "walk.pid").read_text())
        except (OSError, ValueError):
            time.sleep(0.02)
    raise AssertionError("the painter does not start")


def is_alive(pid):
    """Whether a process runs; one that waits to be counted does not."""
    state = subprocess.run(["ps", "-o", "stat=", "-p", str(pid)], capture_output=True, text=True).stdout.strip()
    return not state.startswith("Z") and state != ""


def seconds_until(ended, began):
    """Seconds until something is so, at most 20."""
    while not ended() and time.monotonic() - began < 20:
        time.sleep(0.03)
    return time.monotonic() - began


@pytest.mark.parametrize("number, code", [(signal.SIGTERM, 143), (signal.SIGINT, 0)])
def test_a_signal_ends_the_process_whatever_its_clients_do(serve, folder, number, code):
    process, port = serve()
    lines, painter = busy(port, folder)
    began = time.monotonic()
    process.send_signal(number)
    assert seconds_until(lambda: process.poll() is not None, began) < PROMISED
    assert seconds_until(lambda: not is_alive(painter), began) < PROMISED
    assert process.returncode == code and "Traceback" not in process.stderr.read()
    assert len(lines) == 5


@pytest.mark.parametrize("number, code", [(signal.SIGTERM, 143), (signal.SIGINT, 0)])
def test_a_signal_ends_the_process_even_if_a_thread_never_returns(serve, number, code):
    process, port = serve(is_hung=True)
    with ask(port, get("/files/big.reel")) as line:
        assert line.recv(9) == b"HTTP/1.1 "
        began = time.monotonic()
        process.send_signal(number)
        assert seconds_until(lambda: process.poll() is not None, began) < PROMISED
    assert process.returncode == code


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere its alarm ends the painter, after 11 s")
def test_a_killed_server_leaves_no_painter_behind(serve, folder):
    process, port = serve()
    lines, painter = busy(port, folder)
    process.kill()
    assert seconds_until(lambda: not is_alive(painter), time.monotonic()) < PROMISED
    assert len(lines) == 5
