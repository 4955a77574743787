"""Sent files: all kinds of headers Range, streaming, and files that a client cannot reach."""

from __future__ import annotations

import asyncio
import json
import mimetypes
import os
import pathlib
import socket
import sys
import time
from dataclasses import replace
from email.utils import formatdate

import pytest

from meshreel.container.writer import ReelWriter
from meshreel.format.layout import DracoGroup, Form
from meshreel.format.records import pack
from meshreel.server import files
from meshreel.server.app import make_app
from meshreel.server.library import Library
from tests.container.files import HEADER
from tests.golden import GOLDEN

WALK = "/files/walk.reel"


SIZE = (GOLDEN / "layers.reel").stat().st_size
HUGE = "9" * 5000
RANGES = {
    "bytes=0-0": (0, 1),
    "BYTES=0-3": (0, 4),
    "bytes=0-3, 5-9": 200,
    "bytes=000-0003": (0, 4),
    f"bytes=-{HUGE}": (0, SIZE),
    f"bytes=0-{HUGE}": (0, SIZE),
    f"bytes={SIZE - 1}-": (SIZE - 1, SIZE),
    f"bytes={SIZE}-": 416,
    "bytes=-0": 416,
    f"bytes={HUGE}-": 416,
    "bytes=5-2": 200,
    f"bytes={HUGE}-1": 200,
    "bytes=a-b": 200,
    "bytes=0x0-3": 200,
    "bytes=\u00b2-3": 200,
    "bytes=0 - 3": 200,
    "bytes=1-2-3": 200,
    "bytes=--1": 200,
    "bytes=+1-2": 200,
    "bytes=1e3-": 200,
    "bytes=-": 200,
    "bytes=": 200,
    "bytes=,": 200,
    "bytes": 200,
    "bytes =0-3": 200,
    "": 200,
    "items=0-3": 200,
    "bytes=" + "0-0," * 5000: 200,
}


@pytest.mark.parametrize("asked", RANGES, ids=lambda asked: ascii(asked)[1:30])
def test_ranges_are_those_of_rfc_9110_and_what_is_none_is_ignored(client, folder, asked):
    data, wanted = (folder / "walk.reel").read_bytes(), RANGES[asked]
    answer = client.get(WALK, headers={"Range": asked.encode("latin-1")})
    if wanted == 416:
        assert (answer.status_code, answer.content) == (416, b"")
        assert answer.headers["content-range"] == f"bytes */{len(data)}"
    elif wanted == 200:
        assert answer.status_code == 200 and answer.content == data and "content-range" not in answer.headers
    else:
        start, stop = wanted
        assert answer.status_code == 206 and answer.content == data[start:stop]
        assert answer.headers["content-range"] == f"bytes {start}-{stop - 1}/{len(data)}"


def test_two_headers_range_are_none(client, folder):
    answer = client.get(WALK, headers=[("Range", "bytes=0-3"), ("Range", "bytes=4-7")])
    assert answer.status_code == 200 and answer.content == (folder / "walk.reel").read_bytes()


def test_an_empty_file_has_no_range(client, folder):
    (folder / "walk.reel").write_bytes(b"")
    assert client.get(WALK, headers={"Range": "bytes=0-0"}).status_code == 416
    for asked in ({}, {"Range": "bytes=-5"}):
        answer = client.get(WALK, headers=asked)
        assert (answer.status_code, answer.content) == (200, b"")


def test_if_range_takes_the_tag_or_the_date_and_no_weak_tag(client, folder):
    os.utime(folder / "walk.reel", (1e9, 1e9))
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


def test_a_date_is_told_only_when_it_tells_versions_apart(client, folder):
    assert "last-modified" not in client.get(WALK).headers  # the file may change again within this second
    date = formatdate((folder / "walk.reel").stat().st_mtime, usegmt=True)
    assert client.get(WALK, headers={"Range": "bytes=0-3", "If-Range": date}).status_code == 200
    os.utime(folder / "walk.reel", (1e9, 1e9))
    stated = {"If-Modified-Since": client.get(WALK).headers["last-modified"]}
    assert client.get(WALK, headers=stated).status_code == 304
    os.utime(folder / "walk.reel", (1e9 + 1, 1e9 + 1))
    assert client.get(WALK, headers=stated).status_code == 200


