"""Files of the built player: compression, types, and addresses that name their contents."""

import re

import pytest
from starlette.testclient import TestClient

from meshreel.server.app import make_app
from meshreel.server.library import Library

PLAYER = "/player/meshreel-player.js"
TEXT = "export const text = 'the same again and again';\n" * 200


@pytest.fixture
def script(player):
    """The player's script, long enough to be worth compressing, with the Brotli of its build."""
    (player / "meshreel-player.js").write_text(TEXT, encoding="utf-8")
    (player / "meshreel-player.js.br").write_bytes(b"brotli")
    return player / "meshreel-player.js"


@pytest.fixture
def client(script, folder, player):  # noqa: ARG001  (the script is read when the app is made)
    """Of the whole folder, with that script."""
    return TestClient(make_app(Library(folder), player))


def lasting(client):
    """The player's folder under the address that pages have for it."""
    return re.search(r'src="(/player/[^/"]+/)page.js"', client.get("/watch/walk.reel").text)[1]


def test_text_is_compressed_for_those_who_take_it_and_reels_for_nobody(client):
    for path in (PLAYER, "/", "/watch/walk.reel"):
        plain, packed = (client.get(path, headers={"Accept-Encoding": coding}) for coding in ("identity", "gzip"))
        assert plain.content == packed.content and "content-encoding" not in plain.headers
        assert packed.headers["content-encoding"] == "gzip" and "Accept-Encoding" in packed.headers["vary"]
    assert "content-encoding" not in client.get("/files/walk.reel", headers={"Accept-Encoding": "gzip"}).headers


def test_brotli_that_came_with_the_build_is_sent_to_those_who_take_it(client):
    packed = client.head(PLAYER, headers={"Accept-Encoding": "gzip, br"})
    assert packed.headers["content-encoding"] == "br" and packed.headers["content-length"] == "6"
    assert packed.headers["content-type"].startswith("text/javascript") and "Accept-Encoding" in packed.headers["vary"]
    for accepted in ("gzip", "br;q=0, gzip", "identity"):
        assert client.get(PLAYER, headers={"Accept-Encoding": accepted}).text == TEXT
    assert client.get(f"{PLAYER}.br").status_code == 404


def test_a_file_is_revalidated(client, script):
    tag = client.get(PLAYER).headers["etag"]
    assert client.get(PLAYER, headers={"If-None-Match": tag}).status_code == 304
    script.write_text("another build", encoding="utf-8")
    assert client.get(PLAYER, headers={"If-None-Match": tag}).text == "another build"


def test_pages_name_the_player_by_its_contents_and_browsers_need_not_ask_again(client, script, folder, player):
    address = lasting(client)
    answer = client.get(f"{address}meshreel-player.js")
    assert answer.text == TEXT and "immutable" in answer.headers["cache-control"]
    assert "max-age=31536000" in answer.headers["cache-control"]
    assert address in client.get("/").text
    for path in ("/watch/walk.reel", PLAYER, "/files/walk.reel"):
        assert client.get(path).headers["cache-control"] == "no-cache"
    script.write_text("another build", encoding="utf-8")
    again = TestClient(make_app(Library(folder), player))
    assert lasting(again) != address and again.get(f"{address}meshreel-player.js").status_code == 404


def test_without_a_built_player_pages_are_there_and_its_files_are_not(folder, tmp_path):
    client = TestClient(make_app(Library(folder), tmp_path / "absent"))
    assert "page.js" in client.get("/watch/walk.reel").text
    assert client.get("/player/page.js").status_code == client.get("/player//page.js").status_code == 404
