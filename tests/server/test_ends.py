"""Ends of the server's process, whatever runs: real processes, which get signals."""

import json
import signal
import socket
import subprocess
import sys
import time

import pytest

pytest.importorskip("starlette", reason="the extra `play` is not installed")

PROMISED = 2.0  # s


def ask(port, request):
    line = socket.create_connection(("127.0.0.1", port), timeout=30)
    line.sendall(request)
    return line


def get(path):
    return f"GET {path} HTTP/1.1\r\nHost: localhost\r\n\r\n".encode()


@pytest.mark.clock
@pytest.mark.skipif(sys.platform == "win32", reason="no signals for one process on Windows")
@pytest.mark.parametrize("number, code", [(signal.SIGTERM, 143), (signal.SIGINT, 0)])
def test_a_signal_ends_the_process_whatever_its_clients_do(folder, number, code):
    with (folder / "big.reel").open("wb") as file:
        file.truncate(48 * 2**20)
    command = [sys.executable, "-m", "meshreel", "serve", str(folder), "--json"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        try:
            port = int(json.loads(process.stdout.readline())["addresses"][0].rstrip("/").rpartition(":")[2])
            requests = (b"", b"GET / HT", get("/gallery.css"), get("/files/big.reel"))
            lines = [ask(port, request) for request in requests]
            for line in lines[2:]:
                assert line.recv(9) == b"HTTP/1.1 "
            began = time.monotonic()
            process.send_signal(number)
            assert process.wait(20) == code and time.monotonic() - began < PROMISED
            assert "Traceback" not in process.stderr.read()
        finally:
            process.kill()
