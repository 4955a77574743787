"""Posters: cached per version of a file, drawn without blocking other requests, with a transparent background."""

from __future__ import annotations

import io
import sys
import threading
import urllib.request
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

import meshreel.server.posters as posters
from meshreel.server.app import make_app
from meshreel.server.library import Library
from meshreel.types import Mesh

POSTER = "/posters/walk.reel.png"


def test_a_poster_is_drawn_once_until_its_file_changes(client, folder, monkeypatch):
    drawn = []
    monkeypatch.setattr(posters, "_picture", lambda mesh, _: drawn.append(mesh) or b"picture")
    first = client.get(POSTER)
    tag = first.headers["etag"]
    assert first.content == client.get(POSTER).content == b"picture"
    unchanged = client.get(POSTER, headers={"If-None-Match": tag})
    assert (unchanged.status_code, unchanged.content, unchanged.headers["etag"]) == (304, b"", tag)
    assert len(drawn) == 1
    scene = (folder.parent / "outside.reel").read_bytes()
    (folder / "walk.reel").write_bytes(scene)
    changed = client.get(POSTER, headers={"If-None-Match": tag})
    assert changed.status_code == 200 and changed.headers["etag"] != tag and len(drawn) == 2


def test_without_a_renderer_there_is_a_plain_tile_that_is_not_kept(client, monkeypatch):
    monkeypatch.setitem(sys.modules, "PIL", None)
    tile = client.get(POSTER)
    assert tile.headers["content-type"] == "image/svg+xml" and tile.headers["cache-control"] == "no-store"
    assert "etag" not in tile.headers


def test_no_more_posters_are_kept_than_said(folder, monkeypatch):
    monkeypatch.setattr(posters, "_picture", lambda *_: b"picture")
    monkeypatch.setattr(posters, "MOST_POSTERS", 2)
    kept = posters.Posters()
    for tag in "abcd":
        kept.of(folder / "walk.reel", tag)
    assert [tag for _, tag in kept._known] == ["c", "d"]


def test_files_are_answered_however_many_wait_for_a_poster(live, folder, player, monkeypatch):
    begun, go_on = threading.Event(), threading.Event()

    def slow(*_):
        begun.set()
        assert go_on.wait(60)
        return b"picture"

    monkeypatch.setattr(posters, "_poster", slow)
    address = live(make_app(Library(folder), player))

    def fetch(path):
        with urllib.request.urlopen(f"{address}{path}", timeout=60) as answer:
            return answer.read()

    with ThreadPoolExecutor(64) as pool:
        waiting = [pool.submit(fetch, "posters/walk.reel.png") for _ in range(60)]  # more than a server has threads
        try:
            assert begun.wait(60)
            assert fetch("files/walk.reel") == (folder / "walk.reel").read_bytes()
            assert not any(poster.done() for poster in waiting)
        finally:
            go_on.set()
        assert {poster.result(60) for poster in waiting} == {b"picture"}


@pytest.mark.parametrize("towards", [1, -1])
def test_a_room_is_seen_from_where_it_is_open(towards):
    """A wall that faces +z or -z, whose right half (+x, as seen from +z) is lower than its left."""
    pytest.importorskip("open3d")
    image = pytest.importorskip("PIL.Image")
    corners = np.array([[-1, 0, 0], [1, 0, 0], [1, 0.5, 0], [-1, 2, 0]], dtype=np.float64)
    faces = np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32)
    wall = Mesh.of(corners, faces if towards > 0 else faces[:, ::-1])
    picture = np.asarray(image.open(io.BytesIO(posters._picture(wall, "y"))))
    assert picture.shape == (posters.HEIGHT, posters.WIDTH, 4) and set(np.unique(picture[..., 3])) == {0, 255}
    left, right = np.split(picture[..., 3] > 0, 2, axis=1)
    assert (left.sum() > 1.5 * right.sum()) if towards > 0 else (right.sum() > 1.5 * left.sum())


def test_a_poster_stands_on_its_feet():
    pytest.importorskip("open3d")
    image = pytest.importorskip("PIL.Image")
    corners = np.array([[-2, 0, 0], [2, 0, 0], [0, 1, 0.1], [0, 1, -0.1]], dtype=np.float64)  # broad feet at y = 0
    hut = Mesh.of(corners, np.array([[0, 1, 2], [1, 0, 3], [0, 2, 3], [2, 1, 3]], dtype=np.int32))
    turned = {"y": corners, "-y": corners * [1, -1, -1], "z": corners[:, [0, 2, 1]] * [1, -1, 1]}
    pictures = [image.open(io.BytesIO(posters._picture(Mesh.of(v, hut.faces), up))) for up, v in turned.items()]
    shapes = [np.asarray(picture)[..., 3] > 0 for picture in pictures]
    for shape in shapes:
        rows = np.flatnonzero(shape.any(axis=1))
        assert shape[rows[-4:]].sum() > 5 * shape[rows[:4]].sum()
        assert (shape == shapes[0]).mean() > 0.99
