"""Limits of connections: slow and silent clients, too many of them, and clients that send what is no HTTP."""

from __future__ import annotations

import logging
import re
import socket
import ssl
import sys
import time
from http.client import HTTPResponse
from pathlib import Path

import pytest

from meshreel.server import painter, posters
from meshreel.server.app import make_app
from meshreel.server.connections import Connection, Limits, room_for_files
from meshreel.server.library import Library
from meshreel.server.run import ServerOptions

ROOT = Path(__file__).resolve().parents[2]
SHORT = Limits(request=0.6, stall=0.6)
HEAD = b"Host: localhost\r\n\r\n"
BIG = b"GET /files/big.reel HTTP/1.1\r\n" + HEAD


@pytest.fixture
def port(live, folder, player):
    """Serves with short limits and gives the port."""
    with (folder / "big.reel").open("wb") as file:
        file.truncate(48 * 2**20)
    return port_of(live(make_app(Library(folder), player), limits=SHORT))


def port_of(address):
    return int(address.rstrip("/").rpartition(":")[2])


def connect(port, buffer=None):
    line = socket.socket()
    line.settimeout(10)
    if buffer:
        line.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, buffer)
    line.connect(("127.0.0.1", port))
    return line


def received(line, piece=2**20, pause=0.0):
    """Number of bytes until the connection ends, at `piece` bytes for each pause."""
    count = 0
    try:
        while data := line.recv(piece):
            count += len(data)
            time.sleep(pause)
    except ConnectionError:
        pass
    return count


def drips(line, data):
    """Send a byte every 50 ms; return the seconds until the server has closed the connection, at most 5."""
    began = time.monotonic()
    line.setblocking(False)
    try:
        for byte in data * 100:
            line.send(bytes([byte]))
            time.sleep(0.05)
            try:
                if line.recv(2**16) == b"":
                    break
            except BlockingIOError:
                pass
            if time.monotonic() - began > 5:
                break
    except ConnectionError:
        pass
    return time.monotonic() - began


@pytest.mark.parametrize(
    "begin, data",
    [(b"", b"GET / HTTP/1.1\r\nX: "), (b"GET / HTTP/1.1\r\n" + HEAD, b"GET / HTTP/1.1\r\nX: ")]
    + [(b"POST / HTTP/1.1\r\nContent-Length: 99999\r\n" + HEAD, b"body")],
    ids=["head", "second head", "body that nobody reads"],
)
def test_a_client_that_sends_byte_after_byte_is_cut_off(port, begin, data):
    with connect(port) as line:
        line.sendall(begin)
        assert 0.3 < drips(line, data) < 3


@pytest.mark.parametrize("begin", [b"", b"GET /style.css HTTP/1.1\r\n" + HEAD, b"GET / HTTP/1.1\r\nHo"])
def test_a_client_that_falls_silent_is_cut_off(port, begin):
    with connect(port) as line:
        line.sendall(begin)
        began = time.monotonic()
        received(line)
        assert 0.3 < time.monotonic() - began < 3


def test_a_client_of_https_that_never_shakes_hands_is_cut_off(live, folder, player):
    with connect(port_of(live(make_app(Library(folder), player), ServerOptions(https=True), SHORT))) as line:
        assert received(line) == 0


@pytest.mark.parametrize("head", [BIG, BIG.replace(b"Host", b"Connection: close\r\nHost")])
@pytest.mark.parametrize("https", [False, True])
def test_a_client_that_stops_reading_is_cut_off(live, folder, player, head, https):
    with (folder / "big.reel").open("wb") as file:
        file.truncate(48 * 2**20)
    with connect(port_of(live(make_app(Library(folder), player), ServerOptions(https=https), SHORT)), 4096) as line:
        if https:
            line = ssl._create_unverified_context().wrap_socket(line)
        line.sendall(head)
        time.sleep(2.5)
        assert [server.server_state.connections for server in live.servers] == [set()]


