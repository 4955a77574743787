"""Sent files: all kinds of headers Range, streaming, and files that a client cannot reach."""

import asyncio
import mimetypes
import os
import socket
import sys

import pytest
from starlette.testclient import TestClient

from meshreel.server.app import make_app
from meshreel.server.library import Library
from tests.golden import GOLDEN

WALK = "/files/walk.reel"


SIZE = (GOLDEN / "layers.reel").stat().st_size
PART = 2**17  # bytes that are read before a file changes
HUGE = "9" * 4000
RANGES = {
    "bytes=0-0": (0, 1),
    "BYTES=0-3": (0, 4),
    f"bytes=-{HUGE}": (0, SIZE),
    f"bytes=0-{HUGE}": (0, SIZE),
    f"bytes={SIZE - 1}-": (SIZE - 1, SIZE),
    f"bytes={SIZE}-": 416,
    "bytes=-0": 416,
    f"bytes={HUGE}-": 416,
    "bytes=5-2": 400,
    "bytes=a-b": 400,
    "bytes=": 400,
    "items=0-3": 400,
    "bytes=" + "0-0," * 5000: 200,
}


@pytest.mark.parametrize("asked", RANGES, ids=lambda asked: ascii(asked)[1:30])
def test_a_range_gives_its_bytes_and_what_is_none_is_refused_or_ignored(client, folder, asked):
    data, wanted = (folder / "walk.reel").read_bytes(), RANGES[asked]
    answer = client.get(WALK, headers={"Range": asked.encode("latin-1")})
    if wanted == 416:
        assert (answer.status_code, answer.content) == (416, b"")
        assert answer.headers["content-range"] == f"bytes */{len(data)}"
    elif wanted in (200, 400):
        assert answer.status_code == wanted and "content-range" not in answer.headers
    else:
        start, stop = wanted
        assert answer.status_code == 206 and answer.content == data[start:stop]
        assert answer.headers["content-range"] == f"bytes {start}-{stop - 1}/{len(data)}"
        assert answer.headers["accept-ranges"] == "bytes"


def test_an_empty_file_has_no_range(client, folder):
    (folder / "walk.reel").write_bytes(b"")
    assert client.get(WALK, headers={"Range": "bytes=0-0"}).status_code == 416
    assert client.get(WALK).content == b""


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


def test_types_do_not_come_from_the_system(client, monkeypatch):
    monkeypatch.setattr(mimetypes, "guess_type", lambda *_: ("text/plain", "gzip"))
    assert client.get("/player/meshreel-player.js").headers["content-type"].startswith("text/javascript")
    assert client.get("/player/core.wasm").headers["content-type"] == "application/wasm"
    assert client.get(WALK).headers["content-type"] == "application/octet-stream"
    assert client.get(WALK).headers["x-content-type-options"] == "nosniff"


def test_pages_in_the_players_folder_have_the_policy_too(folder, player):
    (player / "index.html").write_text("<!doctype html>", encoding="utf-8")
    client = TestClient(make_app(Library(folder), player))
    page = client.get("/player/index.html")
    assert page.headers["content-type"].startswith("text/html")
    assert page.headers["content-security-policy"] == client.get("/").headers["content-security-policy"]


def test_a_file_that_may_not_be_read_is_refused(client, monkeypatch):
    monkeypatch.setattr(os, "access", lambda *_: False)
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
    """A connection that has read the beginning of the big file, and the length that its head announces."""
    line = socket.create_connection(("127.0.0.1", int(address.rstrip("/").rpartition(":")[2])), timeout=60)
    line.sendall(b"GET /files/big.reel HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n")
    head = b""
    while len(head) < PART:
        head += line.recv(PART - len(head))
    return line, int(head.lower().split(b"content-length: ")[1].split()[0])


def rest(line):
    with line:
        return sum(map(len, iter(lambda: line.recv(2**20), b"")))


def test_a_file_that_is_cut_while_it_is_sent_ends_the_connection(live, folder, player, big):
    line, size = half_read(live(make_app(Library(folder), player)))
    os.truncate(big, 2**20)
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
    assert PART + rest(line) > size and not caplog.records
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
    "/files/C:%5Cwindows%5Cwin.ini",
    "/files/walk.reel%00.txt",
    "/files/%FF%FE.reel",
    "/files/walk.reel::$DATA",
    "/files/secret.txt",
    "/files/sub",
    "/files/" + "a" * 5000 + ".reel",
    "/player/../videos/secret.txt",
    "/player/%2e%2e/videos/walk.reel",
    "/gallery.py",
    "/watch/secret.txt",
]


def test_a_client_that_leaves_paths_as_they_are_reaches_nothing_outside(live, folder, player):
    port = int(live(make_app(Library(folder), player)).rstrip("/").rpartition(":")[2])
    secret = (folder.parent / "outside.reel").read_bytes()
    answers = {path: raw(port, path) for path in [*RAW, WALK]}
    assert answers.pop(WALK).startswith(b"HTTP/1.1 200")
    assert [path for path, answer in answers.items() if answer.split()[1] not in (b"404", b"400")] == []
    assert [path for path, answer in answers.items() if secret[20:80] in answer or answer.endswith(b"secret")] == []
    assert raw(port, WALK).endswith((folder / "walk.reel").read_bytes())


def raw(port, path):
    """All that a server says to one request, whose path nobody tidies."""
    with socket.create_connection(("127.0.0.1", port), timeout=60) as line:
        line.sendall(f"GET {path} HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n".encode())
        return b"".join(iter(lambda: line.recv(2**16), b""))


def test_studies_and_their_network_traces_are_sent_and_not_listed_or_watched(client, folder):
    (folder / ".hidden.study.json").write_text("{}", encoding="utf-8")
    (folder / "package.json").write_text("{}", encoding="utf-8")
    for name in ("walk.study.json", "sub/slow.network.csv"):
        (folder / name).write_text(name, encoding="utf-8")
        assert client.get(f"/files/{name}").text == name
        assert client.get(f"/watch/{name}").status_code == 404
        assert name not in Library(folder).names()
    for name in (".hidden.study.json", "package.json", "../sub/slow.network.csv", "secret.txt"):
        assert client.get(f"/files/{name}").status_code == 404
