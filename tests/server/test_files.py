"""Sent files: all kinds of ranges, streaming, and files that a client cannot reach."""

from __future__ import annotations

import asyncio
import email
import mimetypes
import pathlib
import socket
import sys

import pytest

from meshreel.server.app import make_app
from meshreel.server.library import Library

WALK = "/files/walk.reel"


def test_several_ranges_come_as_parts(client, folder):
    data = (folder / "walk.reel").read_bytes()
    answer = client.get(WALK, headers={"Range": "bytes=0-3, 10-19, -5"})
    assert answer.status_code == 206 and len(answer.content) == int(answer.headers["content-length"])
    head = f"Content-Type: {answer.headers['content-type']}\n\n".encode()
    parts = email.message_from_bytes(head + answer.content).get_payload()
    assert [part.get_payload(decode=True) for part in parts] == [data[:4], data[10:20], data[-5:]]
    assert parts[1]["content-range"] == f"bytes 10-19/{len(data)}"


@pytest.mark.parametrize("asked", ["0-9,5-20", "0-0,0-20", ",".join(["0-20"] * 100)])
def test_ranges_that_overlap_are_sent_once(client, folder, asked):
    answer = client.get(WALK, headers={"Range": f"bytes={asked}"})
    assert answer.status_code == 206 and answer.content == (folder / "walk.reel").read_bytes()[:21]


@pytest.mark.parametrize("asked", ["99999999-", "-0", "0-3,99999999-"])
def test_a_range_behind_the_end_is_reported_with_the_size(client, folder, asked):
    answer = client.get(WALK, headers={"Range": f"bytes={asked}"})
    assert answer.status_code == 416 and answer.content == b""
    assert answer.headers["content-range"] == f"bytes */{(folder / 'walk.reel').stat().st_size}"


def test_any_range_of_an_empty_file_is_behind_its_end(client, folder):
    (folder / "walk.reel").write_bytes(b"")
    assert client.get(WALK, headers={"Range": "bytes=0-0"}).status_code == 416
    assert client.get(WALK).content == b""


@pytest.mark.parametrize(
    "asked",
    ["", "bytes", "bytes=", "bytes=,", "bytes=--1", "bytes=-1-", "bytes=0--5", "bytes=0x10-", "items=0-3", "bytes=1e3-"]
    + ["bytes=" + "0-0," * 5000, "bytes=-" + "9" * 5000, "bytes=" + "9" * 5000 + "-", "bytes=0-" + "9" * 5000],
)
def test_garbage_is_no_fault_and_gives_no_more_than_the_file(client, folder, asked):
    answer = client.get(WALK, headers={"Range": asked})
    assert answer.status_code in (200, 206, 400, 416)
    assert answer.status_code >= 400 or answer.content == (folder / "walk.reel").read_bytes()


def test_if_range_takes_the_tag_or_the_date_and_no_weak_tag(client):
    headers = client.get(WALK).headers
    for stated, code in (
        (headers["etag"], 206),
        (headers["last-modified"], 206),
        (f"W/{headers['etag']}", 200),
        ('"other"', 200),
        ("Thu, 01 Jan 1970 00:00:00 GMT", 200),
    ):
        assert client.get(WALK, headers={"Range": "bytes=0-3", "If-Range": stated}).status_code == code


def test_tags_in_a_list_and_a_star_are_heard(client):
    tag = client.get(WALK).headers["etag"]
    for stated, code in ((f'"a", {tag}', 304), ("*", 304), (f"W/{tag}", 304), ('"a", "b"', 200)):
        answer = client.get(WALK, headers={"If-None-Match": stated})
        assert answer.status_code == code and (code == 200 or (answer.content == b"" and answer.headers["etag"] == tag))


def test_head_of_a_range_has_its_length_and_no_body(client):
    answer = client.head(WALK, headers={"Range": "bytes=0-3"})
    assert (answer.status_code, answer.headers["content-length"], answer.content) == (206, "4", b"")