def test_head_has_no_ranges(client):
    answer = client.head(WALK, headers={"Range": "bytes=0-3"})
    assert (answer.status_code, answer.headers["content-length"], answer.content) == (200, str(SIZE), b"")


@pytest.mark.parametrize("length", [1, 20_000], ids=["a short head", "a head longer than what is read of it"])
def test_files_of_equal_time_and_size_have_other_tags(client, folder, length):
    file, answers, sizes = folder / "walk.reel", [], set()
    for mesh in (b"one", b"two"):
        with ReelWriter(file, replace(HEADER, metadata=json.dumps({"note": "x" * length}))) as writer:
            writer.add_group(0, 1, pack(DracoGroup(Form.DRACO, 0, 0.001, (mesh,))))
        os.utime(file, ns=(10**18, 10**18))
        sizes.add(file.stat().st_size)
        opened = files.OpenFile.of(file)
        opened.file.close()
        answers.append((files_sum(opened, file), opened.tag))
    assert len(sizes) == 1 and len({tag for tag, _ in answers}) == 2
    stale = client.get(WALK, headers={"If-None-Match": answers[0][1], "Range": "bytes=0-3", "If-Range": answers[0][1]})
    assert stale.status_code == 200 and stale.content == file.read_bytes()


def files_sum(opened, file):
    """The tag that a file had if the system stored no time of its change but the one that `utime` sets."""
    with file.open("rb") as again:
        return files._sum(again, (opened.found.st_size, opened.found.st_mtime_ns, 0))


@pytest.mark.skipif(sys.platform == "win32", reason="the system has no time of the last change but one that can be set")
def test_a_file_that_was_changed_within_its_layers_alone_has_another_tag(client, folder):
    data, tags = (folder / "walk.reel").read_bytes(), set()
    for contents in (data, data[:-1] + b"\0"):
        (folder / "walk.reel").write_bytes(contents)
        os.utime(folder / "walk.reel", ns=(10**18, 10**18))
        tags.add(client.get(WALK).headers["etag"])
        time.sleep(0.05)  # the clock of a file system moves in steps
    assert len(tags) == 2


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


@pytest.fixture
def big(folder):
    """A file that does not fit into the buffers of a connection."""
    with (folder / "big.reel").open("wb") as file:
        file.truncate(48 * 2**20)
    return folder / "big.reel"


def half_read(address):
    """A connection that has asked for the big file and has read its head, and the length that this announces."""
    line = socket.create_connection(("127.0.0.1", int(address.rstrip("/").rpartition(":")[2])), timeout=60)
    line.sendall(b"GET /files/big.reel HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n")
    head = line.recv(500, socket.MSG_WAITALL)
    return line, int(head.lower().split(b"content-length: ")[1].split()[0])


def rest(line):
    with line:
        return sum(map(len, iter(lambda: line.recv(2**20), b"")))


def test_a_file_that_is_cut_while_it_is_sent_ends_the_connection_with_one_line(live, folder, player, big, caplog):
    line, size = half_read(live(make_app(Library(folder), player)))
    os.truncate(big, 2**20)
    assert rest(line) < size
    assert [record.name for record in caplog.records] == ["meshreel.server.files"]
    assert "big.reel' has changed" in caplog.text and "Traceback" not in caplog.text


def test_a_file_that_is_overwritten_while_it_is_sent_is_not_mixed(live, folder, player, big):
    line, size = half_read(live(make_app(Library(folder), player)))
    with big.open("rb+") as file:
        file.seek(40 * 2**20)
        file.write(b"new")
    assert rest(line) < size


@pytest.mark.skipif(sys.platform == "win32", reason="open files cannot be deleted there")
@pytest.mark.parametrize("change", ["deleted", "replaced"])
def test_a_file_that_is_deleted_or_replaced_is_sent_to_its_end_and_then_never_again(
    live, folder, player, big, change, caplog
):
    address = live(make_app(Library(folder), player))
    line, size = half_read(address)
    big.unlink()
    if change == "replaced":
        big.write_bytes(b"new")
    assert 500 + rest(line) > size and not caplog.records
    assert raw(int(address.rstrip("/").rpartition(":")[2]), "/files/big.reel")[9:12] == (
        b"404" if change == "deleted" else b"200"
    )


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
