"""Answers from memory: compression, tags of each coding, and addresses that name their contents."""

from __future__ import annotations

import gzip
import os
import re

import pytest
from starlette.testclient import TestClient

from meshreel.server.app import make_app
from meshreel.server.assets import takes
from meshreel.server.library import Library

PLAYER = "/player/meshreel-player.js"
TEXT = "export const text = 'the same again and again';\n" * 200


@pytest.fixture
def script(player):
    """The player's script, long enough to be worth compressing."""
    (player / "meshreel-player.js").write_text(TEXT, encoding="utf-8")
    return player / "meshreel-player.js"


def lasting(client):
    """The player's folder under the address that pages have for it."""
    return re.search(r'src="(/player/[^/"]+/)page.js"', client.get("/watch/walk.reel").text)[1]


@pytest.mark.usefixtures("script")
def test_text_and_wasm_are_compressed_for_those_who_take_it_and_reels_for_nobody(client):
    for path in (PLAYER, "/", "/style.css", "/watch/walk.reel"):
        plain, packed = (client.get(path, headers={"Accept-Encoding": coding}) for coding in ("identity", "gzip"))
        assert plain.content == packed.content and "content-encoding" not in plain.headers
        assert packed.headers["content-encoding"] == "gzip"
        assert int(packed.headers["content-length"]) < int(plain.headers["content-length"]) == len(plain.content)
        assert plain.headers["vary"] == packed.headers["vary"] == "Accept-Encoding"
        assert plain.headers["etag"] != packed.headers["etag"]
    assert "content-encoding" not in client.get("/files/walk.reel", headers={"Accept-Encoding": "gzip"}).headers
    small = client.get("/player/core.wasm", headers={"Accept-Encoding": "gzip"})
    assert "content-encoding" not in small.headers and small.content == b"\0asm"


def test_brotli_that_came_with_the_build_is_sent_to_those_who_take_it(client, script):
    (script.parent / f"{script.name}.br").write_bytes(b"brotli")
    packed = client.head(PLAYER, headers={"Accept-Encoding": "gzip, br"})
    assert packed.headers["content-encoding"] == "br" and packed.headers["content-length"] == "6"
    assert client.get(PLAYER, headers={"Accept-Encoding": "gzip"}).text == TEXT
    assert client.get(f"{PLAYER}.br").status_code == 404


@pytest.mark.usefixtures("script")
def test_each_coding_is_revalidated_by_its_own_tag(client):
    tags = {
        coding: client.get(PLAYER, headers={"Accept-Encoding": coding}).headers["etag"] for coding in ("br", "gzip")
    }
    for coding in tags:
        for stated, tag in tags.items():
            answer = client.get(PLAYER, headers={"Accept-Encoding": coding, "If-None-Match": tag})
            assert answer.status_code == (304 if stated == coding else 200)
            assert answer.headers["etag"] == tags[coding] and answer.headers["vary"] == "Accept-Encoding"


@pytest.mark.usefixtures("script")
def test_head_and_ranges_of_what_is_compressed_are_those_of_the_coding(client):
    for coding in ("identity", "gzip"):
        asked = {"Accept-Encoding": coding}
        head, whole = client.head(PLAYER, headers=asked), client.get(PLAYER, headers=asked)
        assert head.content == b"" and dict(head.headers) == dict(whole.headers)
        part = client.get(PLAYER, headers=asked | {"Range": "bytes=0-3"})
        assert part.status_code == 200 and part.content == whole.content  # a server need not know ranges


@pytest.mark.parametrize(
    "accepted, taken",
    [("gzip", True), ("deflate, GZIP;q=0.5", True), ("*", True), ("br;q=1, *;q=0.1", True), ("gzip; q=1", True)]
    + [
        ("", False),
        ("br", False),
        ("gzip;q=0", False),
        ("gzip;q=0.000, *", False),
        ("*;q=0", False),
        ("gzipped", False),
    ],
)
def test_gzip_is_sent_to_those_alone_who_say_so(accepted, taken):
    assert takes(accepted, "gzip") == taken


def test_pages_name_the_player_by_its_contents_and_browsers_need_not_ask_again(client, script):
    folder = lasting(client)
    answer = client.get(f"{folder}meshreel-player.js")
    assert answer.text == TEXT and "immutable" in answer.headers["cache-control"]
    assert "max-age=31536000" in answer.headers["cache-control"]
    assert client.get("/watch/walk.reel").headers["cache-control"] == "no-cache"
    assert client.get(PLAYER).headers["cache-control"] == "no-cache"
    assert client.get("/files/walk.reel").headers["cache-control"] == "no-cache"
    script.write_text("another build", encoding="utf-8")
    assert lasting(client) != folder and client.get(PLAYER).text == "another build"
    assert client.get(f"{folder}meshreel-player.js").status_code == 404  # never other contents under this address


def test_a_build_of_equal_time_and_size_has_another_tag(client, script):
    os.utime(script, (1e9, 1e9))
    first = client.get(PLAYER).headers["etag"]
    script.write_text(TEXT.replace("again", "later"), encoding="utf-8")
    os.utime(script, (1e9, 1e9))
    assert client.get(PLAYER).headers["etag"] != first


def test_without_a_built_player_pages_are_there_and_its_files_are_not(folder, tmp_path):
    client = TestClient(make_app(Library(folder), tmp_path / "absent"))
    assert 'src="/player/page.js"' in client.get("/watch/walk.reel").text
    assert client.get("/player/page.js").status_code == client.get("/player//page.js").status_code == 404


def test_the_same_bytes_are_compressed_to_the_same_bytes(client):
    with client.stream("GET", "/style.css", headers={"Accept-Encoding": "gzip"}) as one:
        raw = b"".join(one.iter_raw())
    assert gzip.decompress(raw) == client.get("/style.css", headers={"Accept-Encoding": "identity"}).content
    assert raw[4:8] == bytes(4)  # no time of compression, or the tag would tell equal bytes that differ