def test_types_do_not_come_from_the_system(client, monkeypatch):
    monkeypatch.setattr(mimetypes, "guess_type", lambda *_: ("text/plain", "gzip"))
    assert client.get("/player/meshreel-player.js").headers["content-type"].startswith("text/javascript")
    assert client.get("/player/core.wasm").headers["content-type"] == "application/wasm"
    assert client.get(WALK).headers["content-type"] == "application/octet-stream"
    assert client.get(WALK).headers["x-content-type-options"] == "nosniff"


def test_pages_in_the_players_folder_have_the_policy_too(client, player):
    (player / "index.html").write_text("<!doctype html>", encoding="utf-8")
    page = client.get("/player/index.html")
    assert page.headers["content-type"].startswith("text/html")
    assert page.headers["content-security-policy"] == client.get("/").headers["content-security-policy"]


def test_a_file_that_may_not_be_read_is_refused(client, monkeypatch):
    def refused(*_, **__):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(pathlib.Path, "open", refused)
    answer = client.get(WALK)
    assert answer.status_code == 403 and "Permission denied" in answer.text


def test_a_file_is_read_in_pieces(folder, player):
    size = 24 * 2**20
    with (folder / "big.reel").open("wb") as file:
        file.truncate(size)
    messages = asyncio.run(ask(make_app(Library(folder), player), "/files/big.reel"))
    pieces = [len(message["body"]) for message in messages if message["type"] == "http.response.body"]
    assert sum(pieces) == size and max(pieces) <= 2**20


@pytest.mark.skipif(sys.platform == "win32", reason="files there are not sparse unless asked for")
def test_a_range_behind_four_gigabytes_is_found(client, folder):
    with (folder / "big.reel").open("wb") as file:
        file.seek(5 * 2**30)
        file.write(b"end")
    answer = client.get("/files/big.reel", headers={"Range": f"bytes={5 * 2**30}-"})
    assert answer.status_code == 206 and answer.content == b"end"


async def ask(app, path):
    """What an application sends, message by message."""
    sent = []

    async def receive():
        await asyncio.sleep(3600)

    async def send(message):
        sent.append(message)

    scope = {"type": "http", "method": "GET", "path": path, "raw_path": path.encode(), "query_string": b""}
    await app(scope | {"headers": [(b"host", b"localhost")], "asgi": {"spec_version": "2.4"}}, receive, send)
    return sent


RAW = [
    "/files/../outside.reel",
    "/files/../../../../../../etc/passwd",
    "/files/%2e%2e/outside.reel",
    "/files/..%2Foutside.reel",
    "/files/%252e%252e%252foutside.reel",
    "/files/sub/..%2f..%2foutside.reel",
    "/files/..\\outside.reel",
    "/files/..%5Coutside.reel",
    "/files/..%c0%afoutside.reel",
    "/files/%00/../outside.reel",
    "/files/....//outside.reel",
    "/files//../outside.reel",
    "//files/../outside.reel",
    "/player/../../outside.reel",
    "/player/%2e%2e/outside.reel",
    "/player/..%5c..%5coutside.reel",
    "/player//etc/passwd",
    "/watch/../outside.reel",
    "/posters/..%2foutside.reel.png",
    "/posters/%2e%2e%2f.png",
    "/files/C:%5Cwindows%5Cwin.ini",
    "/files/walk.reel%00.txt",
    "/files/%FF%FE.reel",
    "/files/walk.reel::$DATA",
]


def test_a_client_that_leaves_paths_as_they_are_reaches_nothing_outside(live, folder, player):
    port = int(live(make_app(Library(folder), player)).rstrip("/").rpartition(":")[2])
    secret = (folder.parent / "outside.reel").read_bytes()
    answers = {path: raw(port, path) for path in [*RAW, WALK]}
    assert answers.pop(WALK).startswith(b"HTTP/1.1 200")
    assert [path for path, answer in answers.items() if answer.split()[1] not in (b"404", b"400")] == []
    assert [path for path, answer in answers.items() if secret[20:80] in answer] == []
    assert raw(port, WALK).endswith((folder / "walk.reel").read_bytes())


def raw(port, path):
    """All that a server says to one request, whose path nobody tidies."""
    with socket.create_connection(("127.0.0.1", port), timeout=60) as line:
        line.sendall(f"GET {path} HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n".encode())
        return b"".join(iter(lambda: line.recv(2**16), b""))