def test_a_client_that_reads_slowly_gets_all(live, folder, player):
    with (folder / "big.reel").open("wb") as file:
        file.truncate(2 * 2**20)
    with connect(port_of(live(make_app(Library(folder), player), limits=SHORT)), 4096) as line:
        line.sendall(BIG.replace(b"Host", b"Connection: close\r\nHost"))
        assert received(line, 2**15, 0.004) > 2 * 2**20


def answer_of(line, request=b"GET /style.css HTTP/1.1\r\n" + HEAD):
    """Head of the answer to a request, whose body is read, too."""
    line.sendall(request)
    answer = HTTPResponse(line)
    answer.begin()
    answer.read()
    return answer


def test_clients_beyond_the_limit_are_told_so_and_those_before_are_served(live, folder, player):
    port = port_of(live(make_app(Library(folder), player), limits=Limits(connections=2, refused=1)))
    first, second = connect(port), connect(port)
    assert [answer_of(line).status for line in (first, second)] == [200, 200]
    third, fourth = connect(port), connect(port)
    with fourth:
        assert received(fourth) == 0
    with third:
        refusal = answer_of(third)
        assert (refusal.status, refusal.headers["retry-after"], refusal.headers["connection"]) == (503, "5", "close")
        assert received(third) == 0
    assert [answer_of(line).status for line in (first, second)] == [200, 200]
    first.close()
    time.sleep(0.3)
    with connect(port) as fifth, second:
        assert answer_of(fifth).status == 200


def test_garbage_before_within_and_behind_a_request_breaks_nothing(port, caplog):
    chunked = BIG.replace(b"Host", b"Transfer-Encoding: chunked\r\nHost")
    with connect(port, 4096) as line:
        line.sendall(chunked)
        time.sleep(0.2)  # it is answered already
        line.sendall(b"no length\r\n")
        received(line)
    for request in (b"\x16\x03\x01 no HTTP\r\n\r\n", chunked + b"no length\r\n"):
        with connect(port) as line:
            assert answer_of(line, request).status == 400
    assert [record.getMessage() for record in caplog.records if record.levelno >= logging.ERROR] == []


def test_a_connection_that_waits_for_its_answer_has_no_deadline(monkeypatch, port):
    monkeypatch.setattr("meshreel.server.files.tag_of", lambda _: time.sleep(2))
    with connect(port) as line:
        assert answer_of(line, b"GET /posters/walk.reel.png HTTP/1.1\r\n" + HEAD).status == 200


@pytest.mark.skipif(sys.platform == "win32", reason="no such limit there")
def test_fewer_open_files_mean_fewer_connections(monkeypatch):
    import resource

    set_to = []
    monkeypatch.setattr(resource, "setrlimit", lambda _, limits: set_to.append(limits))
    for soft, hard, limit, allowed in ((256, 10_000, 640, 256), (256, 328, 328, 100), (5000, 9999, None, 256)):
        monkeypatch.setattr(resource, "getrlimit", lambda _, found=(soft, hard): found)
        assert room_for_files(Limits()).connections == allowed
        assert set_to[-1:] == ([(limit, hard)] if limit else set_to[-1:])
    assert len(set_to) == 2


def test_the_protocol_of_uvicorn_still_has_what_the_limits_go_by():
    assert {"send_400_response", "resume_writing", "connection_made"} <= set(dir(Connection.__base__))


def test_the_limits_are_those_that_the_documentation_states():
    page, limits = (ROOT / "docs/player.md").read_text(encoding="utf-8"), Limits()
    rows = [line for line in page[page.index("### Limits") :].splitlines() if line.startswith("| ")]
    assert [[int(number) for number in re.findall(r"\d+", row)] for row in rows[2:]] == [
        [limits.request],
        [limits.stall],
        [limits.connections, limits.refused, 503],
        [painter.PATIENCE, painter.MEMORY // 2**30],
        [posters.MOST_WAITING, posters.LONGEST_WAIT],
        [2],
    ]
