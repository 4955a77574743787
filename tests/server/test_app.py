"""Responses of the server: ranges, validators, types, pages, errors."""

import re
from base64 import b64encode
from hashlib import sha256
from html import unescape
from urllib.parse import quote

import pytest
from starlette.testclient import TestClient

from meshreel.errors import InputError
from meshreel.server.app import make_app
from meshreel.server.library import Library
from tests.server.conftest import ODD


def test_head_has_the_headers_and_no_body(client, folder):
    answer = client.head("/files/walk.reel")
    assert answer.status_code == 200 and answer.content == b""
    assert int(answer.headers["content-length"]) == (folder / "walk.reel").stat().st_size
    assert client.post("/files/walk.reel").status_code == 405


def test_the_gallery_shows_rate_and_length_and_what_is_wrong_with_a_file(client):
    text = client.get("/").text
    assert text.index("cut") < text.index("none") < text.index("walk")
    assert "14 frames" in text and "Mbps" in text and '<span class="time">0:01</span>' in text
    assert 'data-duration="0.560" data-size="1336"' in text  # to sort by
    assert "the file is truncated" in text and "not a .reel file" in text
    assert unescape(text).count(ODD.removesuffix(".reel")) == 1 and "<i>" not in text


def test_every_tile_leads_to_a_page_whose_player_has_the_file(client, folder):
    for name in ("walk.reel", f"sub/{ODD}"):
        page = client.get(f"/watch/{quote(name)}")
        assert page.status_code == 200 and "<i>" not in page.text
        source = unescape(page.text.split('src="/files')[1].split('"')[0])
        assert client.get(f"/files{source}").content == (folder / name).read_bytes()


def test_pages_run_no_script_but_the_player_and_may_be_embedded(client):
    page = client.get("/watch/walk.reel")
    policy = page.headers["content-security-policy"]
    assert "default-src 'none'" in policy and "script-src 'self' 'wasm-unsafe-eval'" in policy
    assert "media-src blob:" in policy  # audio
    assert "frame-ancestors" not in policy and "x-frame-options" not in page.headers
    assert "cross-origin-embedder-policy" not in page.headers
    styles = re.search("<style>(.*?)</style>", page.text, re.DOTALL)[1]
    assert b64encode(sha256(styles.encode()).digest()).decode() in policy and "unsafe-inline" not in policy
    assert "onclick" not in page.text and 'lang="en"' in page.text


def test_a_file_that_goes_away_after_it_was_listed_is_not_found(client, folder, monkeypatch):
    found = Library(folder).path_of("walk.reel")
    monkeypatch.setattr(Library, "path_of", lambda *_: found)
    (folder / "walk.reel").unlink()
    assert client.get("/files/walk.reel").status_code == 404
    assert client.get("/").status_code == 200


def test_one_file_is_served_alone(folder, player):
    client = TestClient(make_app(Library.of_file(folder / "walk.reel"), player))
    assert '<meshreel-player src="/files/walk.reel" controls autoplay loop>' in client.get("/").text
    assert client.get("/files/walk.reel").status_code == 200
    assert client.get("/files/cut.reel").status_code == client.get("/watch/cut.reel").status_code == 404


def test_other_origins_may_read_only_where_they_are_named(folder, player):
    asking = {"Origin": "https://example.org", "Range": "bytes=0-3"}
    silent = TestClient(make_app(Library(folder), player)).get("/files/walk.reel", headers=asking)
    assert "access-control-allow-origin" not in silent.headers
    client = TestClient(make_app(Library(folder), player, ("https://example.org",)))
    answer = client.get("/files/walk.reel", headers=asking)
    assert answer.status_code == 206 and answer.headers["access-control-allow-origin"] == "https://example.org"
    assert {"Content-Range", "ETag"} <= set(answer.headers["access-control-expose-headers"].split(", "))
    preflight = {"Origin": "https://example.org", "Access-Control-Request-Method": "GET"}
    preflight["Access-Control-Request-Headers"] = "range"
    assert client.options("/files/walk.reel", headers=preflight).status_code == 200
    other = client.get("/files/walk.reel", headers={"Origin": "https://elsewhere.example"})
    assert "access-control-allow-origin" not in other.headers


def test_a_preflight_from_a_page_to_the_local_network_is_answered(folder, player):
    client = TestClient(make_app(Library(folder), player, ("https://Example.org",)))
    asking = {"Origin": "https://example.org", "Access-Control-Request-Method": "GET"}
    asking["Access-Control-Request-Private-Network"] = "true"
    answer = client.options("/files/walk.reel", headers=asking)
    assert answer.status_code == 200 and answer.headers["access-control-allow-private-network"] == "true"


@pytest.mark.parametrize("origin", ["https://example.org/", "example.org", "", "ftp://example.org", "https://a b"])
def test_an_origin_that_no_browser_sends_is_reported(folder, player, origin):
    with pytest.raises(InputError, match=r"--cors .*give scheme, host and port alone"):
        make_app(Library(folder), player, (origin,))
